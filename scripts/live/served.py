# SPDX-License-Identifier: Apache-2.0
"""viser behind the gate: a page with a scene and its controls."""

from __future__ import annotations

import asyncio
import contextlib
import importlib
import io
import secrets
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from scripts.live.drawn import LOG_BOUNDS, look_at
from scripts.live.gate import SECRET, Gate, hidden_host, new_token
from slam.errors import InvalidValueError, MissingDependencyError


def require() -> Any:
    """``viser``; ``MissingDependencyError`` with a remedy where it is not installed."""
    try:
        return importlib.import_module("viser")
    except ImportError as error:
        raise MissingDependencyError(
            "pages with a scene in 3-D need viser: pip install viser"
        ) from error


PANEL = 0.3  # of a room's width: so much more is left for the panel at its right
# viser's panel covers most of a phone: there it begins as a strip, whose handle opens half of it.
# A browser captures a finger for what it touches, which viser takes for a drag: no tap would click.
_PHONE = b"""<style>@media (max-width: 600px) {
[style*="max-height: 60%"] { width: 100% !important; max-height: 50% !important }
[style*="max-height: 60%"] * { max-width: 100vw }
}</style><script>
if (innerWidth <= 600) new MutationObserver((_, seen) => {
  const handle = document.querySelector('[style*="max-height: 60%"] [style*="cursor: pointer"]');
  if (handle) { seen.disconnect(); setTimeout(() => handle.click(), 500) }
}).observe(document, {childList: true, subtree: true})
addEventListener('pointerdown', event => {
  if (event.pointerType === 'touch') event.target.releasePointerCapture(event.pointerId)
}, true)
</script></head>"""


def page_of(viser: Any) -> bytes:
    """The page that viser's wheel brings: one file, whole without a net."""
    page = (Path(viser.__file__).parent / "client" / "build" / "index.html").read_bytes()
    return page.replace(b"</head>", _PHONE, 1)


class Served:
    """A page at an address.

    scene, gui  of viser: what is shown and what can be set
    port        where it listens, also where 0 was asked for;   behind  where viser does
    """

    def __init__(self, address: tuple[str, int], title: str, origins: Sequence[str] = ()) -> None:
        viser = require()
        host = hidden_host()
        with contextlib.redirect_stdout(io.StringIO()):  # it prints where it listens
            self._viser = viser.ViserServer(host, port=0, label=title, verbose=False)
        self._bounds: Sequence[float] = LOG_BOUNDS
        secret = secrets.token_urlsafe(16)
        _only_from_gate(self._viser, secret)
        self.scene, self.gui = self._viser.scene, self._viser.gui
        self.camera = self._viser.initial_camera
        self._viser.on_client_connect(self._turn_for_phone)
        self.gui.configure_theme(show_logo=False, show_share_button=False, control_width="medium")
        self.behind = behind = (host, int(self._viser.get_port()))
        try:
            self._gate = Gate(
                address, behind, page_of(viser), origins=origins, token=new_token(address[0]),
                secret=secret,
            )  # fmt: skip
        except InvalidValueError:
            self._stop()
            raise
        self.port = self._gate.port

    @property
    def token(self) -> str:
        """What the address must hold, where others can reach it; else empty."""
        return self._gate.rules.token

    def look_at(self, bounds: Sequence[float]) -> None:
        """Let pages that come show that room."""
        self._bounds = bounds
        xmin, ymin, xmax, ymax = bounds
        look_at(self.camera, (xmin, ymin, xmax + PANEL * (xmax - xmin), ymax))

    def _turn_for_phone(self, client: Any) -> None:
        """Once a page shows the first view, turn it where the screen is upright."""

        @client.camera.on_update  # type: ignore[untyped-decorator]
        def _(camera: Any) -> None:
            first = np.allclose(camera.position, self.camera.position, atol=0.01)
            if first and camera.aspect < 1.0:
                look_at(camera, self._bounds, upright=True)

    def clients(self) -> dict[int, Any]:
        """Who is there, as viser's handles."""
        found: dict[int, Any] = self._viser.get_clients()
        return found

    def close(self) -> None:
        """Stop listening."""
        self._gate.close()
        self._stop()

    def _stop(self) -> None:
        with contextlib.redirect_stdout(io.StringIO()):
            self._viser.stop()


def _only_from_gate(viser: Any, secret: str) -> None:
    """Let viser refuse what did not come through the gate, before it sends or reads a message."""
    server = viser._websock_server

    async def check(client: Any) -> None:
        connection = server._live_connections[client.client_id]
        if connection.request.headers.get_all(SECRET) != [secret]:
            del server._live_connections[client.client_id]
            del server._client_state_from_id[client.client_id]
            await connection.close(1008)
            raise asyncio.CancelledError  # which ends this connection's task, and nothing else

    server._client_connect_cb.insert(0, check)

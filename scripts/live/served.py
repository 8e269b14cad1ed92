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


def page_of(viser: Any) -> bytes:
    """The page that viser's wheel brings: one file, whole without a net."""
    return (Path(viser.__file__).parent / "client" / "build" / "index.html").read_bytes()


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
        secret = secrets.token_urlsafe(16)
        _only_from_gate(self._viser, secret)
        self.scene, self.gui = self._viser.scene, self._viser.gui
        self.camera = self._viser.initial_camera
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

# SPDX-License-Identifier: Apache-2.0
"""viser behind the gate: a page with a scene and its controls."""

import asyncio
import contextlib
import hmac
import importlib
import io
import ipaddress
import logging
import math
import secrets
import sys
import threading
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from http import HTTPStatus
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import numpy as np

from scripts.live.drawn import look_at
from scripts.live.messages import Controls, Seldom
from slam.errors import InvalidValueError, MissingDependencyError

log = logging.getLogger(__name__)

MOST_CLIENTS = 8  # at once
MOST_BYTES = 4096  # of a message of a page; where its camera is takes 300
MOST_RATE = 120.0  # messages a second of one page; more of them wait
HEAD_S = 5.0  # s until a handshake is there
CARRIED = 1 << 16  # bytes that wait in the gate for a client that is slow, and a message more
SECRET = "X-Mobilia-Gate"  # header of a handshake that went through the gate


class Refused(Exception):
    """A handshake that is not let through: status and reason."""

    def __init__(self, status: HTTPStatus, why: str) -> None:
        super().__init__(why)
        self.status = status


@dataclass(frozen=True, kw_only=True)
class Rules:
    """Who is let in.

    host     that the gate listens at, ``port`` too
    origins  of pages beside those that the gate's own address serves
    token    that the address must hold; empty: none
    """

    host: str
    port: int
    origins: tuple[str, ...] = ()
    token: str = ""

    def names(self) -> frozenset[str]:
        """Hosts that a client may have asked for: a name that leads here by force is none."""
        own = f"[{self.host}]" if ":" in self.host else self.host
        return frozenset(f"{name}:{self.port}" for name in ("localhost", "127.0.0.1", "[::1]", own))

    def check(self, path: str, headers: Any) -> bool:
        """Whether a request, ``headers`` of ``websockets``, wants the page; False: its WebSocket.

        Raises ``Refused``.
        """
        hosts, origins = headers.get_all("Host"), headers.get_all("Origin")
        given = path.partition("?")[0].strip("/")
        if len(hosts) != 1 or (not self.token and hosts[0].lower() not in self.names()):
            raise Refused(HTTPStatus.FORBIDDEN, f"the address is not {self.host}:{self.port}")
        if self.token and not hmac.compare_digest(given.encode(), self.token.encode()):
            raise Refused(HTTPStatus.FORBIDDEN, "the token in the address is missing or wrong")
        if origins and (len(origins) > 1 or not self._knows(origins[0], hosts[0])):
            why = f"a page of {origins[0]!r:.80} wants in; --allow-origin lets it"
            raise Refused(HTTPStatus.FORBIDDEN, why)
        if headers.get_all("Upgrade"):
            return False
        if given != self.token:
            raise Refused(HTTPStatus.NOT_FOUND, "there is one page only")
        return True

    def _knows(self, origin: str, host: str) -> bool:
        return origin in (*self.origins, f"http://{host.lower()}", f"https://{host.lower()}")


def origin_of(text: str) -> str:
    """``--allow-origin``, checked: scheme://host[:port], or what pages and apps on disk send."""
    parts = urlsplit(text)
    whole = f"{parts.scheme}://{parts.netloc}"
    if text in ("null", "file://") or (parts.scheme and parts.netloc and text == whole):
        return text
    raise InvalidValueError(
        f"--allow-origin must be like https://example.org:8080, got {text!r:.80}"
    )


def is_loopback(host: str) -> bool:
    """Whether only this machine can reach it."""
    try:
        return host == "localhost" or ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def new_token(host: str) -> str:
    """What the address must hold where others can reach it, else nothing."""
    return "" if is_loopback(host) else secrets.token_urlsafe(16)


def hidden_host() -> str:
    """A loopback address that no page can guess, where the system has more than one."""
    if not sys.platform.startswith("linux"):
        return "127.0.0.1"
    return f"127.{1 + secrets.randbelow(254)}.{secrets.randbelow(256)}.{1 + secrets.randbelow(254)}"


class Gate:
    """Listens at an address in a thread of its own, before a server at ``behind``.

    page    what is given to a browser;   secret  by which the server behind knows the gate
    admits  which messages of pages are carried;   speaks  the only version of the page let in
    port    where it listens, also where 0 was asked for
    """

    def __init__(  # noqa: PLR0913 (each is another thing that it guards)
        self, address: tuple[str, int], behind: tuple[str, int], page: bytes,
        admits: Callable[[bytes], bool], *, speaks: str,
        origins: Sequence[str] = (), token: str = "", secret: str = "",
    ) -> None:  # fmt: skip
        self._spoken: list[Any] = [speaks]
        self._refused = Seldom("connections were refused")
        self._behind, self._page, self._secret, self._admits = behind, page, secret, admits
        self._loop = asyncio.new_event_loop()
        host, port = address
        try:
            self._server: Any = self._loop.run_until_complete(self._listen(host, port))
        except (OSError, OverflowError, UnicodeError) as error:
            self._loop.close()
            raise InvalidValueError(f"cannot listen at {host}:{port}: {error}") from error
        self.port = int(self._server.sockets[0].getsockname()[1])
        self.rules = Rules(host=host, port=self.port, origins=tuple(origins), token=token)
        self._thread = threading.Thread(target=self._run, name="gate", daemon=True)
        self._thread.start()

    async def _listen(self, host: str, port: int) -> Any:
        quiet = log.getChild("websockets")
        quiet.setLevel(logging.CRITICAL)  # whoever speaks no HTTP is not worth a traceback
        return await importlib.import_module("websockets.asyncio.server").serve(
            self._carry, host, port, process_request=self._let_in, compression=None,
            subprotocols=self._spoken, server_header=None,
            open_timeout=HEAD_S, close_timeout=HEAD_S, max_size=MOST_BYTES, max_queue=2,
            write_limit=CARRIED, logger=quiet,
        )  # fmt: skip

    def _run(self) -> None:
        self._loop.run_forever()
        self._server.close()
        self._loop.run_until_complete(self._server.wait_closed())
        self._loop.close()

    def close(self) -> None:
        """Stop listening, and let go of all clients."""
        if not self._loop.is_closed():
            self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join(HEAD_S)

    def _let_in(self, connection: Any, request: Any) -> Any:
        """The answer to a request; None lets a WebSocket in."""
        try:
            if len(self._server.handlers) > MOST_CLIENTS:
                why = f"{MOST_CLIENTS} clients are here already"
                raise Refused(HTTPStatus.SERVICE_UNAVAILABLE, why)
            if not self.rules.check(request.path, request.headers):
                return None
        except Refused as error:
            self._refused.note(error)
            return connection.respond(error.status, "")
        answer = connection.respond(HTTPStatus.OK, "")
        del answer.headers["Content-Length"], answer.headers["Content-Type"]
        answer.headers["Content-Length"] = str(len(self._page))
        answer.headers["Content-Type"] = "text/html; charset=utf-8"
        answer.body = self._page
        return answer

    async def _carry(self, outer: Any) -> None:
        """Messages in and out until one side ends; a slow side stops the other only."""
        websockets = importlib.import_module("websockets.asyncio.client")
        closed = importlib.import_module("websockets.exceptions").WebSocketException
        with suppress(OSError, closed):
            async with websockets.connect(
                f"ws://{self._behind[0]}:{self._behind[1]}", subprotocols=self._spoken,
                compression=None, additional_headers={SECRET: self._secret}, max_size=None,
                max_queue=1, ping_interval=None, proxy=None,
            ) as inner:  # fmt: skip
                ways = [
                    asyncio.ensure_future(way)
                    for way in (self._pass_on(outer, inner), _pour(inner, outer))
                ]
                try:
                    await asyncio.wait(ways, return_when=asyncio.FIRST_COMPLETED)
                finally:
                    for way in ways:
                        way.cancel()
                    await asyncio.gather(*ways, return_exceptions=True)

    async def _pass_on(self, outer: Any, inner: Any) -> None:
        """Messages of a page; ends at one that no page sends."""
        async for message in outer:
            if not isinstance(message, bytes):
                self._refused.note("a page sent text")
                return
            if self._admits(message):
                await inner.send(message)
            await asyncio.sleep(1.0 / MOST_RATE)


async def _pour(inner: Any, outer: Any) -> None:
    async for message in inner:
        await outer.send(message)


def require() -> Any:
    """``viser``; ``MissingDependencyError`` with a remedy where it is not installed."""
    try:
        return importlib.import_module("viser")
    except ImportError as error:
        raise MissingDependencyError(
            "pages with a scene in 3-D need viser: pip install viser"
        ) from error


# Light or dark as the browser is, and how our words look. viser's panel covers most of a phone:
# there it begins as a strip, whose handle opens half of it. A browser captures a finger for what it
# touches, which viser takes for a drag: no tap would click.
HEAD = Path(__file__).with_name("head.html")
WIDE = 1.2  # of a page before it says: width by height


def page_of(viser: Any) -> bytes:
    """The page that viser's wheel brings: one file, whole without a net."""
    page = (Path(viser.__file__).parent / "client" / "build" / "index.html").read_bytes()
    return page.replace(b"</head>", HEAD.read_bytes() + b"</head>", 1)


class Served:
    """A page at an address.

    scene, gui  of viser: what is shown and what can be set
    controls    of ``gui``, which pages may set
    port        where it listens, also where 0 was asked for;   behind  where viser does
    """

    def __init__(self, address: tuple[str, int], title: str, origins: Sequence[str] = ()) -> None:
        viser = require()
        host = hidden_host()
        with contextlib.redirect_stdout(io.StringIO()):  # it prints where it listens
            self._viser = viser.ViserServer(host, port=0, label=title, verbose=False)
        self.controls = Controls()
        secret = secrets.token_urlsafe(16)
        _only_from_gate(self._viser, secret)
        self.scene, self.gui = self._viser.scene, self._viser.gui
        self.gui.configure_theme(show_logo=False, show_share_button=False, control_width="medium")
        self.gui.main_panel.dock_right()
        self.behind = behind = (host, int(self._viser.get_port()))
        try:
            self._gate = Gate(
                address, behind, page_of(viser), self.controls.admits, origins=origins,
                token=new_token(address[0]), secret=secret, speaks=f"viser-v{viser.__version__}",
            )  # fmt: skip
        except InvalidValueError:
            self._stop()
            raise
        self.port = self._gate.port

    @property
    def token(self) -> str:
        """What the address must hold, where others can reach it; else empty."""
        return self._gate.rules.token

    def look_at(self, bounds: Callable[[], Sequence[float]]) -> None:
        """Let pages that come show that room, as wide as they are until somebody moves them."""
        look_at(self._viser.initial_camera, bounds(), WIDE)

        def fit(client: Any) -> None:
            before, seen = self._viser.initial_camera.position, math.nan

            @client.camera.on_update  # type: ignore[untyped-decorator]
            def _(camera: Any) -> None:
                nonlocal before, seen
                if camera.aspect != seen and np.allclose(camera.position, before, atol=0.01):
                    seen = camera.aspect
                    look_at(camera, bounds(), seen)
                    before = camera.position

        self._viser.on_client_connect(fit)

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

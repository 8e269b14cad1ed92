# SPDX-License-Identifier: Apache-2.0
"""Who may connect and what may be said: viser lets every page in, so a gate stands before it.

A browser sends the ``Origin`` of the page that connects, and no page can forge it. The gate gives
the page itself, reads the handshake of its WebSocket, refuses what is not allowed, and from there
on carries messages: of those that pages send, short ones of the kinds that a view needs. viser
listens behind it at a loopback address and a port that nobody is told.
"""

from __future__ import annotations

import asyncio
import hmac
import importlib
import ipaddress
import logging
import secrets
import sys
import threading
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any
from urllib.parse import urlsplit

from sim.core.checks import MOST_LETTERS
from slam.errors import InvalidValueError

log = logging.getLogger(__name__)

MOST_CLIENTS = 8  # at once
MOST_BYTES = 4096  # of a message of a page; where its camera is takes 300
MOST_RATE = 120.0  # messages a second of one page; more of them wait
MOST_HEAD = 8192  # bytes of a handshake
HEAD_S = 5.0  # s until it is there
PAGE_S = 60.0  # s that a browser may take for the page
CARRIED = 1 << 16  # bytes that are read at a time, and wait in the gate for a client that is slow
KINDS = (
    "ViewerCameraMessage", "GuiUpdateMessage", "GuiButtonHoldMessage", "ScenePointerMessage",
    "CommandTriggerMessage",
)  # fmt: skip
_HEAD_END = b"\r\n\r\n"
_TEXT, _BINARY, _CONTROL = 1, 2, 8  # opcodes of frames; from 8 on: close, ping, pong
SECRET = "X-Mobilia-Gate"  # header of a handshake that went through the gate
_OK = b"HTTP/1.1 200 OK\r\nConnection: close\r\nContent-Type: text/html; charset=utf-8\r\n"


class Refused(Exception):
    """A handshake that is not let through: status line and reason."""

    def __init__(self, status: str, why: str) -> None:
        super().__init__(why)
        self.status = status


@dataclass(frozen=True, kw_only=True)
class Rules:
    """Who is let in.

    host     that the gate listens at, ``port`` too
    origins  of pages beside those that the gate's own address serves
    token    that the address must hold; empty: none
    secret   by which the server behind knows the gate
    """

    host: str
    port: int
    origins: tuple[str, ...] = ()
    token: str = ""
    secret: str = ""

    def names(self) -> frozenset[str]:
        """Hosts that a client may have asked for: a name that leads here by force is none."""
        own = f"[{self.host}]" if ":" in self.host else self.host
        return frozenset(f"{name}:{self.port}" for name in ("localhost", "127.0.0.1", "[::1]", own))

    def check(self, head: bytes) -> bytes:
        """The handshake as it goes on to viser, b"" for the page itself; raises ``Refused``."""
        target, headers = _parsed(head)
        hosts, origins = headers.get("host", []), headers.get("origin", [])
        if len(hosts) != 1 or (not self.token and hosts[0].lower() not in self.names()):
            raise Refused("403 Forbidden", f"the address is not {self.host}:{self.port}")
        if self.token and not self._holds_token(target):
            raise Refused("403 Forbidden", "the token in the address is missing or wrong")
        if origins and (len(origins) > 1 or not self._knows(origins[0], hosts[0])):
            raise Refused(
                "403 Forbidden",
                f"a page of {origins[0]!r:.80} wants in; --allow-origin lets it",
            )
        if "upgrade" not in headers:
            if target.partition("?")[0].strip("/") != self.token:
                raise Refused("404 Not Found", "there is one page only")
            return b""
        if headers["upgrade"] != ["websocket"]:
            raise Refused("426 Upgrade Required", "this is a WebSocket")
        lines = head.removesuffix(_HEAD_END).split(b"\r\n")
        own = f"{SECRET}: {self.secret}".encode()
        return b"\r\n".join([b"GET / HTTP/1.1", *lines[1:], own, b"", b""])

    def _knows(self, origin: str, host: str) -> bool:
        own = (f"http://{host.lower()}", f"https://{host.lower()}")
        return origin in self.origins or origin in own

    def _holds_token(self, target: str) -> bool:
        given = target.partition("?")[0].strip("/")
        return hmac.compare_digest(given.encode(), self.token.encode())


def _parsed(head: bytes) -> tuple[str, dict[str, list[str]]]:
    """Target and headers, names in lower case, each with all its values."""
    try:
        first, *lines = head.removesuffix(_HEAD_END).decode("ascii").split("\r\n")
        method, target, version = first.split(" ")
        headers: dict[str, list[str]] = {}
        for line in lines:
            name, value = line.split(":", 1)
            if name != name.strip() or not name or any(c in line for c in "\r\n\0"):
                raise ValueError(line)
            headers.setdefault(name.lower(), []).append(value.strip(" \t"))
    except ValueError as error:  # UnicodeDecodeError is one
        raise Refused("400 Bad Request", "no handshake of a WebSocket") from error
    if method != "GET" or version != "HTTP/1.1":
        raise Refused("400 Bad Request", "no handshake of a WebSocket")
    return target, headers


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

    page  what is given to a browser
    port  where it listens, also where 0 was asked for
    """

    def __init__(
        self, address: tuple[str, int], behind: tuple[str, int], page: bytes, *,
        origins: Sequence[str] = (), token: str = "", secret: str = "",
    ) -> None:  # fmt: skip
        self._behind, self._page, self._clients = behind, page, 0
        self._loop = asyncio.new_event_loop()
        host, port = address
        opened = asyncio.start_server(self._let_in, host, port, limit=MOST_HEAD)
        try:
            self._server: Any = self._loop.run_until_complete(opened)
        except (OSError, OverflowError, UnicodeError) as error:
            self._loop.close()
            raise InvalidValueError(f"cannot listen at {host}:{port}: {error}") from error
        self.port = int(self._server.sockets[0].getsockname()[1])
        self.rules = Rules(
            host=host, port=self.port, origins=tuple(origins), token=token, secret=secret
        )
        self._thread = threading.Thread(target=self._run, name="gate", daemon=True)
        self._thread.start()

    def _run(self) -> None:
        self._loop.run_forever()
        self._loop.run_until_complete(self._end())
        self._loop.close()

    async def _end(self) -> None:
        self._server.close()
        tasks = asyncio.all_tasks() - {asyncio.current_task()}
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)

    def close(self) -> None:
        """Stop listening, and let go of all clients."""
        if not self._loop.is_closed():
            self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join(HEAD_S)

    async def _let_in(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._clients += 1
        try:
            if self._clients > MOST_CLIENTS:
                raise Refused("503 Service Unavailable", f"{MOST_CLIENTS} clients are here already")
            head = await asyncio.wait_for(reader.readuntil(_HEAD_END), HEAD_S)
            onward = self.rules.check(head)
            if onward:
                await self._carry(reader, writer, onward)
            else:
                writer.write(_OK + b"Content-Length: %d\r\n\r\n" % len(self._page) + self._page)
                await asyncio.wait_for(writer.drain(), PAGE_S)
        except Refused as error:
            log.warning("live view: refused: %s", error)
            text = f"HTTP/1.1 {error.status}\r\nConnection: close\r\nContent-Length: 0\r\n\r\n"
            with suppress(OSError):
                writer.write(text.encode())
                await asyncio.wait_for(writer.drain(), HEAD_S)
        except (OSError, EOFError, TimeoutError, asyncio.LimitOverrunError):
            pass  # it left, or never spoke
        finally:
            self._clients -= 1
            writer.close()

    async def _carry(
        self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter, head: bytes
    ) -> None:
        """Messages in, bytes out until one side ends; a slow side stops the other only."""
        inner_reader, inner_writer = await asyncio.open_connection(*self._behind, limit=CARRIED)
        try:
            inner_writer.write(head)
            ways = [
                asyncio.ensure_future(_pass_on(reader, inner_writer)),
                asyncio.ensure_future(_pour(inner_reader, writer)),
            ]
            try:
                await asyncio.wait(ways, return_when=asyncio.FIRST_COMPLETED)
            finally:
                for way in ways:
                    way.cancel()
                await asyncio.gather(*ways, return_exceptions=True)
        finally:
            inner_writer.close()


async def _pass_on(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    """Messages of a page, one frame each as browsers send them; ends at one that may not be."""
    with suppress(OSError, EOFError):
        while True:
            start = await reader.readexactly(2)
            opcode, size = start[0] & 15, start[1] & 127
            more = await reader.readexactly(2) if size == 126 else b""
            long = size == 127  # its eight bytes of length come next
            size = int.from_bytes(more) if more else size
            whole, masked = start[0] & 0xF0 == 0x80, bool(start[1] & 128)
            if long or not (whole and masked and size <= MOST_BYTES) or opcode in (0, _TEXT):
                log.warning("live view: a page sent what is no message of it, and is let go")
                return
            body = await reader.readexactly(4 + size)
            if opcode >= _CONTROL or may_pass(_unmasked(body)):
                writer.write(start + more + body)
                await writer.drain()
            if opcode < _CONTROL:
                await asyncio.sleep(1.0 / MOST_RATE)


def _unmasked(body: bytes) -> bytes:
    mask, data = body[:4], body[4:]
    return bytes(value ^ mask[k & 3] for k, value in enumerate(data))


def may_pass(message: bytes) -> bool:
    """Whether a page's message is of a kind that a view needs; others are dropped."""
    msgpack = importlib.import_module("msgspec.msgpack")
    try:
        words = msgpack.decode(message)
    except (ValueError, RecursionError):  # msgspec's own errors are ValueErrors
        return False
    if not isinstance(words, dict) or words.get("type") not in KINDS:
        return False
    if words["type"] != "GuiUpdateMessage":
        return True
    updates = words.get("updates")
    return isinstance(updates, dict) and all(
        key == "value" and (isinstance(value, bool | float | int) or _is_word(value))
        for key, value in updates.items()
    )


def _is_word(value: object) -> bool:
    return isinstance(value, str) and len(value) <= MOST_LETTERS and value.isprintable()


async def _pour(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    writer.transport.set_write_buffer_limits(high=CARRIED)
    with suppress(OSError):
        while data := await reader.read(CARRIED):
            writer.write(data)
            await writer.drain()

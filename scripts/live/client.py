# SPDX-License-Identifier: Apache-2.0
"""A client of the Foxglove WebSocket protocol, and as much of protobuf as it takes to read it."""

from __future__ import annotations

import importlib
import json
import struct
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from slam.errors import MissingDependencyError

DEADLINE_S = 120.0  # of a wait; on a busy machine a scan takes its time
TEXT = b"json"


class Client:
    """Notes the newest message of each topic, and everything else that the server says."""

    def __init__(self, socket: Any) -> None:
        self.socket = socket
        self.channels: dict[int, dict[str, Any]] = {}
        self.services: dict[str, int] = {}
        self.newest: dict[str, bytes] = {}
        self.stamps: dict[str, int] = {}
        self.entities: dict[str, dict[int, list[Any]]] = {}
        self.answers: dict[int, Any] = {}
        self.said: list[str] = []
        self.info: dict[str, Any] = {}
        self.events: list[str] = []
        self.states = 0
        self._calls = 0

    @classmethod
    @contextmanager
    def of(cls, url: str) -> Iterator[Client]:
        """Connected to ``ws://HOST:PORT``; raises ``MissingDependencyError``, ``OSError``."""
        try:
            connect = importlib.import_module("websockets.sync.client").connect
        except ImportError as error:
            raise MissingDependencyError(
                "a client of mobilia live needs a WebSocket library: pip install websockets"
            ) from error
        with connect(url, subprotocols=["foxglove.sdk.v1"], max_size=None) as socket:
            yield cls(socket)

    def take(self) -> None:
        """The next message from the server."""
        message = self.socket.recv(timeout=DEADLINE_S)
        if isinstance(message, str):
            self._text(json.loads(message))
        elif message[0] == 1:
            channel, stamp = struct.unpack_from("<IQ", message, 1)
            topic = self.channels[channel]["topic"]
            self.newest[topic], self.stamps[topic] = message[13:], stamp
            if topic == "/world":
                for entity in fields(message[13:]).get(2, []):
                    parts = fields(entity)
                    self.entities[parts[3][0].decode()] = parts
            elif topic == "/events":
                self.events.append(fields(message[13:])[3][0].decode())
        elif message[0] == 3:
            _, call, length = struct.unpack_from("<III", message, 1)
            self.answers[call] = json.loads(message[13 + length :])
        elif message[0] == 5:
            self.states += 1

    def _text(self, words: dict[str, Any]) -> None:
        if words["op"] == "advertise":
            self.channels |= {channel["id"]: channel for channel in words["channels"]}
        elif words["op"] == "advertiseServices":
            self.services |= {service["name"]: service["id"] for service in words["services"]}
        elif words["op"] == "serverInfo":
            self.info = words
        elif words["op"] == "serviceCallFailure":
            self.answers[words["callId"]] = words["message"]
        elif words["op"] == "status":
            self.said.append(words["message"])

    def until(self, true: Callable[[], Any]) -> Any:
        """Take messages until something is true."""
        end = time.monotonic() + DEADLINE_S
        while not true():
            if time.monotonic() > end:
                raise TimeoutError(f"nothing came in {DEADLINE_S:g} s: {self.said}, {self.answers}")
            self.take()
        return true()

    def send(self, **words: Any) -> None:
        """A message of the protocol that is text."""
        self.socket.send(json.dumps(words))

    def subscribe(self, *topics: str) -> None:
        """Ask for what comes on these."""
        self.until(lambda: self.channels and self.services)
        ids = [id for id, channel in self.channels.items() if channel["topic"] in topics]
        self.send(op="subscribe", subscriptions=[{"id": id, "channelId": id} for id in ids])

    def publish(self, channel: int, message: bytes) -> None:
        """On a channel that this client has advertised."""
        self.socket.send(struct.pack("<BI", 1, channel) + message)

    def call(self, service: str, **words: Any) -> Any:
        """The answer of a service: an object, or the words of its failure."""
        self._calls += 1
        call = self._calls
        head = struct.pack("<BIII", 2, self.services[service], call, len(TEXT))
        self.socket.send(head + TEXT + json.dumps(words).encode())
        self.until(lambda: call in self.answers)
        return self.answers[call]

    def playback(self) -> dict[str, Any]:
        """The state of the view, {} before it came."""
        found: dict[str, Any] = json.loads(self.newest.get("/playback", b"{}"))
        return found

    def pose(self, topic: str) -> tuple[float, float]:
        """x, y m of a ``PoseInFrame``."""
        return position(fields(self.newest[topic])[3][0])

    def middle(self, entity: str) -> tuple[float, float]:
        """x, y m of the mean of an entity's cylinders."""
        places = [position(fields(part)[1][0]) for part in self.entities[entity][10]]
        return (
            sum(x for x, _ in places) / len(places),
            sum(y for _, y in places) / len(places),
        )


def position(pose: bytes) -> tuple[float, float]:
    """x, y of a ``Pose``; what is zero is left out."""
    place = fields(fields(pose)[1][0])
    return place.get(1, [0.0])[0], place.get(2, [0.0])[0]


def fields(data: bytes) -> dict[int, list[Any]]:
    """Of a protobuf message, by number: whole numbers, doubles, floats, and bytes undecoded."""
    found: dict[int, list[Any]] = {}
    at = 0
    while at < len(data):
        key, at = _varint(data, at)
        value: Any
        if key & 7 == 0:
            value, at = _varint(data, at)
        elif key & 7 == 1:
            (value,), at = struct.unpack_from("<d", data, at), at + 8
        elif key & 7 == 5:
            (value,), at = struct.unpack_from("<I", data, at), at + 4
        else:
            length, at = _varint(data, at)
            value, at = data[at : at + length], at + length
        found.setdefault(key >> 3, []).append(value)
    return found


def _varint(data: bytes, at: int) -> tuple[int, int]:
    value = shift = 0
    while True:
        byte = data[at]
        value, shift, at = value | (byte & 0x7F) << shift, shift + 7, at + 1
        if byte < 0x80:
            return value, at

# SPDX-License-Identifier: Apache-2.0
"""The WebSocket server: what it offers to clients, and what becomes of what they send.

Its callbacks run in threads of the SDK. They read and check, and hand requests to the inbox; they
touch neither the world nor the playback.
"""

from __future__ import annotations

import json
import logging
import math
from collections.abc import Callable
from typing import Any

from scripts.live import published
from scripts.live.gate import hidden_host
from scripts.live.inbox import Inbox
from scripts.live.playback import Playback
from scripts.live.publisher import Publisher
from scripts.live.requests import MOST_LETTERS, SERVICES, Run, Seek, Service, Speed, Tour, within
from scripts.live.sdk import Sdk
from slam.errors import InvalidValueError, MobiliaError
from slam.frames import NS_PER_S

BACKLOG = 64  # messages that wait for a slow client; the oldest are dropped
MOST_CHANNELS = 256  # that clients advertise to us and that are kept in mind


class Listener:
    """What the SDK calls. ``first_ns``: stamp of the first frame as shown."""

    def __init__(self, sdk: Sdk, inbox: Inbox, first_ns: int) -> None:
        self._sdk, self._inbox, self._first_ns = sdk, inbox, first_ns
        self._channels: dict[tuple[int, int], tuple[str, str]] = {}
        self.publisher: Publisher | None = None
        self.parameters: Callable[[], dict[str, Any]] = dict
        self.state: Callable[[str | None, bool], Any] = lambda _id, _did: None

    # -- listening ----------------------------------------------------------------------------

    def on_subscribe(self, _client: Any, channel: Any) -> None:
        """Somebody new listens."""
        if self.publisher is not None:
            self.publisher.ask(channel.topic)

    def on_unsubscribe(self, _client: Any, _channel: Any) -> None:
        """Nobody has to be told."""

    def on_connection_graph_subscribe(self) -> None:
        """There is none."""

    def on_connection_graph_unsubscribe(self) -> None:
        """There is none."""

    # -- client publish -----------------------------------------------------------------------

    def on_client_advertise(self, client: Any, channel: Any) -> None:
        """A client is going to publish."""
        if len(self._channels) >= MOST_CHANNELS:
            self._inbox.refuse(f"at most {MOST_CHANNELS} client channels are listened to")
            return
        self._channels[client.id, channel.id] = (channel.topic, channel.encoding)
        if channel.topic not in published.TOPICS:
            self._inbox.refuse(
                f"nobody listens on '{channel.topic:.60}', only on {', '.join(published.TOPICS)}"
            )

    def on_client_unadvertise(self, client: Any, client_channel_id: int) -> None:
        """It will not any more."""
        self._channels.pop((client.id, client_channel_id), None)

    def on_message_data(self, client: Any, client_channel_id: int, data: bytes) -> None:
        """A client has published; what is wrong with it is told as a status."""
        try:
            topic, encoding = self._channels.get((client.id, client_channel_id), ("", ""))
            request = published.read(topic, encoding, data)
            self._inbox.put(request).add_done_callback(self._told)
        except MobiliaError as error:
            self._inbox.refuse(error)

    def _told(self, answer: Any) -> None:
        error = answer.exception()
        if error is not None:
            self._inbox.refuse(str(error))

    # -- parameters ---------------------------------------------------------------------------

    def on_get_parameters(
        self, _client: Any, names: list[str], _request_id: str | None = None
    ) -> list[Any]:
        """Those of these names, or all."""
        known = self.parameters()
        wanted = [name for name in names if name in known] if names else list(known)
        return [self._sdk.websocket.Parameter(name, value=known[name]) for name in wanted]

    def on_set_parameters(
        self, client: Any, parameters: list[Any], request_id: str | None = None
    ) -> list[Any]:
        """Set what can be set; the answer has all of them as they are then."""
        for parameter in parameters[:MOST_LETTERS]:
            try:
                self._inbox.ask(_of_parameter(parameter.name, parameter.get_value()))
            except (MobiliaError, OverflowError) as error:
                self._inbox.refuse(str(error))
        return self.on_get_parameters(client, [], request_id)

    def on_parameters_subscribe(self, _names: list[str]) -> None:
        """They are told whenever they change."""

    def on_parameters_unsubscribe(self, _names: list[str]) -> None:
        """Nothing was kept for it."""

    # -- the time line of the app -------------------------------------------------------------

    def on_playback_control_request(self, request: Any) -> Any:
        """Play, pause, speed and seek, as the time line asks; the state then."""
        playing = request.playback_command == self._sdk.websocket.PlaybackCommand.Play
        asked: list[Any] = [Run(playing=playing)]
        if math.isfinite(request.playback_speed) and request.playback_speed > 0.0:
            asked.insert(0, Speed(factor=float(request.playback_speed)))
        seeks = request.seek_time is not None
        if seeks:
            seconds = (request.seek_time - self._first_ns) / NS_PER_S
            asked.insert(0, Seek(time_s=seconds, nearest=True))
        if not playing:  # else it would play on from there until the pause is done
            asked.reverse()
        for one in asked:
            try:
                self._inbox.ask(one)
            except MobiliaError as error:
                self._inbox.refuse(error)
        return self.state(str(request.request_id)[:MOST_LETTERS], seeks)


def _of_parameter(name: str, value: Any) -> Any:
    if name == "speed":
        return Speed(factor=within("speed", value, -math.inf, math.inf))
    if name == "playing" and isinstance(value, bool):
        return Run(playing=value)
    if name == "driver" and value == "tour":
        return Tour()
    raise InvalidValueError(
        f"parameters that can be set are speed (a number), playing (true or false) and driver "
        f"('tour'), got {name!r:.40} = {value!r:.40}"
    )


def services(sdk: Sdk, inbox: Inbox) -> list[Any]:
    """All of ``SERVICES``, as the SDK takes them."""
    answer = json.dumps(
        {"title": "mobilia.Answer", "type": "object", "properties": {"done": {"type": "string"}}}
    ).encode()
    return [_service(sdk, inbox, name, service, answer) for name, service in SERVICES.items()]


def _service(sdk: Sdk, inbox: Inbox, name: str, service: Service, answer: bytes) -> Any:
    ws = sdk.websocket

    def handle(request: Any) -> bytes:
        if request.encoding != "json":
            raise InvalidValueError(f"{name}: requests must be JSON, got '{request.encoding:.20}'")
        done = inbox.ask(service.read(name, bytes(request.payload)))
        return json.dumps({"done": done}).encode()

    def message(title: str, schema: bytes) -> Any:
        return ws.MessageSchema(encoding="json", schema=sdk.schema(title, schema))

    return ws.Service(
        f"/{name}",
        schema=ws.ServiceSchema(
            f"mobilia.{name}",
            request=message(f"mobilia.{name}.Request", service.schema(name)),
            response=message("mobilia.Answer", answer),
        ),
        handler=handle,
    )


def start(
    sdk: Sdk,
    publisher: Publisher,
    listener: Listener,
    inbox: Inbox,
    shown_ns: tuple[int, int],
) -> tuple[Any, tuple[str, int]]:
    """The running server and where it listens: behind a gate (``gate``), at a hidden address.

    shown_ns  first and last stamp of the time line
    """
    host = hidden_host()
    capabilities = sdk.websocket.Capability
    sdk.foxglove.set_log_level(logging.ERROR)
    listener.publisher = publisher
    try:
        running = sdk.foxglove.start_server(
            name="mobilia", host=host, port=0, message_backlog_size=BACKLOG,
            context=publisher.context,
            server_listener=listener, services=services(sdk, inbox),
            supported_encodings=["json"], playback_time_range=shown_ns,
            capabilities=[
                capabilities.ClientPublish, capabilities.Parameters, capabilities.Services,
                capabilities.Time, capabilities.PlaybackControl,
            ],
        )  # fmt: skip
    except (RuntimeError, OSError, ValueError, OverflowError) as error:
        raise InvalidValueError(f"cannot listen at {host}: {error}") from error
    return running, (host, int(running.port))


def playback_state(
    sdk: Sdk, playback: Playback, first_ns: int, request_id: str | None, did_seek: bool
) -> Any:
    """How the view stands, for the time line of the app."""
    ws, shown = sdk.websocket, playback.shown
    status = ws.PlaybackStatus.Playing if playback.playing else ws.PlaybackStatus.Paused
    if playback.ended and not playback.looks_back:
        status = ws.PlaybackStatus.Ended
    return ws.PlaybackState(
        status=status, current_time=first_ns if shown is None else shown.stamp_ns,
        playback_speed=playback.speed, did_seek=did_seek, request_id=request_id,
    )  # fmt: skip

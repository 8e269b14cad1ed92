# SPDX-License-Identifier: Apache-2.0
"""The loop of a live view: takes requests, makes moments at their pace and sends them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from scripts import interrupt
from scripts.live import server
from scripts.live.gate import Gate, new_token
from scripts.live.inbox import MOST_WAITING, Inbox
from scripts.live.pace import Pace
from scripts.live.playback import Playback
from scripts.live.publisher import Publisher
from scripts.live.requests import Drive, OnView, OnWorld, Seek
from scripts.live.sdk import Sdk
from scripts.live.session import Said, Session, Shown
from slam.errors import InvalidValueError, MobiliaError

IDLE_S = 0.05  # between two looks at the inbox while nothing moves
REFUSED = "mobilia-refused"  # id of the status: a new one takes the place of the one before


class View:
    """A session served at an address; everything but the SDK's callbacks runs in one thread.

    session  what is served
    port     where it listens, also where 0 was asked for
    """

    def __init__(
        self, sdk: Sdk, session: Session, playback: Playback,
        address: tuple[str, int], shown_ns: tuple[int, int], origins: Sequence[str] = (),
    ) -> None:  # fmt: skip
        self._sdk, self.session, self._playback = sdk, session, playback
        self._inbox, self._pace = Inbox(), Pace()
        self._publisher = Publisher(sdk, session)
        listener = server.Listener(sdk, self._inbox, shown_ns[0])
        listener.parameters = self._parameters
        listener.state = self._state
        self._first_ns = shown_ns[0]
        self._server, behind = server.start(sdk, self._publisher, listener, self._inbox, shown_ns)
        token = new_token(address[0])
        try:
            self._gate = Gate(address, behind, origins=origins, token=token)
        except InvalidValueError:
            self._server.stop()
            raise
        session.speed = playback.speed
        self._due: Shown | None = None
        self._told_end = False

    @property
    def port(self) -> int:
        """As above."""
        return self._gate.port

    @property
    def token(self) -> str:
        """What the address must hold, where others can reach it; else empty."""
        return self._gate.rules.token

    def close(self) -> None:
        """Stop listening."""
        self._gate.close()
        self._server.stop()

    def turn(self) -> None:
        """Once round: what clients ask for, then the next moment when it is due."""
        interrupt.check()
        playback = self._playback
        for _ in range(MOST_WAITING):  # all that wait, lest twists grow old where scans are slow
            if not self._wait(0.0):
                break
        self._tell_refused()
        if self._due is None and not playback.resting:
            self._due = playback.advance()
        self._tell_end()
        if self._due is None:
            self._wait(IDLE_S)
            if self._publisher.asked and playback.shown is not None:
                self._send(playback.shown)
            return
        shown = self._due
        if self._wait(self._wait_s(shown)) and (self._due is None or self._wait_s(shown) > 0.0):
            return  # it may have been done away with; a stream of requests does not hold it up
        self._due = None
        if self._pace.to_send() or not playback.playing or self._publisher.asked or shown.said:
            self._send(shown)

    def _wait_s(self, due: Shown) -> float:
        playback = self._playback
        return self._pace.wait_s(due.seconds, playback.speed) if playback.playing else 0.0

    def _wait(self, seconds: float) -> bool:
        """Do a request that is there, or comes meanwhile; whether there was one."""
        asked = self._inbox.get(seconds)
        if asked is None:
            return False
        try:
            request = asked.request
            done = self._on_view(request) if isinstance(request, OnView) else self._touch(request)
        except MobiliaError as error:
            asked.answer.set_exception(error)
        else:
            asked.answer.set_result(done)
        return True

    def _on_view(self, request: OnView) -> str:
        playback, seeks = self._playback, isinstance(request, Seek)
        done = playback.do(request)
        self.session.speed = playback.speed
        self._pace.restart()
        if seeks:
            self._due = None
            if playback.shown is not None:
                self._send(playback.shown)
        self._server.broadcast_playback_state(self._state(None, seeks))
        self._tell_parameters()
        return done

    def _touch(self, request: OnWorld) -> str:
        """Do something to the world, which stands between two scans."""
        room, playback = self.session.room, self._playback
        if room is None:
            raise InvalidValueError("this is a log: nothing in it can be moved")
        if playback.ended:
            raise InvalidValueError("the run has ended: nothing moves any more")
        if playback.looks_back:
            raise InvalidValueError("an earlier moment is shown: seek to the present first")
        drove = room.hands.client_drives
        done = room.hands.do(request)
        if room.hands.client_drives != drove:
            self._tell_parameters()
        if room.hands.client_drives != drove or not isinstance(request, Drive):
            self.session.pending.append(Said(text=f"client: {done}"))
        return done

    def _state(self, request_id: str | None, did_seek: bool) -> Any:
        sdk, playback = self._sdk, self._playback
        return server.playback_state(sdk, playback, self._first_ns, request_id, did_seek)

    def _send(self, shown: Shown) -> None:
        self._server.broadcast_time(shown.stamp_ns)
        self._publisher.send(shown, self._playback)

    def _parameters(self) -> dict[str, Any]:
        room = self.session.room
        found: dict[str, Any] = {"speed": self._playback.speed, "playing": self._playback.playing}
        if room is not None:
            found["driver"] = "client" if room.hands.client_drives else "tour"
        return found

    def _tell_parameters(self) -> None:
        make = self._sdk.websocket.Parameter
        values = [make(name, value=value) for name, value in self._parameters().items()]
        self._server.publish_parameter_values(values)

    def _tell_refused(self) -> None:
        said = self._inbox.refused()
        if said is not None:
            levels = self._sdk.websocket.StatusLevel
            self._server.publish_status(said, levels.Warning, REFUSED)

    def _tell_end(self) -> None:
        playback = self._playback
        if not playback.ended or self._told_end:
            return
        self._told_end = True
        levels = self._sdk.websocket.StatusLevel
        why = playback.why or "the run has ended; its last minute can be looked at"
        level = levels.Error if playback.why else levels.Info
        self._server.publish_status(why[:300], level, "mobilia-end")
        self._server.broadcast_playback_state(self._state(None, False))

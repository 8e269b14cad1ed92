# SPDX-License-Identifier: Apache-2.0
"""Requests on their way from the server's threads to the one that owns the world."""

from __future__ import annotations

import queue
from concurrent.futures import Future
from concurrent.futures import TimeoutError as NotYet
from dataclasses import dataclass, field

from scripts.live.requests import Request
from slam.errors import InvalidValueError, MobiliaError

MOST_WAITING = 64  # requests; a client that sends more is told so
ANSWER_S = 5.0  # that a caller waits; a scan takes a few milliseconds, compiling half a minute


@dataclass(frozen=True, eq=False)
class Asked:
    """A request and where its answer goes."""

    request: Request
    answer: Future[str] = field(default_factory=Future)


class Inbox:
    """A queue of limited length. ``refused`` keeps the last thing that was wrong, for a status."""

    def __init__(self) -> None:
        self._queue: queue.Queue[Asked] = queue.Queue(MOST_WAITING)
        self._refused: str | None = None

    def put(self, request: Request) -> Future[str]:
        """Hand a request over; ``InvalidValueError`` where too many wait. From any thread."""
        asked = Asked(request)
        try:
            self._queue.put_nowait(asked)
        except queue.Full:
            raise InvalidValueError(
                f"{MOST_WAITING} requests wait already: this one is dropped"
            ) from None
        return asked.answer

    def ask(self, request: Request) -> str:
        """Hand it over and wait for the answer; raises what the request led to."""
        answer = self.put(request)
        try:
            return answer.result(timeout=ANSWER_S)
        except NotYet:
            return "accepted: it is done after the present scan"

    def refuse(self, why: MobiliaError | str) -> None:
        """Keep this to be told to the clients, in place of what was kept before."""
        self._refused = str(why)[:300]

    def refused(self) -> str | None:
        """What is to be told, once."""
        said, self._refused = self._refused, None
        return said

    def get(self, timeout_s: float) -> Asked | None:
        """The next request, None where none comes in that time."""
        try:
            return self._queue.get(timeout_s > 0.0, max(timeout_s, 0.0))
        except queue.Empty:
            return None

# SPDX-License-Identifier: Apache-2.0
"""Requests on their way from the server's threads to the one that owns the world."""

from __future__ import annotations

import queue

from scripts.live.requests import Request
from slam.errors import InvalidValueError, MobiliaError

MOST_WAITING = 64  # requests; a client that sends more is told so


class Inbox:
    """A queue of limited length. ``refused`` keeps the last thing that was wrong, to be told."""

    def __init__(self) -> None:
        self._queue: queue.Queue[Request] = queue.Queue(MOST_WAITING)
        self._refused: str | None = None

    def put(self, request: Request) -> None:
        """Hand a request over; ``InvalidValueError`` where too many wait. From any thread."""
        try:
            self._queue.put_nowait(request)
        except queue.Full:
            raise InvalidValueError(
                f"{MOST_WAITING} requests wait already: this one is dropped"
            ) from None

    def refuse(self, why: MobiliaError) -> None:
        """Keep this to be told to the clients, in place of what was kept before."""
        self._refused = str(why)[:300]

    def refused(self) -> str | None:
        """What is to be told, once."""
        said, self._refused = self._refused, None
        return said

    def get(self, timeout_s: float) -> Request | None:
        """The next request, None where none comes in that time."""
        try:
            return self._queue.get(timeout_s > 0.0, max(timeout_s, 0.0))
        except queue.Empty:
            return None

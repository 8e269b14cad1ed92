# SPDX-License-Identifier: Apache-2.0
"""Work that pauses, so that no scan takes long."""

from collections.abc import Callable, Iterator
from typing import Any


class Pausing:
    """A task that yields where it may pause, and notes what it found at its end only.

    A generator cannot be copied: a copy, or a pickled one, begins the task anew. It finds the same,
    some scans later.
    """

    def __init__(self, task: Callable[[], Iterator[None]]) -> None:
        self._task = task
        self._running: Iterator[None] | None = None

    def go_on(self) -> bool:
        """Up to the next pause; whether there was one, and the task is not done."""
        self._running = self._running or self._task()
        return next(self._running, "ended") is None

    def __getstate__(self) -> dict[str, Any]:
        return {"_task": self._task, "_running": None}

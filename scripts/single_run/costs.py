# SPDX-License-Identifier: Apache-2.0
"""What a run costs: processor time of the SLAM and of the pictures, and memory."""

from __future__ import annotations

import resource
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from rich.markup import escape

from scripts.console import console
from slam.replay import Replay

_UNIT = 1 if sys.platform == "darwin" else 1024  # of ru_maxrss, bytes


class Costs:
    """Processor seconds since it was made, of this process and of ffmpeg."""

    def __init__(self) -> None:
        self._start_s = _spent_s()
        self._at_end_s = 0.0

    @contextmanager
    def slam(self) -> Iterator[None]:
        """What happens in here is the SLAM's: closing loops at the end."""
        start_s = time.process_time()
        try:
            yield
        finally:
            self._at_end_s += time.process_time() - start_s

    def block(self, replay: Replay) -> dict[str, Any]:
        """For ``results.json``: s, s and MB."""
        updates_s = sum(sum(track.durations_s) for track in replay.tracks.values())
        slam_s = updates_s + self._at_end_s
        most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * _UNIT
        return {
            "slam_s": round(slam_s, 1),
            "pictures_s": round(max(_spent_s() - self._start_s - slam_s, 0.0), 1),
            "memory_mb": round(most / 1e6),
        }


def say(block: dict[str, Any]) -> None:
    """One line."""
    words = (
        f"Processor time: {block['slam_s']:.0f} s of SLAM, {block['pictures_s']:.0f} s of film and "
        f"pictures; memory at most {block['memory_mb']} MB."
    )
    console.print(escape(words), highlight=False, soft_wrap=True)


def _spent_s() -> float:
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.process_time() + children.ru_utime + children.ru_stime

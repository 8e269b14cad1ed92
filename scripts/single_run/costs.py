# SPDX-License-Identifier: Apache-2.0
"""What a run costs, stage by stage: processor time and memory."""

from __future__ import annotations

import math
import resource
import sys
import time
from collections import defaultdict
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import replace
from typing import Any

from scripts.comparison.memory import forget_peak, reading_kb
from slam.frames import Frame, Stream
from slam.replay import Replay

_UNIT = 1 if sys.platform == "darwin" else 1024  # of ru_maxrss, bytes
# What a run consists of: the log read or the room simulated, the SLAMs, files of the map, pictures,
# film, and what else happens at a scan.
INPUT, SLAM, MAP, PICTURES, FILM, REST = "input", "slam", "map", "pictures", "film", "rest"
_SCANS = "scans"  # updates of the SLAM, and what else happens at a scan
STAGES = (INPUT, SLAM, MAP, PICTURES, FILM, REST)


class Costs:
    """Processor seconds of the stages that are marked, and the most memory in each.

    Film is drawn, and input read, between two updates of the SLAM; each second counts once.
    """

    def __init__(self) -> None:
        self._spent_s: defaultdict[str, float] = defaultdict(float)
        self._most: defaultdict[str, int] = defaultdict(int)
        self._open = [REST]
        self._since_s = time.process_time()
        _peak()

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """What happens in here is of that stage, but for other stages within."""
        self._lap()
        self._open.append(name)
        try:
            yield
        finally:
            self._lap()
            self._open.pop()

    def scans(self) -> AbstractContextManager[None]:
        """The replay: updates are the SLAM's, input and film are marked within."""
        return self.stage(_SCANS)

    @contextmanager
    def beside(self, name: str) -> Iterator[None]:
        """Processes that begin and end in here, ffmpeg, are of that stage."""
        before_s = _children_s()
        try:
            yield
        finally:
            spent_s = _children_s() - before_s
            if spent_s > 0.0:  # a stage that there was not is none of 0 s
                self._spent_s[name] += spent_s

    def reading(self, stream: Stream) -> Stream:
        """``stream``, its frames made at the cost of ``INPUT``."""

        def frames() -> Iterator[Frame]:
            source = iter(stream)
            while True:
                start_s = time.process_time()
                frame = next(source, None)
                self._moved(time.process_time() - start_s, INPUT)
                if frame is None:
                    return
                yield frame

        return replace(stream, frames=frames)

    def block(self, replay: Replay) -> dict[str, Any]:
        """For ``results.json``: s and MB, of all and of each stage.

        Where frames are made between scans, as in simulation, both have the same memory.
        """
        self._lap()
        spent_s = (s for track in replay.tracks.values() for s in track.durations_s)
        updates_s = sum(s for s in spent_s if math.isfinite(s))
        most = {**self._most, SLAM: max(self._most[SLAM], self._most[_SCANS])}
        spent = {**self._spent_s, SLAM: self._spent_s[SLAM] + updates_s}
        spent[REST] += max(spent.pop(_SCANS, 0.0) - updates_s, 0.0)
        pictures_s = sum(spent.get(name, 0.0) for name in (MAP, PICTURES, FILM, REST))
        return {
            "slam_s": round(spent[SLAM], 1),
            "pictures_s": round(pictures_s, 1),
            "input_s": round(spent.get(INPUT, 0.0), 1),
            "memory_mb": round(max(most.values()) / 1e6),
            "stages": {
                name: {
                    "s": round(spent[name], 2),
                    "memory_mb": round(most.get(name, most[SLAM]) / 1e6),
                }
                for name in STAGES
                if name in spent
            },
        }

    def _lap(self) -> None:
        """What was used since the last lap is the open stage's."""
        now_s, name = time.process_time(), self._open[-1]
        self._spent_s[name] += now_s - self._since_s
        self._since_s = now_s
        self._most[name] = max(self._most[name], _peak())

    def _moved(self, seconds: float, name: str) -> None:
        """Count these of the open stage's as another's."""
        self._spent_s[self._open[-1]] -= seconds
        self._spent_s[name] += seconds


def in_words(block: dict[str, Any]) -> str:
    """One line."""
    return (
        f"Processor time: {block['slam_s']:.0f} s of SLAM, {block['pictures_s']:.0f} s of film and "
        f"pictures; memory at most {block['memory_mb']} MB."
    )


def _peak() -> int:
    """The most memory since it was asked last, bytes; where no kernel says so, since the start."""
    most_kb = reading_kb("VmHWM")
    if forget_peak() and not math.isnan(most_kb):
        return int(most_kb) * 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * _UNIT


def _children_s() -> float:
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return children.ru_utime + children.ru_stime

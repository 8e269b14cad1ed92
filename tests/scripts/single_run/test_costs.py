# SPDX-License-Identifier: Apache-2.0
"""Each second of a run is counted once, as that of the stage it was spent in."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from scripts.single_run import costs
from scripts.single_run.costs import FILM, INPUT, MAP, REST, SLAM, Costs
from slam.frames import Frame, Odometry, Stream, StreamMetadata


class Clock:
    """Time and memory that pass when told."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.s, self.most = 0.0, 0
        monkeypatch.setattr(costs.time, "process_time", lambda: self.s)
        monkeypatch.setattr(costs, "_peak", self._peak)

    def spend(self, seconds: float, megabytes: int = 0) -> None:
        self.s += seconds
        self.most = max(self.most, megabytes * 1_000_000)

    def _peak(self) -> int:
        most, self.most = self.most, 0
        return most


def test_what_happens_within_a_scan_is_told_apart(monkeypatch):
    clock = Clock(monkeypatch)

    def frames():
        for k in range(3):
            clock.spend(0.5, 60)
            odometry = Odometry(stamp_ns=k, T_odom_robot=np.zeros(3))
            yield Frame(stamp_ns=k, odometry=odometry)

    stream = Stream(metadata=StreamMetadata(source="made"), frames=frames, length=3)
    track = SimpleNamespace(durations_s=[])
    counted = Costs()
    with counted.stage(INPUT):
        clock.spend(2.0, 300)
    with counted.scans():
        for _ in counted.reading(stream):
            clock.spend(4.0, 500)
            track.durations_s.append(4.0)
            with counted.stage(FILM):
                clock.spend(1.0, 200)
            clock.spend(0.25)
    with counted.stage(SLAM):
        clock.spend(8.0, 100)
    with counted.stage(MAP):
        clock.spend(3.0, 700)
    block = counted.block(SimpleNamespace(tracks={"made": track}))
    seconds = {name: stage["s"] for name, stage in block["stages"].items()}
    assert seconds == {INPUT: 3.5, SLAM: 20.0, MAP: 3.0, FILM: 3.0, REST: 0.75}
    assert sum(seconds.values()) == clock.s
    assert block["pictures_s"] == pytest.approx(6.75, abs=0.051)
    assert (block["slam_s"], block["input_s"], block["memory_mb"]) == (20.0, 3.5, 700)
    memory = {name: stage["memory_mb"] for name, stage in block["stages"].items()}
    assert memory == {INPUT: 300, SLAM: 500, MAP: 700, FILM: 200, REST: 0}

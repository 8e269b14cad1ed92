# SPDX-License-Identifier: Apache-2.0
"""Programs of MRPT over files: what they are given, when they run, and how they fail.

A script stands in for the program, so that this needs none: it logs poses as MRPT does.
"""

import math
from pathlib import Path

import numpy as np
import pytest

from slam import create
from slam.errors import SlamFailedError
from slam.frames import Frame
from slam.guests import wire
from slam.guests.guest import ranges_of
from slam.oracle import Oracle
from slam.replay import Track
from tests.world2d import World2D, arena, frames, laser, wander

# It logs what it reads: how many scans the rawlog holds, each a decimetre farther.
STAND_IN = """#!/bin/sh
log=$(sed -n 's/^logOutput_dir = //p' "$1")
mkdir -p "$log"
scans=$(grep -ao 'CSensoryFrame' "$2" | wc -l)
k=0
while [ $k -lt $scans ]; do
  echo "$k $(($k + 5)).5 2.0 0.0" >> "$log/log_estimated_path.txt"
  echo "$(($k + 1)).0 7" >> "$log/log_times.txt"
  echo "$k $((1000 + $k * 10))" >> "$log/log_MemoryUsage.txt"
  k=$(($k + 1))
done
"""


@pytest.fixture(scope="module")
def stream() -> list[Frame]:
    return frames(World2D(arena()), wander(2.0), rate_hz=5.0, spec=laser(91), seed=4)


def stand_in(monkeypatch: pytest.MonkeyPatch, folder: Path, script: str) -> None:
    path = folder / "icp-slam"
    path.write_text(script)
    path.chmod(0o755)
    monkeypatch.setenv("PATH", str(folder), prepend=":")


def test_the_online_poses_are_those_that_the_program_logged(monkeypatch, tmp_path, stream):
    stand_in(monkeypatch, tmp_path, STAND_IN)
    track, wheels = Track("icp-slam", create("icp-slam")), Track("odometry", create("odometry"))
    for frame in stream:
        np.testing.assert_allclose(
            track.take(frame.without_truth()).T_map_robot,
            wheels.take(frame.without_truth()).T_map_robot,
            atol=1e-9,
        )
    before = sum(track.durations_s)
    online = track.online().poses
    steps = np.arange(len(stream), dtype=float)
    np.testing.assert_allclose(online, np.stack([steps, 0 * steps, 0 * steps], axis=1), atol=1e-9)
    np.testing.assert_array_equal([e.T_map_robot for e in track.estimates], online)
    assert track.final() is None
    assert sum(track.durations_s) > before
    assert len(track.durations_s) == len(stream)
    assert track.system.memory_growth_bytes() == 10 * (len(stream) - 1)  # type: ignore[attr-defined]


def test_an_oracle_over_a_program_runs_it_too(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    stand_in(monkeypatch, tmp_path, STAND_IN)
    assert hasattr(Oracle(create("icp-slam")), "estimates_at_end")


@pytest.mark.parametrize(
    ("script", "outcome", "words"),
    [
        ("#!/bin/sh\necho 'no such map' >&2\nexit 3\n", "raised", "status 3.*no such map"),
        ("#!/bin/sh\nexit 0\n", "bad", "no log_estimated_path.txt"),
        (STAND_IN.replace("[ $k -lt $scans ]", "[ $k -lt 2 ]"), "bad", "2 rows"),
        (STAND_IN.replace(" 2.0 ", " nan "), "nan", "not finite"),
        (STAND_IN.replace("$((1000 + $k * 10))", "nan"), "bad", "a time or memory that is not"),
    ],
)
def test_a_program_that_fails_has_lost_the_run(
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    stream: list[Frame],
    script: str,
    outcome: str,
    words: str,
) -> None:
    stand_in(monkeypatch, tmp_path, script)
    track = Track("icp-slam", create("icp-slam"))
    for frame in stream:
        track.take(frame.without_truth())
    with pytest.raises(SlamFailedError, match=words) as caught:
        track.online()
    assert caught.value.outcome == outcome
    assert len(track.online()) == 0  # odometry's poses are not its own; it does not run again
    assert track.durations_s == []
    assert track.survive([]) is None


def test_a_program_that_hangs_is_ended() -> None:
    with pytest.raises(SlamFailedError, match="hung") as caught:
        wire.run(["sleep", "60"], 0.3)
    assert caught.value.outcome == "hung"
    with pytest.raises(SlamFailedError, match="cannot start"):
        wire.run(["/nonexistent/program"], 1.0)


def test_end_points_become_the_ranges_of_their_beams() -> None:
    spec = laser(181)
    angles = spec.angles[[10, 90, 170]]
    points = np.stack([2.0 * np.cos(angles) + 0.1, 2.0 * np.sin(angles)], axis=1)
    ranges = ranges_of(points, spec, math.inf)
    np.testing.assert_allclose(ranges[[10, 90, 170]], 2.0, atol=1e-12)
    assert np.isfinite(ranges).sum() == 3

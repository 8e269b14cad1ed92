# SPDX-License-Identifier: Apache-2.0
"""Several scanners of one bag as one stream."""

import math
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from slam import se2
from slam.errors import InvalidValueError
from slam.frames import Frame, Stream, StreamMetadata
from slam.logs import read_bag
from slam.logs.together import together
from tests.slam.logs.two_scanners import MOUNTS, WAY, bag
from tests.world2d import World2D, arena, frames, laser

MS = 1_000_000


def read(path: Path) -> list[Frame]:
    return list(together([read_bag(path, scan=topic) for topic in ("/front", "/rear")]))


@pytest.mark.parametrize("apart_s", [0.05, 0.0])
@pytest.mark.parametrize("late_ns", [0, 333 * MS])
def test_frames_come_in_the_order_of_their_stamps_however_they_were_logged(
    tmp_path: Path, apart_s: float, late_ns: int
) -> None:
    path = bag(tmp_path / "two", apart_s=apart_s, late_ns=late_ns)
    merged, front = read(path), list(read_bag(path, scan="/front"))
    stamps = [frame.stamp_ns for frame in merged]
    assert stamps == sorted(set(stamps))
    own = [frame for frame in merged if frame.scan.spec.mount == MOUNTS["front"]]
    assert own[0] == merged[0] == front[0]
    assert len(merged) == 2 * len(own) == 2 * len(front)
    assert [frame.scan.ranges.tolist() for frame in own] == [f.scan.ranges.tolist() for f in front]
    if apart_s == 0.0:
        assert np.diff(stamps).tolist()[::2] == [1] * len(front)
    for before, frame in pairwise(merged):
        assert frame.scan.stamp_ns == frame.odometry.stamp_ns == frame.stamp_ns
        step = se2.between(before.odometry.T_odom_robot, frame.odometry.T_odom_robot)
        assert math.hypot(step[0], step[1]) < 0.1


def of(part: list[Frame], x: float, *, odometry: bool = True) -> Stream:
    spec = replace(laser(9), T_robot_laser=np.array([x, 0.0, 0.0]))
    out = [replace(f, scan=replace(f.scan, spec=spec)) for f in part]
    return Stream(
        metadata=StreamMetadata(
            source="test", laser=spec, mounting="known", odometry=odometry
        ),
        frames=lambda: out, length=len(out),
    )  # fmt: skip


def test_a_covariance_of_odometry_is_that_of_the_step_between_frames() -> None:
    made = frames(World2D(arena()), WAY, rate_hz=5.0, spec=laser(9), seed=1)

    known = np.diag([4e-4, 4e-4, 1e-4])
    steady = [replace(f, odometry=replace(f.odometry, increment_covariance=known)) for f in made]
    both = together([of(steady[::2], 0.0), of(steady[1::2], 0.3)])
    merged = list(both)
    assert both.length == len(merged) == len(made)
    for frame in merged[2:]:  # each had that of two steps
        np.testing.assert_allclose(frame.odometry.increment_covariance, known / 2.0)


def test_odometry_that_one_of_them_has_not_is_none() -> None:
    """A reader finds that it stands still by the scans of one: the two may not be mixed."""
    made = frames(World2D(arena()), WAY, rate_hz=5.0, spec=laser(9), seed=1)
    both = together([of(made[::2], 0.0), of(made[1::2], 0.3, odometry=False)])
    assert not both.metadata.odometry
    assert not any(frame.odometry.T_odom_robot.any() for frame in list(both)[1:])


def test_one_scanner_that_is_named_twice_is_refused(tmp_path: Path) -> None:
    path = bag(tmp_path / "two")
    with pytest.raises(InvalidValueError, match="the scans of /front are named twice"):
        together([read_bag(path, scan="/front")] * 2)

# SPDX-License-Identifier: Apache-2.0
"""Bags of ROS 1 and 2."""

from collections.abc import Sequence
from pathlib import Path

import tests.slam.logs.foreign_bags as bags
from slam.frames import Frame
from tests.scripts.kinds.kind import Kind, read_log

N, STEP_NS = 40, 100_000_000


def _no_odometry(folder: Path) -> Path:
    make = bags.Maker()
    scans = [make.scan(bags.START_NS + STEP_NS * k, [2.0 + 0.01 * k] * 9) for k in range(N)]
    return bags.write_ros2(folder / "a", scans)


def _all_there(frames: Sequence[Frame]) -> None:
    assert [len(frame.scan.ranges) for frame in frames] == [9] * N


KINDS = [
    Kind(
        name="no odometry",
        done="each SLAM gets that of its own last motion (constant velocity), with a covariance "
        "that says how little that is",
        said="no odometry: … scans with that of a constant velocity",
        write=_no_odometry, check=_all_there, read=read_log, strict=True,
    ),
]  # fmt: skip

# SPDX-License-Identifier: Apache-2.0
"""What stands: a wall that every scan hits; what is looked through later does not."""

import math

import numpy as np
import pytest

from slam.errors import InvalidValueError
from slam.evaluation.evidence import beside, evidence_of
from slam.frames import Frame, LaserSpec, Scan
from tests.world2d import frame_at

SPEC = LaserSpec(n_beams=91, angle_min=-math.pi / 4, angle_increment=math.pi / 180)
POSES = np.array([[0.1 * k, 0.05 * k, 0.02 * k] for k in range(12)])


def _scans(*, chair: tuple[int, ...] = ()) -> list[Scan]:
    """A wall at x = 4 m; in some scans a thing at x = 2 m, |y| < 0.2 m."""
    scans = []
    for k, (x, y, yaw) in enumerate(POSES.tolist()):
        heading = yaw + SPEC.angles
        ranges = (4.0 - x) / np.cos(heading)
        near = (2.0 - x) / np.cos(heading)
        thing = np.abs(y + near * np.sin(heading)) < 0.2
        seen = np.where(thing & (k in chair), near, ranges).astype(np.float32)
        scans.append(Scan(stamp_ns=k + 1, ranges=seen, spec=SPEC))
    return scans


def test_a_wall_stands_and_a_thing_that_left_does_not() -> None:
    found = evidence_of(_scans(chair=(0,)), POSES, 0.2)
    wall, thing = np.array([[4.0, 0.0], [4.0, 1.0]]), np.array([[2.0, 0.0]])
    assert found.stands(wall).all()
    assert not found.stands(thing).any()
    raster = found.raster()
    column = math.floor((4.0 - found.low[0]) / 0.2)
    row = math.floor((0.5 - found.low[1]) / 0.2)
    assert raster.values[row, column] == 1.0
    assert raster.values[row, column - 5] == 0.0


def test_scans_beside_scans_that_are_nearer() -> None:
    def frames(scans: list[Scan]) -> list[Frame]:
        return [frame_at(s.stamp_ns, scan=s) for s in scans]

    words = beside(frames(_scans()), frames(_scans(chair=(0, 1, 2))), POSES).words()
    assert words["stands"]["median_m"] == 0.0
    assert words["stands"]["beams"] == 12 * 91
    assert words["stands"]["within_5_cm"] < 1.0


def test_a_floor_without_end_is_refused() -> None:
    far = np.array([[0.0, 0.0, 0.0], [1e5, 1e5, 0.0]])
    with pytest.raises(InvalidValueError, match="the scans cover"):
        evidence_of(_scans()[:2], far)

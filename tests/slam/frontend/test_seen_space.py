# SPDX-License-Identifier: Apache-2.0
"""What was seen becomes free, what was not stays unknown, what is there stays there."""

import math

import numpy as np
import pytest

from slam.frames import LaserSpec, Scan
from slam.frontend.seen_space import SeenSpace
from slam.system import Raster

SPEC = LaserSpec(n_beams=181, angle_min=-math.pi / 2, angle_increment=math.radians(1.0))


def half_disc(radius: float, pose) -> SeenSpace:
    seen = SeenSpace(0.05)
    ranges = np.full(181, radius, np.float32)
    seen.add(Scan(stamp_ns=0, ranges=ranges, spec=SPEC), np.asarray(pose, dtype=float))
    return seen


def blank(extent: float = 0.3, step: float = 0.1) -> Raster:
    n = round(extent / step)
    return Raster(
        values=np.full((n, n), np.nan, np.float32), resolution_m=step, T_map_origin=np.zeros(3)
    )


@pytest.mark.parametrize("pose", [(0.0, 0.0, 0.0), (3.3, -17.2, 2.0), (-40.0, 12.0, -1.0)])
def test_a_half_disc_of_free_space_has_its_area_and_place(pose):
    raster = half_disc(4.0, pose).merge(blank())
    free = np.argwhere(raster.values == 0.0)
    area = len(free) * raster.resolution_m**2
    assert area == pytest.approx(math.pi * 16.0 / 2.0, rel=0.05)
    centre = raster.T_map_origin[:2] + (free.mean(axis=0)[::-1] + 0.5) * raster.resolution_m
    offset = 4.0 * 4.0 / (3.0 * math.pi)  # centroid of a half disc
    expected = [pose[0] + offset * math.cos(pose[2]), pose[1] + offset * math.sin(pose[2])]
    np.testing.assert_allclose(centre, expected, atol=0.08)


def test_what_is_there_stays_and_what_was_not_seen_stays_unknown():
    values = np.full((60, 60), np.nan, np.float32)
    values[10, 20], values[5, 55] = 0.9, 0.8  # the second lies behind the robot's sight
    raster = Raster(values=values, resolution_m=0.1, T_map_origin=np.array([-1.0, -1.0, 0.0]))
    merged = half_disc(2.0, (0.0, 0.0, 0.0)).merge(raster)
    assert np.nanmax(merged.values) == np.float32(0.9)
    assert (merged.values == np.float32(0.8)).sum() == 1
    assert np.isnan(merged.values).any()


def test_errors_and_missing_returns_claim_little():
    ranges = np.full(181, np.inf, np.float32)
    ranges[::2] = np.nan
    seen = SeenSpace(0.1)
    seen.add(Scan(stamp_ns=0, ranges=ranges, spec=SPEC), np.zeros(3))
    free = (seen.merge(blank()).values == 0.0).sum()
    assert free <= 1  # the cell of the scanner


def test_a_fan_of_lost_beams_and_what_is_behind_a_window_stay_unknown():
    """A wall 3 m ahead with a gap of 20 beams; of those in it, one comes back from 50 m."""
    ranges = np.full(181, 3.0, np.float32)
    ranges[80:100] = np.inf
    ranges[90] = 50.0
    seen = SeenSpace(0.05)
    seen.add(Scan(stamp_ns=0, ranges=ranges, spec=SPEC), np.zeros(3))
    values = seen.merge(blank())
    columns = np.nonzero(values.values == 0.0)[1]
    far = columns * values.resolution_m + values.T_map_origin[0] > 3.1
    assert far.sum() * values.resolution_m**2 < 0.1

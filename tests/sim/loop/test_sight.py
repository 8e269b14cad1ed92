# SPDX-License-Identifier: Apache-2.0
"""What a robot makes of its scans: thin things are wide at the foot, walls are walls, and what has
left the view is remembered for a while."""

import math

import numpy as np
import pytest

from sim.loop.sight import MEMORY_S, THIN_RADIUS_M, WIDE_RADIUS_M, Sight
from slam.frames import LaserSpec, to_ns
from tests.world2d import frame_at

pytestmark = pytest.mark.slow
SPEC = LaserSpec(n_beams=361, angle_min=-math.pi / 2, angle_increment=math.pi / 360, range_max=20.0)
POST = slice(178, 183)  # 2.5 degrees straight ahead: 4 to 7 cm at 1 to 1.6 m


def frame(second, ranges, here=(0.0, 0.0, 0.0)):
    return frame_at(to_ns(second), here, ranges, SPEC, twist=np.zeros(3))


def wall(distance=2.0):
    """Ranges to a wall straight ahead, nothing beyond 10 m."""
    ranges = distance / np.maximum(np.cos(SPEC.angles), 1e-3)
    return np.where(ranges < 10.0, ranges, np.inf)


def post(at=1.0, behind=None):
    ranges = np.full(SPEC.n_beams, np.inf) if behind is None else behind.copy()
    ranges[POST] = at
    return ranges


def test_a_post_is_wider_than_it_looks_and_a_wall_is_not():
    sight = Sight()
    sight.take(frame(0.0, post(behind=wall())))
    is_post = np.abs(sight.points_robot[:, 0] - 1.0) < 0.01
    assert set(sight.radii[is_post]) == {THIN_RADIUS_M}
    assert set(sight.radii[~is_post]) == {WIDE_RADIUS_M}
    assert np.allclose(sight.points_robot[~is_post, 0], 2.0, atol=1e-5)


def test_the_end_of_what_was_seen_to_be_a_wall_is_no_post():
    sight = Sight()
    sight.take(frame(0.0, wall(1.0)))
    sight.take(frame(0.1, post(1.0)))
    assert set(sight.radii) == {WIDE_RADIUS_M}


def test_what_is_behind_the_back_is_remembered_for_a_while():
    sight = Sight()
    sight.take(frame(0.0, post()))
    blank = np.full(SPEC.n_beams, np.inf)
    sight.take(frame(1.0, blank, here=(0.0, 0.0, math.pi)))
    assert np.allclose(sight.points_robot.mean(axis=0), [-1.0, 0.0], atol=0.02)
    assert set(sight.radii) == {THIN_RADIUS_M}
    sight.take(frame(1.1 + MEMORY_S, blank, here=(0.0, 0.0, math.pi)))
    assert len(sight.radii) == 0


def test_what_is_seen_through_is_gone_and_what_does_not_answer_is_not_seen_through():
    gone, silent = Sight(), Sight()
    dark = wall()
    dark[POST] = math.nan
    for sight, after in ((gone, wall()), (silent, dark)):
        sight.take(frame(0.0, post(behind=wall())))
        sight.take(frame(0.1, after))
    assert (np.abs(gone.points_robot[:, 0] - 2.0) < 0.01).all()
    assert (np.abs(silent.points_robot[:, 0] - 1.0) < 0.01).any()

# SPDX-License-Identifier: Apache-2.0
"""Corners of a scan: where they truly are, with an honest covariance, and none that is not one."""

import math
import sys
from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np
import pytest

from slam import se2
from slam.frames import Features, LaserSpec, Scan
from slam.frontend.corners import IDEAL, answered, corners, draw, refine

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
import world2d

AHEAD = np.zeros(3)


def segments(*points: tuple[float, float]) -> np.ndarray:
    return np.array([[*a, *b] for a, b in pairwise(points)])


def cast(
    walls: np.ndarray, *, n: int = 361, noise: float = 0.01, seed: int = 0, posts: object = None
) -> Scan:
    spec = world2d.laser(n)
    world = world2d.World2D(walls, posts)
    laser = np.tile(se2.compose(AHEAD, spec.T_robot_laser), (n, 1))
    ranges = world.ranges(0.0, laser, spec.angles, 40.0)
    ranges = ranges + np.random.default_rng(seed).normal(0.0, noise, n)
    return Scan(stamp_ns=0, ranges=ranges.astype(np.float32), spec=spec)


class Posts:
    """Round things, as ``world2d`` draws chairs."""

    def __init__(self, *discs: tuple[float, float, float]) -> None:
        self._discs = np.array(discs)

    def discs(self, t: float) -> np.ndarray:
        return self._discs


def errors_to(features: Features, corner: tuple[float, float]) -> np.ndarray:
    away = features.points_robot - corner
    return away[np.hypot(away[:, 0], away[:, 1]) < 0.3]


@pytest.mark.parametrize("angle_deg", [60.0, 90.0, 120.0])
@pytest.mark.parametrize("shift", [0.0, 0.3, 0.5])
def test_meeting_lines_and_dots_are_found_within_a_tenth_of_a_cell(angle_deg, shift):
    image, widths = np.zeros((80, 80)), np.ones((80, 80))
    c, s = math.cos(math.radians(angle_deg)), math.sin(math.radians(angle_deg))
    corner = np.array([40.0 + shift, 40.0 + shift])
    arms = 30.0 * np.array([[1.0, 0.0], [0.0, 0.0], [c, s]])
    points = np.vstack([corner + arms, [15.0, 15.0]])
    drawn, joined = np.ones(4, dtype=bool), np.array([True, True, False, False])
    draw(image, widths, points, np.full(4, 1.2), drawn, joined)
    for start, truth, within in ((corner, corner, 0.25), (points[3], points[3], 0.02)):
        column, row = np.round(start + 1.0).astype(int)
        x, y, covariance, found = refine(image, widths, int(column), int(row))
        assert found
        np.testing.assert_allclose([x, y], truth, atol=within)
        assert np.linalg.eigvalsh(covariance).min() >= -1e-12


def test_a_line_is_no_point():
    image, widths = np.zeros((60, 60)), np.ones((60, 60))
    line = np.array([[-10.0, 20.3], [70.0, 35.7]])
    both = np.ones(2, dtype=bool)
    draw(image, widths, line, np.full(2, 1.2), both, np.array([True, False]))
    assert not refine(image, widths, 30, 28)[3]
    response = cv2.cornerMinEigenVal(image.astype(np.float32), 5, ksize=3)
    assert response[15:45, 15:45].max() < 0.01 * IDEAL


@pytest.mark.parametrize("n", [181, 361])
def test_corners_of_a_room_are_found_where_they_are(n):
    """Inner corners and a pillar's outer one, over 40 noisy scans, with their covariance."""
    walls = np.vstack([segments((0.0, -3.0), (5.0, -3.0), (5.0, 3.0), (0.0, 3.0)),
                       world2d.rectangle(3.0, -0.2, 3.6, 0.6)])  # fmt: skip
    truth = [(5.0, -3.0), (5.0, 3.0), (3.0, -0.2), (3.0, 0.6)]
    found, normalised, others = [], [], 0
    for seed in range(40):
        features = corners(cast(walls, n=n, seed=seed))
        matched = 0
        for corner in truth:
            for k, point in enumerate(features.points_robot):
                e = point - corner
                if np.hypot(*e) < 0.3:
                    matched += 1
                    found.append(np.hypot(*e))
                    normalised.append(e @ np.linalg.solve(features.covariances[k], e))
        others += len(features.points_robot) - matched
    assert len(found) > 0.85 * 4 * 40  # recall
    assert others < 0.1 * len(found)
    assert np.sqrt(np.mean(np.square(found))) < (0.06 if n == 181 else 0.04)
    assert 0.2 < np.mean(normalised) < 4.0  # 2 where the covariance is exact


def test_posts_are_found_and_their_shadows_are_not():
    """Thin posts before a wall: each throws a shadow whose two edges end no wall."""
    posts = Posts((2.0, 0.5, 0.03), (2.5, -1.0, 0.03), (3.0, 1.5, 0.03))
    wall = segments((4.0, -12.0), (4.0, 12.0))
    hits, others = 0, 0
    for seed in range(20):
        features = corners(cast(wall, seed=seed, posts=posts))
        near = [len(errors_to(features, (x, y))) for x, y, _ in posts.discs(0.0)]
        hits += sum(count == 1 for count in near)
        others += len(features.points_robot) - sum(near)
    assert hits >= 0.9 * 3 * 20
    assert others <= 1


def test_a_mixed_pixel_is_no_post():
    """A beam that falls half on an edge and half behind it ends in mid-air."""
    spec = world2d.laser(361)
    ranges = np.full(361, 6.0, dtype=np.float32)
    ranges[:180] = 2.0
    clean = corners(Scan(stamp_ns=0, ranges=ranges, spec=spec))
    ranges[180] = 4.0
    mixed = corners(Scan(stamp_ns=0, ranges=ranges, spec=spec))
    in_air = se2.transform(spec.T_robot_laser, [4.0, 0.0])
    assert len(errors_to(mixed, tuple(in_air))) == 0
    assert len(clean.points_robot) == len(mixed.points_robot) == 1
    edge = se2.transform(spec.T_robot_laser, [2.0, 0.0])
    assert np.hypot(*(mixed.points_robot[0] - edge)) < 0.05


def test_the_limits_of_view_and_range_end_nothing():
    wall = segments((-30.0, 2.0), (30.0, 2.0))
    for seed in range(5):
        assert len(corners(cast(wall, seed=seed)).points_robot) == 0


def test_the_sweep_is_undone():
    """Turning at 2 rad/s, the odd beams of an interlaced scan come 13 ms later."""
    spec = world2d.laser(361, interlaced=True)
    twist = np.array([0.5, 0.0, 2.0])
    walls = segments((3.0, -6.0), (3.0, 1.0), (8.0, 1.0))
    lasers = np.array(
        [se2.compose(se2.exp(twist, t), spec.T_robot_laser) for t in spec.beam_time_offsets]
    )
    ranges = world2d.World2D(walls).ranges(0.0, lasers, spec.angles, 40.0)
    scan = Scan(stamp_ns=0, ranges=ranges.astype(np.float32), spec=spec)
    (undone,) = errors_to(corners(scan, twist=twist), (3.0, 1.0))
    assert np.hypot(*undone) < 0.04  # the gap between two beams there


def test_many_beams_without_an_answer_see_nothing_and_few_have_failed():
    ranges = np.full(12, 2.0, dtype=np.float32)
    ranges[2:4] = ranges[6:] = np.nan
    spec = LaserSpec(n_beams=12, angle_min=-0.05, angle_increment=0.01)
    told = answered(Scan(stamp_ns=0, ranges=ranges, spec=spec))
    np.testing.assert_array_equal(told[:6], [2.0, 2.0, -1.0, -1.0, 2.0, 2.0])
    assert (told[6:] > 1e3).all()


def test_a_post_before_nothing_is_a_feature():
    ranges = np.full(361, np.nan, dtype=np.float32)
    ranges[178:183] = 2.0
    spec = LaserSpec(n_beams=361, angle_min=-np.pi / 2, angle_increment=np.pi / 360)
    found = corners(Scan(stamp_ns=0, ranges=ranges, spec=spec))
    np.testing.assert_allclose(found.points_robot, [[2.0, 0.0]], atol=0.03)

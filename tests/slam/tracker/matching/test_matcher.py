# SPDX-License-Identifier: Apache-2.0
"""Matching: derivatives, branch and bound, impressions, prior."""

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from slam import se2
from slam._jit import njit
from slam.frames import Features, Odometry, Scan
from slam.frontend import surfaces
from slam.frontend.observations import Observations, from_features, from_scan
from slam.frontend.odometry_prior import predict
from slam.shunting.slam import ShuntingConfig
from slam.tracker.matching.local_search import SearchWindow
from slam.tracker.matching.matcher import Matcher, seen_by
from slam.tracker.matching.score import evaluate
from slam.tracker.network import Network
from slam.tracker.rasterise import rasterise
from tests.world2d import World2D, arena, laser, rectangle

Array = NDArray[np.float64]
CONFIG = ShuntingConfig(cell_m=0.05)


@njit
def join(
    points: Array, beams: Array, origin: Array, near: float, out: Array, tangents: Array
) -> None:
    """Only other kernels can call it."""
    surfaces.join(points, beams, origin, near, out, tangents)


@njit
def follow_ends(
    points: Array, beams: Array, origin: Array, joined: Array, sweep: tuple[float, int, float],
    tangents: Array,
) -> None:  # fmt: skip
    """Only other kernels can call it."""
    surfaces.follow_ends(points, beams, origin, joined, sweep, tangents)


def room_scan(pose: Array, n_beams: int = 181) -> Scan:
    spec = laser(n_beams)
    poses = np.tile(se2.compose(pose, spec.T_robot_laser), (n_beams, 1))
    ranges = World2D(arena()).ranges(0.0, poses, spec.angles, 80.0)
    return Scan(stamp_ns=0, ranges=ranges.astype(np.float32), spec=spec)


def room(T_map_robot: Array | None = None) -> Network:
    pose = np.zeros(3) if T_map_robot is None else T_map_robot
    network = Network(CONFIG)
    observations = from_scan(room_scan(pose), np.zeros(3), CONFIG)
    rasterise(network, observations, pose)
    T_map_laser = se2.compose(pose, observations.T_robot_laser)
    network.integrate(observations.view, T_map_laser, 1.0, write=True)
    return network


def features_at(points: Array, spread: float) -> Features:
    covariance = spread**2 * np.array([[1.0, 0.4], [0.4, 0.5]])
    return Features(
        stamp_ns=0, points_robot=points, covariances=np.tile(covariance, (len(points), 1, 1))
    )


@pytest.mark.parametrize("objective", ["sum", "log"])
def test_gradient_and_curvature_agree_with_differences(objective: str) -> None:
    network = room()
    matcher = Matcher(ShuntingConfig(cell_m=0.05, objective=objective))  # type: ignore[arg-type]
    seen = from_scan(room_scan(np.zeros(3)), np.zeros(3), CONFIG)

    def score(pose: Array) -> tuple[float, Array, Array]:
        gradient, along, information = np.empty(3), np.empty(3), np.empty((3, 3))
        value, *_ = evaluate(
            network.cells, matcher.reward, seen_by(seen), pose, gradient, along, information
        )  # fmt: skip
        return value, gradient, information

    rng = np.random.default_rng(1)
    for _ in range(5):
        pose = rng.normal(0.0, [0.02, 0.02, 0.004])
        gradient = score(pose)[1]
        for k, h in enumerate((1e-4, 1e-4, 1e-5)):
            step = np.zeros(3)
            step[k] = h
            slope = (score(pose + step)[0] - score(pose - step)[0]) / (2.0 * h)
            assert slope == pytest.approx(gradient[k], rel=0.02, abs=0.005 * abs(gradient).max())
    # near the optimum hardly any observation is clipped: information = -second difference
    step = np.array([2e-3, 0.0, 0.0])
    best = np.zeros(3)
    second = (score(best + step)[0] - 2.0 * score(best)[0] + score(best - step)[0]) / 4e-6
    assert -second == pytest.approx(score(best)[2][0, 0], rel=0.15)


def test_search_finds_a_far_pose() -> None:
    network, matcher = room(), Matcher(CONFIG)
    truth = np.array([0.45, -0.38, 0.35])
    seen = from_scan(room_scan(truth), np.zeros(3), CONFIG)
    precision = np.diag([4.0, 4.0, 4.0])
    window = SearchWindow(reach_m=0.6, turn_rad=0.5)
    match = matcher.search(network, seen, np.zeros(3), precision, window)
    assert match.searched
    np.testing.assert_allclose(match.T_map_robot, truth, atol=0.02)


def test_features_match_through_the_same_interface() -> None:
    rng = np.random.default_rng(2)
    landmarks = rng.uniform(-8.0, 8.0, (25, 2))
    network, matcher = Network(CONFIG), Matcher(CONFIG)
    seen = from_features(features_at(landmarks, 0.05), CONFIG)
    rasterise(network, seen, np.zeros(3))
    network.integrate(seen.view, np.zeros(3), 1.0, write=True)
    truth = np.array([0.05, 0.04, -0.006])
    again = features_at(se2.transform(se2.inverse(truth), landmarks), 0.05)
    match = matcher.climb(
        network, from_features(again, CONFIG), np.zeros(3), np.zeros(3), np.eye(3)
    )
    np.testing.assert_allclose(match.T_map_robot, truth, atol=0.005)


def test_returns_of_one_wall_are_joined_and_those_across_a_gap_are_not() -> None:
    wall = np.stack([np.linspace(0.0, 4.0, 11), np.full(11, 2.0)], axis=1)
    post = np.array([[4.4, 1.0], [4.8, 3.5]])
    points = np.vstack([wall, post])
    joined, tangents = np.zeros(13, np.bool_), np.zeros((13, 2))
    join(points, np.arange(13), np.array([2.0, 0.0, 0.0]), 0.1, joined, tangents)
    assert joined[:10].all()
    assert not joined[10:].any()
    np.testing.assert_allclose(tangents[1:10], np.tile([1.0, 0.0], (9, 1)))
    beams = np.arange(13)
    beams[5:] += 1  # a beam without a return between the fifth and the sixth
    join(points, beams, np.array([2.0, 0.0, 0.0]), 0.1, joined, tangents)
    assert not joined[4]


def test_a_surface_ends_only_where_a_beam_sees_past_it() -> None:
    """A wall along y = 1 from x = 0 to 2, seen from the origin by a beam every 2 degrees."""
    angles = np.radians(np.arange(28.0, 90.1, 2.0))
    points = np.stack([1.0 / np.tan(angles), np.ones(len(angles))], axis=1)
    behind, nearer = np.array([[4.5, 2.2]]), np.array([[0.9, 0.44]])
    increment, n = math.radians(2.0), len(points)
    for first, range_m, ends in (
        (behind, 10.0, True),  # the beam beside its last hit goes on far behind it
        (nearer, 10.0, False),  # something hides the rest
        (None, 1.9, False),  # the rest is out of range
        (None, 10.0, True),  # it is not, and yet there is no return
    ):
        seen = points if first is None else np.vstack([first, points])
        beams = np.arange(n + 1)[-len(seen) :]
        joined, tangents = np.zeros(len(seen), np.bool_), np.zeros((len(seen), 2))
        join(seen, beams, np.zeros(3), 0.15, joined, tangents)
        follow_ends(seen, beams, np.zeros(3), joined, (increment, n + 1, range_m), tangents)
        end = len(seen) - n
        assert (not tangents[end].any()) == ends
        assert ends or abs(tangents[end, 0]) == pytest.approx(1.0)
        assert abs(tangents[-1, 0]) == pytest.approx(1.0)  # at the edge of the field of view


def test_table_legs_in_line_with_a_wall_are_not_joined_to_it() -> None:
    """A near leg, a far leg and the wall, nearly radial and evenly spaced: three hits in line."""
    points = np.array([[1.00, 0.0], [1.60, 0.02], [2.25, 0.04], [2.25, 0.09], [2.25, 0.14]])
    joined, tangents = np.zeros(5, np.bool_), np.zeros((5, 2))
    join(points, np.arange(5), np.zeros(3), 0.06, joined, tangents)
    assert joined.tolist() == [False, False, True, True, False]


def test_a_mixed_pixel_is_left_out_and_a_thin_leg_is_not() -> None:
    spec = laser(181)
    for ranges, seen in (
        ([2.0, 2.0, 2.0, 2.4, 2.9, 2.9, 2.9], 6),
        ([3.0] * 3 + [1.5] + [3.0] * 3, 7),
    ):
        scan = Scan(stamp_ns=0, ranges=np.array(ranges + [np.inf] * 174, np.float32), spec=spec)
        assert len(from_scan(scan, np.zeros(3), CONFIG).points_robot) == seen


def test_coming_near_helps_where_the_heading_is_vague() -> None:
    network, matcher = room(), Matcher(CONFIG)
    truth = np.array([0.02, -0.01, 0.05])
    seen = from_scan(room_scan(truth), np.zeros(3), CONFIG)
    vague = np.diag([4e-4, 4e-4, 9e-4])
    match = matcher.matched(network, seen, np.zeros(3), vague)
    np.testing.assert_allclose(match.T_map_robot, truth, atol=0.005)


def test_prior_comes_from_the_frames_own_covariance() -> None:
    covariance = np.diag([0.04, 0.01, 0.0025])
    before = Odometry(stamp_ns=0, T_odom_robot=np.array([1.0, 2.0, 0.3]))
    now = Odometry(
        stamp_ns=200_000_000,
        T_odom_robot=se2.compose(before.T_odom_robot, [0.2, 0.0, 0.1]),
        increment_covariance=covariance,
    )
    T_map = np.array([5.0, 5.0, math.pi / 2.0])
    prediction = predict(T_map, before, now, (2.25, 4.0))
    np.testing.assert_allclose(prediction.T_map_robot, se2.compose(T_map, [0.2, 0.0, 0.1]))
    assert prediction.covariance[1, 1] == pytest.approx(2.25 * 0.04, rel=0.01)  # x is map's y
    assert prediction.covariance[0, 0] == pytest.approx(2.25 * 0.01, rel=0.01)
    assert prediction.covariance[2, 2] == pytest.approx(4.0 * 0.0025, rel=0.01)
    silent = Odometry(stamp_ns=200_000_000, T_odom_robot=now.T_odom_robot)
    assumed = predict(T_map, before, silent).covariance
    assert 0.01 < math.sqrt(assumed[0, 0]) < 0.1


def test_the_other_face_of_a_thin_wall_does_not_count() -> None:
    """A wall of 8 cm mapped from its south, then seen from its north and from its south again."""
    spec = laser(181)
    south, north = np.array([0.0, -1.5, math.pi / 2.0]), np.array([0.0, 1.5, -math.pi / 2.0])
    wall = World2D(rectangle(-4.0, -0.04, 4.0, 0.04))

    def seen_from(pose: Array) -> Observations:
        poses = np.tile(se2.compose(pose, spec.T_robot_laser), (181, 1))
        ranges = wall.ranges(0.0, poses, spec.angles, 80.0).astype(np.float32)
        return from_scan(Scan(stamp_ns=0, ranges=ranges, spec=spec), np.zeros(3), CONFIG)

    network = Network(CONFIG)
    matcher = Matcher(CONFIG)
    known = seen_from(south)
    for _ in range(20):
        rasterise(network, known, south)
        laser_pose = se2.compose(south, known.T_robot_laser)
        network.integrate(known.view, laser_pose, 0.2, write=True)
    firm = 1e6 * np.eye(3)
    moved = north - np.array([0.0, 0.08, 0.0])  # where its two faces fall into one
    assert matcher.climb(network, known, south, south, firm).matched > 0.95
    assert matcher.climb(network, seen_from(north), moved, moved, firm).matched < 0.05
    rasterise(network, seen_from(north), moved)
    look = network.integrate(known.view, se2.compose(moved, spec.T_robot_laser), 0.2, write=False)
    network.release()
    assert look.confirmed < 1.0

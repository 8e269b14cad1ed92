# SPDX-License-Identifier: Apache-2.0
"""The EKF's mathematics: Jacobians by differences, covariances by sampling, known motion."""

import math
from collections.abc import Iterator

import numpy as np
import pytest

from slam import se2
from slam.evaluation.points import PointWorld, PointWorldConfig
from slam.frames import Frame
from slam.landmarks import kernels
from slam.landmarks.filter import EkfFilter, from_range_bearing

LANDMARKS = np.array([[4.0, 1.0], [2.5, -3.0], [6.0, 2.0]])


def spread(*std: float) -> np.ndarray:
    return np.diag(np.square(std))


def looked_around(seed: int = 0) -> EkfFilter:
    """A filter somewhere, with three landmarks and everything correlated."""
    ekf = EkfFilter()
    ekf.predict([0.5, 0.1, 0.3], spread(0.05, 0.03, 0.02))
    noise = np.random.default_rng(seed).normal(0.0, 0.02, (3, 2))
    seen = se2.transform(se2.inverse(ekf.pose), LANDMARKS) + noise
    ekf.add(seen, np.tile(spread(0.05, 0.03), (3, 1, 1)))
    ekf.predict([0.4, 0.0, -0.2], spread(0.04, 0.01, 0.03))
    return ekf


def seen_from(pose: np.ndarray, landmark: np.ndarray) -> np.ndarray:
    return se2.transform(se2.inverse(pose), landmark)


def displaced(ekf: EkfFilter, xi: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    pose, landmarks = ekf.pose.copy(), ekf.landmarks.copy()
    kernels.retract(pose, landmarks, len(landmarks), xi)
    return pose, landmarks


@pytest.mark.parametrize("turn", [0.0, 1e-5, 0.4, -2.0])
def test_the_view_of_a_landmark_and_its_jacobian(turn):
    """``look`` at xi is the view after ``retract`` by xi; H its central differences."""
    ekf = looked_around()
    xi = np.random.default_rng(1).normal(0.0, 0.3, 9)
    xi[2] = turn
    h, H, scratch = np.zeros(2), np.zeros((2, 5)), np.zeros((2, 5))
    kernels.look(ekf.pose, ekf.landmarks[1], xi, 5, h, H)
    pose, landmarks = displaced(ekf, xi)
    np.testing.assert_allclose(h, seen_from(pose, landmarks[1]), atol=1e-12)
    for column, k in enumerate([0, 1, 2, 5, 6]):
        step, plus, minus = np.zeros(9), np.zeros(2), np.zeros(2)
        step[k] = 1e-5
        kernels.look(ekf.pose, ekf.landmarks[1], xi + step, 5, plus, scratch)
        kernels.look(ekf.pose, ekf.landmarks[1], xi - step, 5, minus, scratch)
        np.testing.assert_allclose(H[:, column], (plus - minus) / 2e-5, atol=2e-8)


def test_without_error_the_view_does_not_depend_on_the_heading():
    """The invariance that keeps the filter from inventing heading: no column for dtheta at 0."""
    ekf = looked_around()
    h, H = np.zeros(2), np.zeros((2, 5))
    kernels.look(ekf.pose, ekf.landmarks[0], np.zeros(9), 3, h, H)
    np.testing.assert_array_equal(H[:, 2], 0.0)


def test_retraction_turns_rigidly_about_any_point():
    """A turn about a point is a straight line in xi: that point rests, distances stay."""
    ekf = looked_around()
    centre, angle = ekf.landmarks[2].copy(), 1.1
    xi = np.zeros(9)
    xi[2] = angle
    xi[[0, 3, 5, 7]], xi[[1, 4, 6, 8]] = angle * centre[1], -angle * centre[0]
    pose, landmarks = displaced(ekf, xi)
    np.testing.assert_allclose(landmarks[2], centre, atol=1e-12)
    for old, new in zip(ekf.landmarks, landmarks, strict=True):
        np.testing.assert_allclose(seen_from(pose, new), seen_from(ekf.pose, old), atol=1e-12)


def test_covariance_of_motion_and_new_landmarks_is_that_of_samples():
    """Pose, landmarks and all cross-covariances, against the motion and the sensor simulated."""
    rng = np.random.default_rng(5)
    steps = [([0.5, 0.1, 0.3], (0.02, 0.01, 0.01)), ([0.4, 0.0, -0.2], (0.03, 0.01, 0.02))]
    seen = np.array([[3.0, 1.0], [2.0, -2.0]])
    ekf = EkfFilter()
    ekf.predict(steps[0][0], spread(*steps[0][1]))
    ekf.add(seen, np.tile(spread(0.01, 0.02), (2, 1, 1)))
    ekf.predict(steps[1][0], spread(*steps[1][1]))
    samples = []
    for _ in range(8000):
        first = se2.compose(np.zeros(3), rng.normal(steps[0][0], steps[0][1]))
        points = se2.transform(first, seen + rng.normal(0.0, [0.01, 0.02], (2, 2)))
        second = se2.compose(first, rng.normal(steps[1][0], steps[1][1]))
        samples.append(np.concatenate([second, points.ravel()]))
    plain = np.zeros((7, 7))
    T = np.eye(7)
    for k, point in ((0, ekf.pose), (3, ekf.landmarks[0]), (5, ekf.landmarks[1])):
        T[k, 2], T[k + 1, 2] = T[k, 2] - point[1], T[k + 1, 2] + point[0]
    plain = T @ ekf.error_covariance @ T.T
    sampled = np.cov(np.array(samples).T)
    scale = np.sqrt(np.outer(np.diag(sampled), np.diag(sampled)))
    np.testing.assert_allclose(plain / scale, sampled / scale, atol=0.05)
    np.testing.assert_allclose(ekf.pose_covariance(), plain[:3, :3], atol=1e-12)
    np.testing.assert_allclose(ekf.landmark_covariances()[1], plain[5:, 5:], atol=1e-12)


def test_a_landmark_in_the_distance_lets_the_pose_only_swing_round_it():
    """Heading 0.3 rad off: one known point leaves an arc of poses, a second one settles it."""
    true = np.array([0.6, 0.05, 0.5])
    ekf = EkfFilter()
    ekf.add(LANDMARKS, np.tile(spread(1e-4, 1e-4), (3, 1, 1)))
    ekf.predict([0.5, 0.0, 0.2], spread(0.2, 0.2, 0.3))
    for k in range(2):
        seen = seen_from(true, LANDMARKS[k : k + 1])
        ekf.update([k], seen, np.tile(spread(1e-3, 1e-3), (1, 1, 1)))
        np.testing.assert_allclose(seen_from(ekf.pose, ekf.landmarks[k]), seen[0], atol=2e-3)
    np.testing.assert_allclose(ekf.pose, true, atol=3e-3)
    # still seeing the first one where it was seen: the arc was a straight line in xi
    off = seen_from(ekf.pose, ekf.landmarks[0]) - seen_from(true, LANDMARKS[0])
    assert np.hypot(*off) < 3e-3


def test_update_is_the_bayes_rule_and_joseph_keeps_it_symmetric():
    ekf = looked_around()
    P, pose = ekf.error_covariance.copy(), ekf.pose.copy()
    R = spread(0.02, 0.01)
    z = seen_from(pose, ekf.landmarks[1])  # as predicted: nothing moves, only P shrinks
    h, block = np.zeros(2), np.zeros((2, 5))
    kernels.look(pose, ekf.landmarks[1], np.zeros(9), 5, h, block)
    H = np.zeros((2, 9))
    H[:, [0, 1, 2, 5, 6]] = block
    expected = np.linalg.inv(np.linalg.inv(P) + H.T @ np.linalg.inv(R) @ H)
    cost = ekf.update([1], z[None], R[None])
    np.testing.assert_allclose(cost, 0.0, atol=1e-20)
    np.testing.assert_allclose(ekf.pose, pose, atol=1e-12)
    np.testing.assert_allclose(ekf.error_covariance, expected, rtol=1e-9, atol=1e-15)
    np.testing.assert_array_equal(ekf.error_covariance, ekf.error_covariance.T)
    assert np.linalg.eigvalsh(ekf.error_covariance).min() > 0.0


def test_together_or_one_by_one_is_the_same():
    """Independent observations: the order cannot matter (but for linearisation)."""
    both, single = looked_around(), looked_around()
    z = np.array([seen_from(both.pose, p) for p in both.landmarks[:2]]) + 0.01
    R = np.tile(spread(0.02, 0.03), (2, 1, 1))
    cost = both.update([0, 1], z, R)
    costs = [single.update([k], z[k : k + 1], R[k : k + 1]) for k in (0, 1)]
    np.testing.assert_allclose(sum(costs), cost, rtol=2e-2)
    np.testing.assert_allclose(single.pose, both.pose, atol=1e-4)
    np.testing.assert_allclose(single.error_covariance, both.error_covariance, atol=3e-6)


def test_removed_landmarks_leave_the_rest_as_it_was():
    ekf = looked_around()
    P, landmarks = ekf.error_covariance.copy(), ekf.landmarks.copy()
    ekf.remove([1])
    keep = [0, 1, 2, 3, 4, 7, 8]
    np.testing.assert_array_equal(ekf.error_covariance, P[np.ix_(keep, keep)])
    np.testing.assert_array_equal(ekf.landmarks, landmarks[[0, 2]])
    ekf.add(np.array([[1.0, 0.0]]), spread(0.1, 0.1)[None])
    assert len(ekf) == 3


def test_range_and_bearing_become_a_point_as_samples_do():
    rng = np.random.default_rng(2)
    point, covariance = from_range_bearing(5.0, 0.7, 0.05, 0.02)
    r, b = rng.normal(5.0, 0.05, 20000), rng.normal(0.7, 0.02, 20000)
    samples = np.stack([r * np.cos(b), r * np.sin(b)])
    np.testing.assert_allclose(point, [5.0 * math.cos(0.7), 5.0 * math.sin(0.7)])
    np.testing.assert_allclose(covariance, np.cov(samples), atol=2e-4)


def run_with_true_associations(
    world: PointWorld, noise_scale: float = 1.25
) -> Iterator[tuple[Frame, EkfFilter]]:
    """What perfect data association would make of the filter."""
    ekf, before, known = EkfFilter(), None, dict[int, int]()
    for frame in world.stream():
        now, seen = frame.odometry, frame.features
        if before is not None:
            increment = se2.between(before.T_odom_robot, now.T_odom_robot)
            ekf.predict(increment, now.increment_covariance)
        before = now
        old = np.array([i in known for i in seen.ids.tolist()])
        R = seen.covariances * noise_scale**2
        ekf.update([known[i] for i in seen.ids[old].tolist()], seen.points_robot[old], R[old])
        new = ekf.add(seen.points_robot[~old], R[~old])
        known |= dict(zip(seen.ids[~old].tolist(), new.tolist(), strict=True))
        yield frame, ekf


def test_the_static_run_with_true_associations_is_accurate_and_consistent():
    """The bar: 0.05 m with a 1 mm sensor after steps of 0.1 m and 0.03 rad; NEES 3 on average."""
    nees = []
    for seed in range(8):
        world = PointWorld(PointWorldConfig(), seed=seed)
        squared = []
        for frame, ekf in run_with_true_associations(world):
            error = ekf.pose - se2.between(world.path[0], frame.truth)
            error[2] = se2.wrap(error[2])
            squared.append(error[0] ** 2 + error[1] ** 2)
            if len(squared) > 1:
                nees.append(error @ np.linalg.solve(ekf.pose_covariance(), error))
        assert math.sqrt(np.mean(squared)) < 0.03, seed
    assert 2.0 < np.mean(nees) < 4.0

# SPDX-License-Identifier: Apache-2.0
"""Gates and IPJC: the best of all hypotheses where theory says so, pairs that others miss."""

from itertools import product

import numpy as np
import pytest
from scipy.stats import chi2

from slam import se2
from slam.landmarks import kernels
from slam.landmarks.association import ipjc
from slam.landmarks.filter import EkfFilter
from slam.landmarks.hypotheses import Gates, chi_square

GATES, OPEN = Gates(), Gates(posterior=1.0 - 1e-15)


def spread(*std: float) -> np.ndarray:
    return np.diag(np.square(std))


class Scene:
    """Landmarks known to the millimetre, a pose that is not, and what is seen from the true one."""

    def __init__(
        self,
        seed: int,
        *,
        n: int = 6,
        pose_std: tuple[float, float, float] = (0.1, 0.1, 0.002),
        sensor_std: float = 0.02,
        clutter: int = 0,
        side: float = 8.0,
    ) -> None:
        rng = np.random.default_rng(seed)
        landmarks = rng.uniform(-side / 2.0, side / 2.0, (n, 2))
        self.ekf = EkfFilter()
        self.ekf.add(landmarks, np.tile(spread(0.002, 0.002), (n, 1, 1)))
        self.ekf.predict(np.zeros(3), spread(*pose_std))
        true = rng.normal(0.0, pose_std)
        order = rng.permutation(n)
        seen = se2.transform(se2.inverse(true), landmarks)[order]
        seen += rng.normal(0.0, sensor_std, seen.shape)
        wrong = landmarks[rng.integers(0, n, clutter)] + rng.normal(0.0, 0.15, (clutter, 2))
        shuffle = rng.permutation(n + clutter)
        self.points = np.concatenate([seen, wrong])[shuffle]
        self.truth = np.concatenate([order, np.full(clutter, -1)])[shuffle]
        self.covariances = np.tile(spread(sensor_std, sensor_std), (n + clutter, 1, 1))
        self.chosen = np.arange(n)

    def solve(self, method, gates: Gates = GATES):
        return method(self.ekf, self.chosen, self.points, self.covariances, gates)


@pytest.mark.parametrize("degrees", [2, 8, 40])
def test_gates_are_quantiles_of_chi_square(degrees):
    for p in (0.5, 0.95, 0.9999):
        assert chi_square(p, degrees) == pytest.approx(chi2.ppf(p, degrees), rel=1e-9)
    assert GATES.together(3) == chi_square(GATES.joint, 6)


def joint_cost(scene: Scene, landmarks: tuple[int, ...]) -> float:
    """Chi-square of all pairs together under the prior, linearised there."""
    seen = [k for k, j in enumerate(landmarks) if j >= 0]
    n, xi = len(scene.chosen), np.zeros(3 + 2 * len(scene.chosen))
    H, innovation = np.zeros((2 * len(seen), len(xi))), np.zeros(2 * len(seen))
    R = np.zeros((2 * len(seen), 2 * len(seen)))
    for row, k in enumerate(seen):
        j, h, block = landmarks[k], np.zeros(2), np.zeros((2, 5))
        kernels.look(scene.ekf.pose, scene.ekf.landmarks[j], xi, 3 + 2 * j, h, block)
        two = slice(2 * row, 2 * row + 2)
        H[two, :3], H[two, 3 + 2 * j : 5 + 2 * j] = block[:, :3], block[:, 3:]
        innovation[two], R[two, two] = scene.points[k] - h, scene.covariances[k]
    P = scene.ekf.error_covariance[: 3 + 2 * n, : 3 + 2 * n]
    return float(innovation @ np.linalg.solve(H @ P @ H.T + R, innovation))


@pytest.mark.parametrize("seed", range(10))
def test_the_best_of_all_hypotheses_is_found_on_linear_problems(seed):
    """Chain rule: the posterior costs sum up to the joint cost, where the other gates are open."""
    scene, best = Scene(seed, n=3, pose_std=(0.1, 0.1, 1e-5), clutter=1, side=3.0), (0, 0.0, (-1,))
    for landmarks in product((-1, 0, 1, 2), repeat=4):
        pairs = [j for j in landmarks if j >= 0]
        if pairs and len(set(pairs)) == len(pairs):
            cost = joint_cost(scene, landmarks)
            if cost < GATES.together(len(pairs)):
                best = max(best, (len(pairs), -cost, landmarks))
    answer = scene.solve(ipjc, OPEN)
    assert tuple(answer.landmarks) == best[2]
    assert answer.cost == pytest.approx(-best[1], rel=1e-4)


def test_a_shared_error_of_the_pose_is_seen_jointly():
    """Points 0.35 m apart, the robot 0.4 m off along them: alone each has a better neighbour."""
    line = np.array([[3.0 + 0.35 * k, 1.0] for k in range(4)])
    ekf = EkfFilter()
    ekf.add(line, np.tile(spread(0.002, 0.002), (4, 1, 1)))
    ekf.predict(np.zeros(3), spread(0.3, 0.05, 0.001))
    # all four are seen, 0.3 m nearer than they should be
    points, R = line - [0.3, 0.0], np.tile(spread(0.01, 0.01), (4, 1, 1))
    assert ipjc(ekf, np.arange(4), points, R, GATES).landmarks.tolist() == [0, 1, 2, 3]


def test_the_posterior_test_survives_curvature():
    """1 mm sensor, heading 0.1 rad: the arcs' sagitta is many sigmas for a test linearised once."""
    found = 0
    for seed in range(15):
        scene = Scene(seed, n=6, pose_std=(0.1, 0.1, 0.1), sensor_std=0.001, clutter=0, side=10.0)
        answer = scene.solve(ipjc)
        assert set(answer.landmarks[answer.landmarks != scene.truth]) <= {-1}
        found += int((answer.landmarks == scene.truth).sum())
    assert found >= 0.95 * 15 * 6


@pytest.mark.parametrize("exact", [np.zeros((2, 2)), np.diag([1e-4, 0.0])])
def test_a_singular_innovation_is_no_pair(exact):
    """All known exactly, or all but one direction: there is no chi-square to judge by."""
    ekf = EkfFilter()
    ekf.add(np.array([[2.0, 0.0], [3.0, 1.0]]), np.zeros((2, 2, 2)))
    points = ekf.landmarks + np.array([0.0, 0.01])
    answer = ipjc(ekf, np.arange(2), points, np.tile(exact, (2, 1, 1)), GATES)
    assert answer.matched == 0


def test_nothing_seen_or_known_matches_nothing():
    scene = Scene(0)
    none = ipjc(scene.ekf, scene.chosen, np.zeros((0, 2)), np.zeros((0, 2, 2)), GATES)
    assert len(none.landmarks) == 0
    unknown = ipjc(scene.ekf, np.zeros(0, dtype=np.int64), scene.points, scene.covariances, GATES)
    assert unknown.matched == 0
    assert not unknown.plausible.any()
    far = ipjc(scene.ekf, scene.chosen, scene.points + 100.0, scene.covariances, GATES)
    assert far.matched == 0

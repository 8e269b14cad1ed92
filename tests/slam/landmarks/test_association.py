# SPDX-License-Identifier: Apache-2.0
"""Gates, JCBB and IPJC: the same answer where theory says so, and what each costs."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import chi2

from slam import se2
from slam.landmarks.association import METHODS, individual, ipjc, jcbb
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


@pytest.mark.parametrize("seed", range(20))
def test_both_joint_tests_agree_on_linear_problems(seed):
    """Chain rule: the posterior costs sum up to the joint cost, so the best hypothesis is one,
    where the gate that only IPJC has is open."""
    scene, gates = Scene(seed, n=5, pose_std=(0.1, 0.1, 1e-5), clutter=2, side=3.0), OPEN
    reference, incremental = scene.solve(jcbb, gates), scene.solve(ipjc, gates)
    np.testing.assert_array_equal(incremental.landmarks, reference.landmarks)
    assert incremental.cost == pytest.approx(reference.cost, rel=1e-5)
    assert reference.effort.complete
    assert incremental.effort.complete


def test_a_shared_error_of_the_pose_is_seen_only_jointly():
    """Points 0.35 m apart, the robot 0.4 m off along them: alone each has a better neighbour."""
    line = np.array([[3.0 + 0.35 * k, 1.0] for k in range(4)])
    ekf = EkfFilter()
    ekf.add(line, np.tile(spread(0.002, 0.002), (4, 1, 1)))
    ekf.predict(np.zeros(3), spread(0.3, 0.05, 0.001))
    # all four are seen, 0.3 m nearer than they should be
    points, R = line - [0.3, 0.0], np.tile(spread(0.01, 0.01), (4, 1, 1))
    lone = individual(ekf, np.arange(4), points, R, GATES)
    assert lone.landmarks.tolist() != [0, 1, 2, 3]
    for method in (jcbb, ipjc):
        assert method(ekf, np.arange(4), points, R, GATES).landmarks.tolist() == [0, 1, 2, 3]


def test_the_posterior_test_survives_curvature_that_breaks_the_linear_one():
    """1 mm sensor, heading 0.1 rad: the arcs' sagitta is many sigmas for a test linearised once."""
    found = dict.fromkeys(("jcbb", "ipjc"), 0)
    for seed in range(15):
        scene = Scene(seed, n=6, pose_std=(0.1, 0.1, 0.1), sensor_std=0.001, clutter=0, side=10.0)
        for name in found:
            answer = scene.solve(METHODS[name])
            assert set(answer.landmarks[answer.landmarks != scene.truth]) <= {-1}
            found[name] += int((answer.landmarks == scene.truth).sum())
    assert found["ipjc"] >= 0.95 * 15 * 6
    assert found["ipjc"] > 1.3 * found["jcbb"]


def efforts(method, clutter: int = 0, **world) -> np.ndarray:
    """Mean nodes and tests of six searches."""
    found = []
    for seed in range(6):
        effort = Scene(seed, clutter=clutter, **world).solve(method).effort
        assert effort.complete
        found.append((effort.nodes, effort.tests))
    return np.mean(found, axis=0)


def test_clutter_makes_jcbb_branch_and_ipjc_not():
    """The claim of Li and Olson (2012): the posterior cuts what the joint prior must try."""
    world = {"n": 8, "sensor_std": 0.005, "side": 5.0}
    reference, incremental = (
        efforts(method, 6, **world) / efforts(method, 0, **world) for method in (jcbb, ipjc)
    )
    assert reference[0] > 10.0
    assert incremental[0] < 2.5
    assert (reference > 4.0 * incremental).all()


@pytest.mark.parametrize("method", METHODS.values())
@pytest.mark.parametrize("exact", [np.zeros((2, 2)), np.diag([1e-4, 0.0])])
def test_a_singular_innovation_is_no_pair(method, exact):
    """All known exactly, or all but one direction: there is no chi-square to judge by."""
    ekf = EkfFilter()
    ekf.add(np.array([[2.0, 0.0], [3.0, 1.0]]), np.zeros((2, 2, 2)))
    points = ekf.landmarks + np.array([0.0, 0.01])
    answer = method(ekf, np.arange(2), points, np.tile(exact, (2, 1, 1)), GATES)
    assert answer.matched == 0


def test_nothing_seen_or_known_matches_nothing():
    scene = Scene(0)
    for method in METHODS.values():
        none = method(scene.ekf, scene.chosen, np.zeros((0, 2)), np.zeros((0, 2, 2)), GATES)
        assert len(none.landmarks) == 0
        unknown = method(
            scene.ekf, np.zeros(0, dtype=np.int64), scene.points, scene.covariances, GATES
        )
        assert unknown.matched == 0
        assert not unknown.plausible.any()
        far = method(scene.ekf, scene.chosen, scene.points + 100.0, scene.covariances, GATES)
        assert far.matched == 0

# SPDX-License-Identifier: Apache-2.0
"""Peaks between neurons, and the shunting SLAM on point features with IPJC."""

from typing import Any

import numpy as np
import pytest

from slam import create, se2
from slam.ekf.config import EkfConfig
from slam.errors import InvalidValueError
from slam.evaluation import metrics
from slam.evaluation.points import PointWorld, PointWorldConfig
from slam.frames import Features, Frame, LaserSpec, Odometry, Scan
from slam.frontend.observations import from_features
from slam.replay import Track
from slam.shunting.featured import PAPER_REWARD, FeaturedShuntingSlam
from slam.shunting.map.peaks import peaks
from slam.shunting.slam import ShuntingConfig
from slam.tracker.matching.matcher import Match
from slam.tracker.network import Network
from slam.tracker.rasterise import rasterise
from slam.trajectory import Trajectory

pytestmark = pytest.mark.slow


def network_of(points: np.ndarray, **options: float) -> Network:
    config = ShuntingConfig(cell_m=0.1, **options)
    network = Network(config)
    covariances = np.repeat(1e-4 * np.eye(2)[None], len(points), axis=0)
    features = Features(stamp_ns=0, points_robot=points, covariances=covariances)
    seen = from_features(features, config)
    rasterise(network, seen, np.zeros(3))
    network.integrate(seen.view, np.zeros(3), 1.0, write=True)
    return network


@pytest.mark.parametrize("trace_s", [0.0, 3.0])
def test_peaks_lie_between_neurons_where_the_points_were(trace_s):
    """The Gaussians are exact up to the threshold: a hundredth of a neuron."""
    rng = np.random.default_rng(0)
    points = np.stack([np.arange(-4.0, 4.0), rng.uniform(-5.0, 5.0, 8)], axis=1)
    points += rng.uniform(-0.05, 0.05, points.shape)
    there = peaks(network_of(points, trace_s=trace_s), 0.05)
    found = there.points_map
    assert len(found) == len(points)
    assert (there.heights > 0.05).all()
    order = np.argsort(found[:, 0])
    # the short-term activity I / (A + I) is flatter on top than I, so a little off a Gaussian
    np.testing.assert_allclose(found[order], points, atol=0.005)


def test_peaks_beyond_reach_and_below_the_least_are_left_out():
    points = np.array([[1.0, 0.0], [30.0, 0.0]])
    network = network_of(points)
    near = peaks(network, 0.05, centre=np.zeros(2), reach_m=5.0)
    np.testing.assert_allclose(near.points_map, points[:1], atol=0.01)
    assert len(peaks(network, 1.0).heights) == 0


def test_a_peak_is_as_wide_as_what_was_seen_and_as_old_as_it_was_looked_at():
    c, s = np.cos(0.5), np.sin(0.5)
    turn = np.array([[c, -s], [s, c]])
    told = turn @ np.diag([0.12**2, 0.02**2]) @ turn.T
    config = ShuntingConfig(cell_m=0.05, short_term_weight=0.0)  # its bell is flatter on top
    network, at = Network(config), np.array([[3.01, 1.02]])
    features = Features(stamp_ns=0, points_robot=at, covariances=told[None])
    for _ in range(4):
        rasterise(network, from_features(features, config), np.zeros(3))
        seen = from_features(features, config)
        network.integrate(seen.view, np.zeros(3), 0.5, write=True)
    there = peaks(network, 0.05)
    np.testing.assert_allclose(there.spreads[0], told, atol=3e-4)
    assert np.linalg.eigvalsh(there.spreads[0])[0] >= 0.0
    np.testing.assert_allclose(there.ages_s, 2.0, atol=1e-5)


def rmse(world: PointWorldConfig, seed: int, cell_m: float) -> float:
    """Of the online positions, m, unaligned."""
    frames = list(PointWorld(world, seed=seed).stream())
    track = Track(
        name="",
        system=create("shunting-features", cell_m=cell_m, range_m=12.5, carried_per_h=0.0),
    )
    for frame in frames:
        track.take(frame.without_truth())
    truth = Trajectory(
        stamps_ns=np.array([f.stamp_ns for f in frames]), poses=np.array([f.truth for f in frames])
    )
    return metrics.ate(track.online(), truth).value


@pytest.mark.parametrize("moving", [0.0, 0.5])
def test_it_localises_among_moving_points(moving):
    """Odometry alone is metres off; half of the points walk about."""
    assert rmse(PointWorldConfig(moving=moving, n_steps=80), seed=4, cell_m=0.03) < 0.05


def test_options_are_those_of_the_preset():
    system = create("shunting-features", config="paper", cell_m=0.05)
    assert system.config == ShuntingConfig.paper(cell_m=0.05, reward=PAPER_REWARD)
    assert create("shunting-features", config="paper", reward=0.3).config == ShuntingConfig.paper()
    with pytest.raises(InvalidValueError, match="nonsense"):
        create("shunting-features", nonsense=1)
    with pytest.raises(InvalidValueError, match="other"):
        create("shunting-features", config="other", cell_m=0.05)


def test_peaks_that_were_seen_once_do_not_lead_astray():
    """Half of the points walk and leave peaks behind; with all peaks alike this run was lost."""
    assert rmse(PointWorldConfig(moving=0.5), seed=8, cell_m=0.01) < 0.05


class Seen(FeaturedShuntingSlam):
    """Keeps what its matches said."""

    matches: list[Match]

    def _match(self, observations, prediction, cell_map):
        match = super()._match(observations, prediction, cell_map)
        self.matches.append(match)
        return match


def test_a_match_informs_by_what_the_covariances_of_points_say():
    """Three points, seen twice from one place: information = sum of J' inv(R + P) J."""
    cell, sd = 0.01, 0.02
    points = np.array([[4.0, 1.0], [1.0, -5.0], [-3.0, 2.0]])
    covariances = np.repeat(sd**2 * np.eye(2)[None], 3, axis=0)
    # without the short-term activity, whose bell is flatter on top, so looks wider
    system = Seen(cell_m=cell, range_m=12.5, carried_per_h=0.0, short_term_weight=0.0)
    system.matches = []
    for k in range(2):
        stamp_ns = k * 10**9
        features = Features(stamp_ns=stamp_ns, points_robot=points, covariances=covariances)
        odometry = Odometry(
            stamp_ns=stamp_ns, T_odom_robot=np.zeros(3), increment_covariance=0.01 * np.eye(3)
        )
        system.update(Frame(stamp_ns=stamp_ns, odometry=odometry, features=features))
    expected = np.zeros((3, 3))
    for x, y in points:
        J = np.array([[1.0, 0.0, -y], [0.0, 1.0, x]])
        expected += J.T @ J / (2.0 * sd**2 + (0.15 * cell) ** 2)
    np.testing.assert_allclose(system.matches[0].information, expected, rtol=0.02, atol=20.0)
    np.testing.assert_allclose(system.matches[0].T_map_robot, 0.0, atol=1e-3)


def test_odometry_is_never_trusted_more_than_it_states_beside_points():
    """What points get wrong stays the same from frame to frame, so odometry looks too good."""
    frames = list(PointWorld(PointWorldConfig(n_steps=80), seed=1).stream())
    system = FeaturedShuntingSlam(cell_m=0.01, range_m=12.5, carried_per_h=0.0)
    for frame in frames:
        system.update(frame.without_truth())
        assert (system._odometry_noise.scales >= 1.0).all()
    assert system._odometry_noise.bias is None


def poses_of(frames: list[Frame], **options: Any) -> np.ndarray:
    system = create("shunting-features", cell_m=0.03, range_m=12.5, **options)
    return np.array([system.update(f.without_truth()).T_map_robot for f in frames])


def test_the_papers_preset_climbs_the_logarithms_of_eq_13():
    """Its objective and the weight of a logarithm tell; for least squares neither is there."""
    frames = list(PointWorld(PointWorldConfig(n_steps=20), seed=2).stream())
    printed = poses_of(frames, config="paper")
    assert not np.array_equal(printed, poses_of(frames, config="paper", reward=1.0))
    assert not np.array_equal(printed, poses_of(frames, config="paper", objective="sum"))
    T_first_world = se2.inverse(frames[0].truth)
    truth = np.array([se2.compose(T_first_world, f.truth) for f in frames])
    assert np.hypot(*(printed - truth)[:, :2].T).max() < 0.15


def test_corners_of_scans_are_paired_by_the_gates_that_the_ekf_has_for_them():
    spec = LaserSpec(n_beams=181, angle_min=-np.pi / 2, angle_increment=np.pi / 180)
    scan = Scan(stamp_ns=0, ranges=np.full(181, 3.0, np.float32), spec=spec)
    odometry = Odometry(stamp_ns=0, T_odom_robot=np.zeros(3))
    system = FeaturedShuntingSlam()
    assert system._gates == EkfConfig().gates
    system.update(Frame(stamp_ns=0, odometry=odometry, scan=scan))
    assert system._gates == EkfConfig.corners().gates
    system.reset()
    assert system._gates == EkfConfig().gates


@pytest.mark.parametrize("every_s", [0.027, 0.2, 1.0, 10.0])
def test_a_look_is_a_look_at_any_rate(every_s):
    """The first frame acts for a second, and none for more than three; each is one look."""
    points = np.array([[4.0, 1.0], [1.0, -5.0], [-3.0, 2.0]])
    covariances = np.repeat(0.02**2 * np.eye(2)[None], 3, axis=0)
    system = Counting(cell_m=0.02, range_m=12.5, carried_per_h=0.0, short_term_weight=0.0)
    for k in range(4):
        stamp_ns = round(k * every_s * 1e9)
        features = Features(stamp_ns=stamp_ns, points_robot=points, covariances=covariances)
        odometry = Odometry(
            stamp_ns=stamp_ns, T_odom_robot=np.zeros(3), increment_covariance=0.01 * np.eye(3)
        )
        system.update(Frame(stamp_ns=stamp_ns, odometry=odometry, features=features))
        if k > 0:
            np.testing.assert_allclose(system.looks, k, rtol=0.02)


class Counting(FeaturedShuntingSlam):
    """Keeps how often the peaks were looked at before a frame."""

    looks: np.ndarray

    def _places(self, marks, looks):
        self.looks = looks
        return super()._places(marks, looks)


@pytest.mark.parametrize(
    ("config", "options"),
    [(ShuntingConfig.paper(), {"reward": 9.0}), (3, {}), (ShuntingConfig(), {"nonsense": 1})],
)
def test_options_beside_a_configuration_and_other_things_are_refused(config, options):
    with pytest.raises(InvalidValueError, match="FeaturedShuntingSlam takes"):
        FeaturedShuntingSlam(config, **options)

# SPDX-License-Identifier: Apache-2.0
"""The protocol, its registry, estimates and rasters; and the null system, odometry."""

import math

import numpy as np
import pytest

import slam
from slam import Estimate, Frame, Odometry, Raster, SlamSystem, se2, system
from slam.errors import InvalidValueError, UnknownNameError, UntrustedNameError
from slam.names import NameFromFile


class Minimal:
    """A user's own SLAM."""

    def __init__(self, *, gain: float = 1.0) -> None:
        self.gain = gain

    def reset(self): ...

    def update(self, frame): ...

    def map(self): ...

    def trajectory(self): ...


class Unfinished:
    def reset(self): ...


def test_systems_are_made_by_name_and_by_entry(monkeypatch):
    monkeypatch.setattr(system, "_registry", dict(system._registry))
    assert isinstance(slam.create("odometry"), SlamSystem)
    slam.register("mine")(Minimal)
    assert slam.create("mine", gain=2.0).gain == 2.0
    assert "mine" in slam.names() == sorted(slam.names())
    assert isinstance(slam.create("slam.odometry:OdometrySlam"), SlamSystem)


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("odometri", "Did you mean 'odometry'"),
        ("zzz", "Known: .*odometry.*module:Class"),
        ("no.such.module:Slam", "cannot import 'no.such.module'"),
        (":Slam", "cannot import ''"),
        (".relative:Slam", "cannot import '.relative'"),
        ("slam.odometry:", "has no ''"),
        ("slam.odometry:Nothing", "has no 'Nothing'"),
        ("math:pi", "no class or function"),
        ("collections:OrderedDict", "has no reset, map, trajectory"),
    ],
)
def test_names_that_are_none_say_what_to_do(name, message):
    with pytest.raises(UnknownNameError, match=message):
        slam.create(name)


def test_prefixed_names_are_made_by_whoever_registered_the_prefix(monkeypatch):
    monkeypatch.setattr(system, "_prefixes", dict(system._prefixes))
    rests = []

    @system.register_prefix("mine:")
    def make(rest, *, gain=1.0):
        rests.append(rest)
        return Minimal(gain=gain)

    assert slam.create("mine:a:b c", gain=2.0).gain == 2.0
    assert rests == ["a:b c"]
    with pytest.raises(UntrustedNameError, match=r"a\.json names code"):
        slam.create(NameFromFile("mine:a", "a.json"))
    with pytest.raises(InvalidValueError, match="must end in ':', got 'mine'"):
        system.register_prefix("mine")
    assert rests == ["a:b c"]


def test_half_a_system_and_unknown_options_are_refused(monkeypatch):
    monkeypatch.setattr(system, "_registry", {"half": Unfinished, "whole": Minimal})
    with pytest.raises(UnknownNameError, match="has no update, map, trajectory"):
        slam.create("half")
    with pytest.raises(InvalidValueError, match=r"'whole': .*unexpected.*'gian'"):
        slam.create("whole", gian=2.0)


def test_estimates_are_validated():
    good = {"stamp_ns": 1, "T_map_robot": [1.0, 2.0, 3.0], "covariance": np.eye(3)}
    assert Estimate(**good).converged
    for changes in (
        {"T_map_robot": [math.nan, 0.0, 0.0]},
        {"covariance": np.eye(2)},
        {"covariance": -np.eye(3)},
        {"covariance": np.full((3, 3), math.inf)},
    ):
        with pytest.raises(InvalidValueError, match=next(iter(changes))):
            Estimate(**{**good, **changes})
    with pytest.raises(ValueError, match="read-only"):
        Estimate(**good).T_map_robot[0] = 0.0


def test_rasters_are_validated():
    good = {"values": [[0.0, np.nan], [0.5, 1.0]], "resolution_m": 0.05, "T_map_origin": [0, 0, 0]}
    assert Raster(**good).values.dtype == np.float32
    for changes in (
        {"values": [[0.0, 1.1]]},
        {"values": [[-0.1, 1.0]]},
        {"values": [[math.inf, 1.0]]},
        {"values": [0.0, 1.0]},
        {"resolution_m": 0.0},
        {"resolution_m": math.nan},
        {"resolution_m": math.inf},
        {"T_map_origin": [0.0, 0.0]},
    ):
        with pytest.raises(InvalidValueError, match=next(iter(changes))):
            Raster(**{**good, **changes})


def frames(increments, start=(5.0, -2.0, 2.0), covariance=None):
    T_odom_robot = np.array(start)
    out = []
    for k, increment in enumerate([se2.IDENTITY, *increments]):
        T_odom_robot = se2.compose(T_odom_robot, increment)
        odometry = Odometry(stamp_ns=k, T_odom_robot=T_odom_robot, increment_covariance=covariance)
        out.append(Frame(stamp_ns=k, odometry=odometry))
    return out


def test_odometry_starts_at_the_origin_and_chains():
    null = slam.create("odometry")
    increments = [np.array([0.5, 0.0, 0.3]), np.array([0.2, 0.1, -0.1])]
    estimates = [null.update(frame) for frame in frames(increments)]
    np.testing.assert_allclose(estimates[0].T_map_robot, 0.0, atol=1e-12)
    np.testing.assert_allclose(estimates[1].T_map_robot, increments[0], atol=1e-12)
    expected = se2.compose(increments[0], increments[1])
    np.testing.assert_allclose(estimates[2].T_map_robot, expected, atol=1e-12)
    np.testing.assert_array_equal(estimates[2].covariance, 0.0)
    assert null.map() is None
    online = [e.T_map_robot for e in estimates]
    np.testing.assert_array_equal(null.trajectory().poses, online)
    null.reset()
    assert len(null.trajectory()) == 0


def test_odometry_sums_its_covariance_as_sampling_does():
    rng = np.random.default_rng(11)
    increments = [np.array([0.5, 0.0, 0.2])] * 8
    Q = np.diag([1e-4, 5e-5, 2e-5])
    null = slam.create("odometry")
    for frame in frames(increments, covariance=Q):
        estimate = null.update(frame)
    samples = []
    for _ in range(3000):
        T = se2.IDENTITY
        for noise in rng.multivariate_normal(np.zeros(3), Q, size=len(increments)):
            T = se2.compose(T, increments[0] + noise)
        samples.append(T)
    sampled = np.cov(np.array(samples).T)
    np.testing.assert_allclose(estimate.covariance, sampled, atol=0.08 * sampled.max())

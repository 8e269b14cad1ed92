# SPDX-License-Identifier: Apache-2.0
"""Section 3.3: what a scan may clear, and what it must leave alone."""

import math

import numba
import numpy as np
import pytest
from numpy.typing import NDArray

from slam import se2
from slam.frames import Features, Scan
from slam.frontend.observations import Observations, from_features, from_scan
from slam.frontend.visibility import SILENT_M, View, free_around, view_of_beams
from slam.shunting.slam import ShuntingConfig
from slam.tracker.network import Network
from slam.tracker.rasterise import rasterise
from tests.world2d import World2D, laser, rectangle

Array = NDArray[np.float64]
CONFIG = ShuntingConfig(cell_m=0.05)
HALL = World2D(rectangle(-3.0, -1.0, 25.0, 1.03))  # long walls, seen at ever smaller angles


@numba.njit
def _free_around(view: View, x: float, y: float, half: float) -> float:
    return free_around(view, x, y, half)


def seen_from(pose: Array, n_beams: int) -> Observations:
    spec = laser(n_beams)
    poses = np.tile(se2.compose(pose, spec.T_robot_laser), (n_beams, 1))
    ranges = HALL.ranges(0.0, poses, spec.angles, 80.0)
    scan = Scan(stamp_ns=0, ranges=ranges.astype(np.float32), spec=spec)
    return from_scan(scan, np.zeros(3), CONFIG)


def look(network: Network, seen: Observations, pose: Array, *, write: bool) -> tuple[float, float]:
    rasterise(network, seen, pose)
    T_map_laser = se2.compose(pose, seen.T_robot_laser)
    look = network.integrate(seen.view, T_map_laser, 0.2, write=write)
    network.release()
    return look.confirmed, look.contradicted


@pytest.mark.parametrize("n_beams", [181, 361])
def test_walls_seen_at_a_grazing_angle_are_not_worn_away(n_beams: int) -> None:
    """A mapped hall, looked at from other places: next to nothing of it is called empty."""
    network = Network(CONFIG)
    for x in np.arange(0.0, 20.0, 0.25):
        for _ in range(3):
            look(network, seen_from(np.array([x, 0.0, 0.0]), n_beams), np.array([x, 0.0, 0.0]),
                 write=True)  # fmt: skip
    rng = np.random.default_rng(4)
    for _ in range(20):
        pose = rng.uniform([0.0, -0.8, -0.4], [15.0, 0.8, 0.4])
        confirmed, contradicted = look(network, seen_from(pose, n_beams), pose, write=False)
        assert contradicted < 0.03 * confirmed
    x, y = network.window(6.0, 0.9, 18.0, 1.1)  # the wall 1 m aside, up to 3 degrees
    before = (x.max(axis=0), y.max(axis=0))
    for _ in range(25):
        pose = np.array([5.0, 0.9, 0.0])  # almost along it: 6 m further the angle is 1.2 degrees
        look(network, seen_from(pose, n_beams), pose, write=True)
    x, y = network.window(6.0, 0.9, 18.0, 1.1)
    assert (x.max(axis=0) > 0.5 * before[0]).mean() > 0.97
    assert (y.max(axis=0) > 0.5 * before[1]).mean() > 0.97


def scan_of(ranges: Array) -> Scan:
    return Scan(stamp_ns=0, ranges=ranges.astype(np.float32), spec=laser(len(ranges)))


def cleared(ranges: Array, at: Array) -> NDArray[np.bool_]:
    """Which of the things at (n, 2) m, seen before, the scan calls empty."""
    network = Network(CONFIG)
    points = Features(
        stamp_ns=0, points_robot=at, covariances=np.tile(1e-4 * np.eye(2), (len(at), 1, 1))
    )
    rasterise(network, from_features(points, CONFIG), np.zeros(3))
    blind = View(math.tau / 8, np.zeros(8), np.zeros(8), 50.0, 0.0, math.inf)
    network.integrate(blind, np.zeros(3), 1.0, write=True)
    before = [float(network.window(*p, *p)[0].sum()) for p in at]
    seen = from_scan(scan_of(ranges), np.zeros(3), CONFIG)
    T_map_laser = seen.T_robot_laser
    for _ in range(5):
        network.integrate(seen.view, T_map_laser, 1.0, write=True)
    after = [float(network.window(*p, *p)[0].sum()) for p in at]
    assert min(before) > 0.0
    return np.array(after) < 0.5 * np.array(before)


def things(distances: list[float], bearing_deg: float = 20.0) -> Array:
    """Neuron centres nearest to these distances from the laser along a bearing."""
    laser_x = float(laser(361).T_robot_laser[0])
    angle = math.radians(bearing_deg)
    points = [(laser_x + d * math.cos(angle), d * math.sin(angle)) for d in distances]
    return np.array([[(math.floor(v / 0.05) + 0.5) * 0.05 for v in p] for p in points])


def test_a_return_clears_what_is_before_it_and_not_what_is_at_or_behind_it() -> None:
    ranges = np.full(361, 6.0)
    assert cleared(ranges, things([1.5, 5.0, 6.0, 8.0])).tolist() == [True, True, False, False]


def test_an_error_code_clears_nothing() -> None:
    assert not cleared(np.full(361, np.nan), things([1.5, 5.0, 20.0])).any()


def test_no_return_clears_up_to_where_silence_means_something() -> None:
    ranges = np.full(361, np.inf)
    far = SILENT_M
    found = cleared(ranges, things([1.0, 1.5, far + 2.0]))
    assert found.tolist() == [True, True, False]


def test_one_silent_beam_among_errors_clears_its_own_line_only() -> None:
    ranges = np.full(361, np.nan)
    beam = 2 * (90 + 20)  # 0.5 degrees each, the first at -90
    ranges[beam - 1 : beam + 2] = np.inf
    assert cleared(ranges, things([1.5, 2.0])).all()
    assert not cleared(ranges, things([1.5, 2.0], bearing_deg=30.0)).any()


def test_the_cost_is_that_of_the_neurons_in_view() -> None:
    """A wall before the robot: what is mapped behind it is not even visited."""
    network = Network(CONFIG)
    look(network, seen_from(np.zeros(3), 361), np.zeros(3), write=True)
    near = from_scan(scan_of(np.full(361, 0.6)), np.zeros(3), CONFIG)
    visited = network.integrate(near.view, near.T_robot_laser, 0.2, write=False).visited
    seen = seen_from(np.zeros(3), 361)
    whole = network.integrate(seen.view, seen.T_robot_laser, 0.2, write=False).visited
    assert visited == 0
    assert whole > 0


def test_no_place_within_a_block_has_a_longer_free_range_than_is_told() -> None:
    rng = np.random.default_rng(5)
    bearings = np.arange(720) * math.tau / 720
    view = view_of_beams(bearings, rng.uniform(0.5, 8.0, 720), math.tau / 720, 0.05)
    for _ in range(2000):
        x, y = rng.uniform(-9.0, 9.0, 2)
        half = float(rng.uniform(0.05, 0.5))
        way = float(rng.uniform(-math.pi, math.pi))
        px, py = x + half * math.cos(way), y + half * math.sin(way)
        k = math.floor(math.atan2(py, px) / view.step + 0.5) % len(view.limit)
        free = _free_around(view, x, y, half)
        if math.hypot(px, py) < view.limit[k]:
            assert free >= view.limit[k]
            assert free > math.hypot(x, y) - half - 1e-12
        assert free <= view.farthest

# SPDX-License-Identifier: Apache-2.0
"""The LMS-221 against its data sheet, and its timing against closed forms."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from sim.sensors.lidar.device import LaserScanner, ScanResult
from sim.sensors.lidar.models.lms221 import Lms221Config
from slam.errors import InvalidValueError

TURN = 1.0 / 75.0


def scan(
    room: SimpleNamespace,
    config: Lms221Config,
    *,
    seed: int = 0,
    twist: tuple[float, float, float] = (0.0, 0.0, 0.0),
    world: str | None = None,
) -> tuple[ScanResult, LaserScanner]:
    model, data = room.build(room.SQUARE if world is None else world)
    lidar = LaserScanner(model, config, np.random.default_rng(seed))
    return lidar.observe(room.stepper(model, data, twist), data), lidar


@pytest.mark.parametrize(
    ("resolution", "beams"), [(1.0, [181]), (0.5, [181, 180]), (0.25, [181, 180, 180, 180])]
)
def test_a_scan_interlaces_turns_of_whole_degrees(resolution: float, beams: list[int]) -> None:
    config = Lms221Config(resolution_deg=resolution)
    turn, degrees = config.scanner().turn_of, resolution * np.arange(sum(beams))
    assert np.bincount(turn).tolist() == beams
    for k in range(len(beams)):
        np.testing.assert_allclose(degrees[turn == k], k * resolution + np.arange(beams[k]))
    times = config.spec().beam_time_offsets
    np.testing.assert_allclose(times, (turn + degrees / 360.0) * TURN, atol=1e-9)
    assert np.diff(times[turn == 0]) == pytest.approx(37.0e-6, abs=0.1e-6)


def test_the_stamp_of_a_100_degree_scan_is_40_degrees_of_mirror_after_the_turn_begins() -> None:
    assert Lms221Config(fov_deg=180).stamp_offset_ns == 0
    assert Lms221Config(fov_deg=100).stamp_offset_ns == round(40 / 360 / 75 * 1e9)


@pytest.mark.parametrize("resolution", [1.0, 0.5, 0.25])
@pytest.mark.parametrize("fov", [180, 100])
def test_a_moving_robot_smears_the_wall_as_computed(room, resolution, fov):
    config = Lms221Config.ideal(resolution_deg=resolution, fov_deg=fov)
    speed, omega = 0.8, 1.2
    result, lidar = scan(room, config, twist=(speed, 0.0, omega))
    time = lidar.spec.beam_time_offsets + config.stamp_offset_ns * 1e-9
    heading = omega * time
    bearing = heading + lidar.spec.angles
    ahead = np.abs(bearing) < math.radians(40.0)
    want = (4.0 - speed * time - 0.02 * np.cos(heading)) / np.cos(bearing)
    np.testing.assert_allclose(result.true_ranges[ahead], want[ahead], atol=2e-6)
    still, _ = scan(room, config)
    assert np.abs(result.true_ranges - still.true_ranges)[ahead].max() > 0.004


def test_the_mounting_and_the_incidence_are_those_of_the_model(room: SimpleNamespace) -> None:
    result, lidar = scan(room, Lms221Config.ideal())
    np.testing.assert_allclose(lidar.spec.T_robot_laser, (0.02, 0.0, 0.0), atol=1e-12)
    ahead = np.abs(lidar.spec.angles) < math.radians(40.0)
    np.testing.assert_allclose(result.incidence[ahead], np.abs(lidar.spec.angles[ahead]), atol=1e-6)
    assert set(result.bodies.tolist()) == {0}


@pytest.mark.parametrize(("mode", "unit"), [("8m", 0.001), ("32m", 0.001), ("80m", 0.01)])
def test_ranges_lie_on_the_grid_of_the_mode(room: SimpleNamespace, mode: str, unit: float) -> None:
    result, _ = scan(room, Lms221Config.noise_only(range_mode=mode))
    codes = result.ranges.astype(np.float64) / unit
    np.testing.assert_allclose(codes, np.rint(codes), atol=1e-3)
    assert len(np.unique(result.ranges)) > 20


def test_nothing_and_too_far_are_no_return(room: SimpleNamespace) -> None:
    """A wall at 12 m is beyond the 8 m mode, within the 16 m mode; behind it there is nothing."""
    far = room.wall(12.1, 0.0, 0.1, 1.0)
    for mode, seen in (("8m", False), ("16m", True), ("80m", True)):
        result, lidar = scan(room, Lms221Config.noise_only(range_mode=mode), world=far)
        assert np.isfinite(result.ranges[180]) == seen
        assert result.ranges[0] == np.inf
        assert result.geoms[0] == -1
        assert result.bodies[0] == -1
        assert np.isnan(result.incidence[0])
        assert math.isfinite(result.true_ranges[180])
        assert np.nanmax(result.ranges[np.isfinite(result.ranges)], initial=0.0) <= (
            lidar.spec.range_max
        )


def test_draws_do_not_depend_on_what_is_hit(room: SimpleNamespace) -> None:
    states = []
    for world in (room.SQUARE, "", room.wall(2.0, 0.0, 0.1, 0.1)):
        model, data = room.build(world)
        lidar = LaserScanner(model, Lms221Config(), np.random.default_rng(9))
        lidar.observe(room.stepper(model, data), data)
        states.append([stream.bit_generator.state for stream in lidar.streams])
    assert states[0] == states[1] == states[2]


def test_a_model_with_another_timestep_or_without_the_site_is_refused(room: SimpleNamespace):
    model, _ = room.build()
    with pytest.raises(InvalidValueError, match="no site 'roof'"):
        LaserScanner(model, site="roof")
    model.opt.timestep = 0.002
    with pytest.raises(InvalidValueError, match="expected 1/300 s"):
        LaserScanner(model)

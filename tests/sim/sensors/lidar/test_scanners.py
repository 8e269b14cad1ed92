# SPDX-License-Identifier: Apache-2.0
"""Scanner models: data sheets, beam times against closed forms, names, files from outside."""

import importlib
import math
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from sim.sensors.lidar import registry
from sim.sensors.lidar.device import LaserScanner
from sim.sensors.lidar.models.lms221 import Lms221Config
from sim.sensors.lidar.registry import scanner_of, written
from sim.sensors.lidar.scanner import Scanner
from sim.simulation import Simulation, stream, tour
from slam.errors import InvalidValueError, UnknownNameError
from slam.frames import Frame

GENERIC = "scanner(fov_deg=200, beams=401, rate_hz=33.3, sigma_m=0.02)"
MODELS = ("utm30lx", "tim561", "rplidar_a1", GENERIC)


def turning(
    room: SimpleNamespace, model: Scanner, omega: float, scans: int
) -> tuple[LaserScanner, list[np.ndarray]]:
    """Ideal scans of a square room by a robot that turns on the spot."""
    world, data = room.build()
    lidar = LaserScanner(world, model.only("ideal"))
    advance = room.stepper(world, data, (0.0, 0.0, omega))
    return lidar, [lidar.observe(advance, data).true_ranges for _ in range(scans)]


@pytest.mark.parametrize("name", MODELS)
def test_bearings_on_a_turning_robot_are_those_of_each_beams_own_time(room, name):
    """The walls are at 4 m; the laser is 2 cm ahead of the axis. A scan begins k / rate after the
    first, also between two physics steps."""
    model, omega = scanner_of(name).scanner(), 1.2
    lidar, scans = turning(room, model, omega, 9)
    for k, ranges in enumerate(scans):
        heading = omega * (k * float(model.period_s) + lidar.spec.beam_time_offsets)
        bearing = heading + lidar.spec.angles
        x, y = 0.02 * np.cos(heading), 0.02 * np.sin(heading)
        c, s = np.cos(bearing), np.sin(bearing)
        with np.errstate(divide="ignore"):
            wanted = np.minimum(
                (4.0 - np.sign(c) * x) / np.abs(c), (4.0 - np.sign(s) * y) / np.abs(s)
            )
        np.testing.assert_allclose(ranges, wanted, atol=3e-6)
    still = (0.02 * np.ones(1), scans[0][:1])
    assert abs(still[1][0] - scans[1][0]) > 1e-3  # the robot does turn


@pytest.mark.parametrize(
    ("name", "steps"),
    [
        ("utm30lx", [8, 15, 23, 30]),  # 40 Hz: seven and a half each
        ("lms221(resolution_deg=1)", [4, 8, 12, 16]),  # a turn of the mirror
        ("lms221", [8, 16, 24, 32]),
        ("lms221(resolution_deg=0.25)", [16, 32, 48, 64]),
    ],
)
def test_a_scan_ends_with_the_step_of_its_last_beam(room, name, steps):
    world, data = room.build()
    lidar = LaserScanner(world, f"{name}:ideal")
    advance = room.stepper(world, data)
    ends = []
    for _ in range(4):
        lidar.observe(advance, data)
        ends.append(round(data.time * 300.0))
    assert ends == steps


def driven(laser: str, scans: int) -> tuple[list[Frame], list[np.ndarray]]:
    """Frames of one command, and the robot's true path by physics steps, scan by scan."""
    simulation = Simulation("arena", seed=2, dynamism=0.0, laser=laser, odometry="ideal")
    simulation.world.set_command(0.4, 0.6)
    frames, path = [], []
    for _ in range(scans):
        frames.append(simulation.observe())
        path.append(simulation.path.copy())
    return frames, path


@pytest.mark.parametrize(("name", "rate_hz"), [("utm30lx", 40), ("rplidar_a1", 5.5)])
def test_stamps_are_exact_and_truth_and_odometry_are_at_them(name: str, rate_hz: float) -> None:
    """Against the LMS-221 at 1 degree, whose scans of 4 steps show every step of the world."""
    reference, path = driven("lms221(resolution_deg=1)", 75)
    steps = np.concatenate([path[0][:1], *(part[1:] for part in path)])
    wheels = np.array([frame.odometry.T_odom_robot for frame in reference])
    for k, frame in enumerate(driven(name, round(0.9 * rate_hz))[0]):
        assert frame.stamp_ns == round(k * 1e9 / rate_hz)
        at = frame.stamp_ns * 1e-9 * 300.0
        for axis in range(3):
            true = np.interp(at, np.arange(len(steps)), steps[:, axis])
            assert frame.truth is not None
            assert frame.truth[axis] == pytest.approx(true, abs=1e-6)
            told = np.interp(at, 4.0 * np.arange(len(wheels)), wheels[:, axis])
            assert frame.odometry.T_odom_robot[axis] == pytest.approx(told, abs=1e-3)


def test_too_near_is_an_error_and_too_far_is_nothing(room: SimpleNamespace) -> None:
    near = room.wall(0.21, 0.0, 0.1, 0.1) + room.wall(-32.0, 0.0, 0.1, 40.0)
    world, data = room.build(near)
    result = LaserScanner(world, "utm30lx:noise").observe(room.stepper(world, data), data)
    assert math.isnan(result.ranges[540])  # 9 cm ahead
    assert result.ranges[0] == np.inf  # behind, more than 30 m
    assert math.isfinite(result.true_ranges[0])


def same(ours: Frame, theirs: Frame) -> bool:
    assert ours.scan is not None
    assert theirs.scan is not None
    return bool(
        ours.stamp_ns == theirs.stamp_ns
        and ours.scan.ranges.tobytes() == theirs.scan.ranges.tobytes()
        and np.array_equal(ours.truth, theirs.truth)
        and np.array_equal(ours.odometry.T_odom_robot, theirs.odometry.T_odom_robot)
    )


@pytest.mark.parametrize("name", MODELS)
def test_a_saved_run_goes_on_bit_for_bit(name: str) -> None:
    settings = {"seed": 4, "dynamism": 1.0, "laser": name, "labels": True}
    run = Simulation("arena", **settings)
    for k, _ in enumerate(tour(run, 2.0)):
        if k == 2:
            break
    saved = run.save_state()
    wanted = [run.observe() for _ in range(4)]
    fresh = Simulation("arena", **settings)
    fresh.load_state(saved)
    assert all(map(same, wanted, (fresh.observe() for _ in range(4))))
    with pytest.raises(InvalidValueError, match=r"the state is of scanner '.*', expected 'lms221'"):
        Simulation("arena", seed=4, dynamism=1.0).load_state(saved)


def test_a_robot_that_is_put_elsewhere_is_seen_there_at_once(room: SimpleNamespace) -> None:
    """Not drawn out over the step within which the next scan should have begun."""
    world, data = room.build()
    lidar = LaserScanner(world, "utm30lx:ideal")
    advance = room.stepper(world, data)
    lidar.observe(advance, data)
    data.qpos[0] = 1.0
    room.stepper(world, data)()
    result = lidar.observe(advance, data)
    assert result.true_ranges[540] == pytest.approx(2.98)
    assert result.true_ranges[0] == pytest.approx(4.0 / math.sin(math.radians(45.0)))


def test_errors_can_be_named_with_any_scanner() -> None:
    assert scanner_of("noise") == scanner_of("lms221:noise") == Lms221Config.noise_only()
    assert scanner_of("ideal") == Lms221Config.ideal()
    assert scanner_of(None) == scanner_of("full") == scanner_of("lms221") == Lms221Config()
    assert scanner_of("lms221(resolution_deg=0.25, fov_deg=100)") == Lms221Config(
        resolution_deg=0.25, fov_deg=100
    )
    bare = scanner_of("utm30lx:ideal").scanner()
    assert (bare.noise, bare.systematic, bare.unit_m, bare.glass) == ((), (), 0.0, False)
    assert scanner_of("utm30lx:noise").scanner().noise == scanner_of("utm30lx").scanner().noise


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("utm30", "Did you mean 'utm30lx'.*Known: lms221, .*tim561"),
        ("os:system", "no scanner is called 'os'"),
        ("my_package.module:scanner", "no scanner is called"),
        ("utm30lx:perfect", "errors must be full, noise, ideal"),
        ("utm30lx(fov_deg=90)", "no setting 'fov_deg'; it has none"),
        ("scanner(fov_deg=90)", "needs beams=..., rate_hz=..., sigma_m=..."),
        ("scanner(fov_deg=400, beams=10, rate_hz=10, sigma_m=0)", "fov_deg must be > 0 and at"),
        ("scanner(fov_deg=90, beams=1e9, rate_hz=10, sigma_m=0)", "beams must be a whole number"),
        ("x" * 300, "no scanner is called"),
    ],
)
def test_what_is_no_scanner_is_refused_with_what_there_is(text: str, message: str) -> None:
    with pytest.raises((UnknownNameError, InvalidValueError), match=message):
        scanner_of(text)


PAGE = Path(__file__).parents[4] / "docs" / "extending.md"


@pytest.mark.parametrize(
    ("text", "settings", "name"),
    [
        ("full", {}, "full"),
        ("noise", {"range_mode": "8m"}, "lms221(range_mode=8m):noise"),
        ("lms221(range_mode=8m)", {"resolution_deg": 1.0},
         "lms221(range_mode=8m, resolution_deg=1.0)"),
    ],
)  # fmt: skip
def test_settings_are_written_into_a_name(text: str, settings: dict, name: str) -> None:
    assert written(text, **settings) == name
    assert scanner_of(name) == scanner_of(text, **settings)


def test_a_model_from_a_folder_outside_simulates(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """The file that the page shows, and the same with beams that are all measured at once."""
    code = PAGE.read_text().split("## Scanner\n")[1].split("```python\n")[1].split("```")[0]
    flash = "range_max_m=20.0, beam_times_s=(0.5 / rate_hz,) * 181,"
    for name, text in (
        ("lab_lidar", code),
        ("lab_flash", code.replace("lab_lidar", "lab_flash").replace("range_max_m=20.0,", flash)),
    ):
        (tmp_path / f"{name}.py").write_text(text)
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setattr(registry, "_models", dict(registry._models))
    for name, stamps_ns, sweep_s in (
        ("lab_lidar", [0, 83_333_333], 90.0 / 360.0 / 12.0),
        ("lab_flash", [41_666_667, 125_000_000], 0.0),
    ):
        importlib.import_module(name)
        assert registry.describe(name).startswith("A scanner of ours")
        frames = list(stream("arena", seed=1, dynamism=1.0, seconds=1.0, laser=f"{name}:noise"))
        assert [frame.stamp_ns for frame in frames[:2]] == stamps_ns
        assert frames[-1].scan is not None
        assert frames[-1].scan.spec.n_beams == 181
        assert frames[-1].scan.valid.any()
        assert frames[-1].scan.spec.sweep_duration == pytest.approx(sweep_s, abs=1e-9)
        monkeypatch.delitem(sys.modules, name)


def test_a_spec_states_the_sigma_of_its_model():
    """At 5 m, where the data sheets state theirs; of ideal ranges there is none to state."""
    wanted = {"lms221": 0.010, "utm30lx": 0.010, "tim561": 0.020, "rplidar_a1": 0.05 / 12**0.5}
    for name, sigma_m in wanted.items():
        model = scanner_of(name)
        assert model.scanner().spec().range_sigma_m == pytest.approx(sigma_m), name
        assert model.only("ideal").scanner().spec().range_sigma_m == 0.0

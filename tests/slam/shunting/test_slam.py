# SPDX-License-Identifier: Apache-2.0
"""The whole system on short drives through the flat test world."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numba.core import event
from numpy.typing import NDArray

import slam
from slam import se2
from slam._jit import COMPILING
from slam.frames import Frame, Scan
from slam.shunting import ShuntingConfig, ShuntingSlam
from tests.world2d import Chairs, Drive, World2D, arena, frames, going_on, laser, rectangle, wander

Array = NDArray[np.float64]
FAST = ShuntingConfig(cell_m=0.05)


def errors(system: slam.SlamSystem, stream: list[Frame]) -> Array:
    """(n, 3) online pose errors in the frame of the known start."""
    out = []
    assert stream[0].truth is not None
    for frame in stream:
        truth = se2.between(stream[0].truth, frame.truth)  # type: ignore[arg-type]
        error = system.update(frame.without_truth()).T_map_robot - truth
        out.append([error[0], error[1], se2.wrap(float(error[2]))])
    return np.array(out)


def rms(values: Array) -> float:
    return float(np.sqrt((values * values).sum(axis=-1).mean()))


@pytest.mark.slow
@pytest.mark.parametrize("rate_hz", [5.0, 37.5])
def test_a_known_motion_is_recovered(rate_hz: float) -> None:
    spec = laser(361, interlaced=True)
    stream = frames(World2D(arena()), wander(1.0), rate_hz=rate_hz, spec=spec, seed=1)
    stream = stream[: round(12.0 * rate_hz)]
    error = errors(slam.create("shunting"), stream)
    odometry = errors(slam.create("odometry"), stream)
    assert rms(error[:, :2]) < 0.012
    assert rms(error[:, 2:]) < math.radians(0.15)
    assert rms(error[:, :2]) < 0.3 * rms(odometry[:, :2])


def test_chairs_that_move_do_not_carry_the_robot_along() -> None:
    world = World2D(arena(), Chairs.random(16, (-4.0, -3.0, 3.0, 3.0), 20.0, 0.5, seed=3))
    stream = frames(world, wander(1.0), rate_hz=10.0, spec=laser(181), seed=3)[:200]
    error = errors(slam.create("shunting"), stream)
    assert rms(error[:, :2]) < 0.02


@pytest.mark.parametrize("phase", [0.0, 0.25, 0.5])
def test_standing_still_does_not_creep_onto_neuron_centres(phase: float) -> None:
    stream = frames(World2D(arena(phase)), Drive((0.0, 0.0, 0.0), ((0.0, 0.0, 40.0),)), rate_hz=5.0)
    error = errors(slam.create("shunting"), stream)
    assert np.abs(error[:, :2]).max() < 0.004


def test_deskewing_helps_in_a_fast_turn() -> None:
    spec = laser(361, interlaced=True)
    drive = Drive((0.0, 0.0, 0.0), ((0.3, 2.5, 3.0), (0.3, -2.5, 3.0)))
    stream = frames(World2D(arena()), drive, rate_hz=10.0, spec=spec, seed=2)
    blind = [replace(f, odometry=replace(f.odometry, twist=np.zeros(3))) for f in stream]
    helped, not_helped = errors(ShuntingSlam(FAST), stream), errors(ShuntingSlam(FAST), blind)
    assert rms(helped[:, 2:]) < 0.5 * rms(not_helped[:, 2:])


def test_scans_metres_apart_without_a_covariance() -> None:
    drive = wander(60.0, speed=0.5, turn=0.4)
    stream = frames(
        World2D(arena()), drive, rate_hz=0.5, spec=laser(181), seed=4, with_covariance=False
    )
    error = errors(slam.create("shunting"), stream)
    assert rms(error[:, :2]) < 0.03


def test_two_runs_give_the_same_bytes() -> None:
    world = World2D(arena(), Chairs.random(8, (-4.0, -3.0, 3.0, 3.0), 6.0, 0.5, seed=5))
    stream = frames(world, wander(1.0), rate_hz=5.0, seed=5)[:30]
    first, second = ShuntingSlam(FAST), ShuntingSlam(FAST)
    for frame in stream:
        a, b = first.update(frame), second.update(frame)
        assert a.T_map_robot.tobytes() == b.T_map_robot.tobytes()
        assert a.covariance.tobytes() == b.covariance.tobytes()
        assert a.diagnostics == b.diagnostics
    first_map, second_map = first.map(), second.map()
    assert first_map is not None
    assert second_map is not None
    assert first_map.values.tobytes() == second_map.values.tobytes()
    second.reset()
    assert second.map() is None
    assert len(second.trajectory()) == 0


def kidnapped_to(
    pose: tuple[float, float, float],
    rooms: World2D,
    last: Frame,
    twist: tuple[float, float] = (0, 0),
) -> list[Frame]:
    """Frames of 4 s from ``pose`` on, whose odometry goes on from ``last`` as if nothing was."""
    drive = Drive(pose, ((*twist, 4.0),))
    return going_on(frames(rooms, drive, rate_hz=5.0, seed=7), last)


def test_a_kidnapped_robot_knows_it_and_finds_itself_without_touching_the_map() -> None:
    rooms = World2D(np.vstack([arena(), rectangle(-2.0, 1.0, -1.2, 2.2)]))
    before = frames(rooms, wander(1.0), rate_hz=5.0, seed=7)[:80]
    system = ShuntingSlam(FAST)
    for frame in before:
        system.update(frame)
    x, y = system.window(-5.5, -4.5, 5.5, 4.5)
    states = []
    for frame in kidnapped_to((2.0, -2.0, 2.0), rooms, before[-1], (0.2, 0.3)):
        estimate = system.update(frame.without_truth())
        states.append(estimate.diagnostics["state"])
        if states[-1] in ("frozen", "lost"):
            assert not estimate.converged
            assert set(states) <= {"frozen", "lost"}  # until it is found
            now_x, now_y = system.window(-5.5, -4.5, 5.5, 4.5)
            np.testing.assert_array_equal(now_x, x)
            np.testing.assert_array_equal(now_y, y)
        else:
            np.testing.assert_allclose(estimate.T_map_robot, frame.truth, atol=0.03)
    assert "relocated" in states
    assert states[-1] == "tracking"


def test_the_covariance_is_of_the_size_of_the_error() -> None:
    normalised = []
    for seed in range(4):
        stream = frames(World2D(arena()), wander(1.0), rate_hz=5.0, spec=laser(181), seed=seed)
        system = ShuntingSlam(FAST)
        for frame in stream[:100]:
            estimate = system.update(frame)
            assert stream[0].truth is not None
            error = estimate.T_map_robot - se2.between(stream[0].truth, frame.truth)  # type: ignore[arg-type]
            error[2] = se2.wrap(float(error[2]))
            if frame.stamp > 5.0:
                normalised.append(error @ np.linalg.solve(estimate.covariance, error) / 3.0)
    assert 0.05 < float(np.mean(normalised)) < 2.0


def test_the_map_shows_the_walls_once() -> None:
    stream = frames(World2D(arena(phase=0.0)), wander(1.0), rate_hz=5.0, seed=8)[:100]
    system = ShuntingSlam(FAST)
    for frame in stream:
        system.update(frame)
    raster = system.map()
    assert raster is not None
    rows, columns = np.nonzero(np.nan_to_num(raster.values) > 0.5)
    x = raster.T_map_origin[0] + (columns + 0.5) * raster.resolution_m
    y = raster.T_map_origin[1] + (rows + 0.5) * raster.resolution_m
    to_wall = np.minimum(np.abs(np.abs(x) - 5.01), np.abs(np.abs(y) - 3.99))
    pillar = (x > 3.3) & (x < 4.1) & (y > 1.4) & (y < 2.2)
    assert (to_wall[~pillar] < 0.08).mean() > 0.99


def test_no_frame_waits_for_the_compiler() -> None:
    """After construction nothing is compiled, not for a wide search either."""
    compiled: list[str] = []

    class Listener(event.Listener):  # type: ignore[misc]
        def on_start(self, event: Any) -> None:
            compiled.append(event.data["dispatcher"].py_func.__name__)

        def on_end(self, event: Any) -> None:
            pass

    stream = frames(World2D(arena()), wander(1.0), rate_hz=5.0, spec=laser(61, interlaced=True))
    system = ShuntingSlam(FAST)
    listener = Listener()
    event.register(COMPILING, listener)
    try:
        for frame in stream[:3]:
            system.update(frame)
        here, elsewhere = stream[3], stream[60].scan
        assert elsewhere is not None
        scan = Scan(stamp_ns=here.stamp_ns, ranges=elsewhere.ranges, spec=elsewhere.spec)
        unsure = replace(here.odometry, increment_covariance=np.diag([0.04, 0.04, 0.1]))
        jump = Frame(stamp_ns=here.stamp_ns, odometry=unsure, scan=scan)
        searched = system.update(jump).diagnostics["searched"]
        system.map()
    finally:
        event.unregister(COMPILING, listener)
    assert searched
    assert compiled == []

# SPDX-License-Identifier: Apache-2.0
"""Short drives in flat rooms after which something happens to the robot or to the room."""

import math
from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slam import se2
from slam.estimate import Estimate
from slam.frames import Frame, Odometry, Scan
from slam.grid.occupancy import OccupancyConfig, OccupancySlam
from slam.shunting import ShuntingConfig, ShuntingSlam
from slam.tracker.tracker import Tracker
from tests.world2d import Drive, World2D, arena, frames, rectangle

Array = NDArray[np.float64]
Pose = tuple[float, float, float]
FAST = ShuntingConfig(cell_m=0.05)
START = (0.0, 0.0, 0.0)
TURN = Drive(START, ((0.0, 0.8, 12.0),))  # on the spot, long enough for a map to be known
LONG_TURN = Drive(START, ((0.0, 0.8, 24.0),))
ROOMS = World2D(np.vstack([arena(), rectangle(-2.0, 1.0, -1.2, 2.2)]))
DOUBTFUL = ("frozen", "lost")
SLAMS = [ShuntingSlam, OccupancySlam]


def made(kind: type[Tracker]) -> Tracker:
    """One with cells of 5 cm."""
    configs: dict[Any, Any] = {ShuntingSlam: FAST, OccupancySlam: OccupancyConfig(cell_m=0.05)}
    return kind(configs[kind])


def estimates(system: Tracker, stream: Iterable[Frame]) -> list[Estimate]:
    """What is said of each frame."""
    return [system.update(frame.without_truth()) for frame in stream]


def states(estimates: Iterable[Estimate]) -> list[str]:
    return [str(one.diagnostics["state"]) for one in estimates]


def off(estimate: Estimate, truth: Any) -> Array:
    """(3,) m and rad, of a map that begins where the world does."""
    found = estimate.T_map_robot - np.asarray(truth)
    found[2] = se2.wrap(float(found[2]))
    return found


def off_m(estimate: Estimate, truth: Any) -> float:
    x, y, _ = off(estimate, truth).tolist()
    return math.hypot(x, y)


def still(world: World2D, pose: Pose, seconds: float) -> list[Frame]:
    return frames(world, Drive(pose, ((0.0, 0.0, seconds),)), rate_hz=5.0, seed=3)


def mapped(
    world: World2D, drive: Drive = TURN, kind: type[Tracker] = ShuntingSlam
) -> tuple[Tracker, Frame]:
    """A SLAM that knows its room, and the last frame."""
    system, stream = made(kind), frames(world, drive, rate_hz=5.0, seed=3)
    assert set(states(estimates(system, stream))) == {"tracking"}
    return system, stream[-1]


def at(system: Tracker) -> Pose:
    """Where it believes to be."""
    x, y, heading = system.trajectory().poses[-1].tolist()
    return x, y, heading


def blind_turn(last: Frame, *, steps: int, said_rad: float, sd_rad: float) -> list[Frame]:
    """Frames without a return, whose odometry turns on the spot, by so much a step."""
    assert last.scan is not None
    out = []
    for step in range(1, steps + 1):
        stamp = last.stamp_ns + step * 200_000_000
        turn = np.array([0.0, 0.0, step * said_rad])
        odometry = Odometry(
            stamp_ns=stamp,
            T_odom_robot=se2.compose(last.odometry.T_odom_robot, turn),
            increment_covariance=np.diag([1e-6, 1e-6, sd_rad**2]),
        )
        ranges = np.full_like(last.scan.ranges, np.nan)
        scan = Scan(stamp_ns=stamp, ranges=ranges, spec=last.scan.spec)
        out.append(Frame(stamp_ns=stamp, odometry=odometry, scan=scan))
    return out

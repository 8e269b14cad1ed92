# SPDX-License-Identifier: Apache-2.0
"""Rooms that a map has known for long, and scans of them, without noise."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from slam import se2
from slam.frames import Scan
from slam.frontend.observations import Observations, from_scan
from slam.grid.occupancy import Grid, OccupancyConfig
from slam.shunting.slam import ShuntingConfig
from slam.tracker.cell_map import CellMap
from slam.tracker.network import Network
from slam.tracker.rasterise import rasterise
from tests.world2d import World2D, laser

Array = NDArray[np.float64]
ORIGIN = np.zeros(3)
CONFIGS: dict[type[CellMap], Any] = {
    Network: ShuntingConfig(cell_m=0.05),
    Grid: OccupancyConfig(cell_m=0.05),
}
KINDS = list(CONFIGS)


def seen(world: World2D, pose: Array, kind: type[CellMap]) -> Observations:
    """What a robot that stands there sees."""
    spec = laser(181)
    poses = np.tile(se2.compose(pose, spec.T_robot_laser), (spec.n_beams, 1))
    ranges = world.ranges(0.0, poses, spec.angles, spec.range_max).astype(np.float32)
    return from_scan(Scan(stamp_ns=0, ranges=ranges, spec=spec), np.zeros(3), CONFIGS[kind])


def known(kind: type[CellMap], world: World2D, seconds: float, *poses: Array) -> CellMap:
    """A map that has looked so long from each of these poses."""
    made: Any = kind
    cell_map: CellMap = made(CONFIGS[kind])
    for pose in poses:
        observations = seen(world, pose, kind)
        at = se2.compose(pose, observations.T_robot_laser)
        for _ in range(max(1, round(2.0 * seconds))):
            rasterise(cell_map, observations, pose)
            cell_map.integrate(observations.view, at, min(seconds, 0.5), write=True)
    return cell_map

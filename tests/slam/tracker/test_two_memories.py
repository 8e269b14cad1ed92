# SPDX-License-Identifier: Apache-2.0
"""The maps of a grid's key frames: without lateral weights, to the bit those of "shunting"."""

from __future__ import annotations

import numpy as np

from slam import se2
from slam.frontend.observations import from_scan
from slam.grid.config import OccupancyConfig
from slam.shunting.config import ShuntingConfig
from slam.shunting.map.network import Network
from slam.tracker.cell_map import CellMap
from slam.tracker.rasterise import rasterise
from slam.tracker.two_memories import TwoMemories
from tests.world2d import World2D, arena, frames, laser, wander


def test_both_means_are_those_of_the_network() -> None:
    stream = frames(World2D(arena()), wander(1.0), rate_hz=5.0, spec=laser(181), seed=8)[:8]
    maps: list[CellMap] = [TwoMemories(OccupancyConfig()), Network(ShuntingConfig())]
    for frame in stream:
        assert frame.scan is not None
        assert frame.truth is not None
        pose = se2.between(stream[0].truth, frame.truth)
        seen = from_scan(frame.scan, np.zeros(3), OccupancyConfig())
        at = se2.compose(pose, seen.T_robot_laser)
        sums = []
        for cell_map in maps:
            rasterise(cell_map, seen, pose)
            looked = cell_map.integrate(seen.view, at, 0.2, write=False)
            sums.append((looked, cell_map.integrate(seen.view, at, 0.2, write=True)))
        assert sums[0] == sums[1]
    (ours, theirs) = (cell_map.window(-5.0, -5.0, 5.0, 5.0) for cell_map in maps)
    assert ours[0].max() > 0.1
    assert ours[1].max() > 0.1
    np.testing.assert_array_equal(ours[0], theirs[0])
    np.testing.assert_array_equal(ours[1], theirs[1])

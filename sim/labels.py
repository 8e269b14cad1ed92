# SPDX-License-Identifier: Apache-2.0
"""Truth per beam, from the ids of what the scanner hit: for scoring, never for a SLAM."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from sim.lidar import ScanResult
from sim.world import World
from slam.frames import BeamClass, BeamLabels, Float


class BeamLabeller:
    """Labels scans of one world and remembers where each mover was when last seen.

    Attribute ``last_seen`` (movers, 3): that memory, NaN for what was never seen.
    """

    def __init__(self, world: World) -> None:
        self._world = world
        self.last_seen = np.full((len(world.scene.movers), 3), np.nan)

    def label(self, result: ScanResult) -> BeamLabels:
        """Labels of the scan that has just been taken.

        ``displacement`` is how far the hit body's origin moved since the scan before that saw it,
        0 the first time and for what cannot move.
        """
        world = self._world
        moving = np.append(world.movers_moving(), False)
        mover = np.append(world.bodies.mover_of_body, -1)[result.bodies]
        kind = np.full(len(mover), BeamClass.STATIC, dtype=np.uint8)
        kind[mover >= 0] = BeamClass.SEMI_STATIC
        kind[(mover >= 0) & moving[mover]] = BeamClass.MOVING
        kind[result.bodies < 0] = BeamClass.NONE
        displacement = np.append(self._displacements(np.unique(mover[mover >= 0])), 0.0)[mover]
        return BeamLabels(
            body=result.bodies,
            kind=kind,
            displacement=displacement.astype(np.float32),
            incidence=result.incidence,
            mixed=result.mixed,
        )

    def _displacements(self, seen: NDArray[np.int64]) -> Float:
        poses = self._world.mover_poses()
        moved = np.zeros(len(poses))
        for k in seen.tolist():
            dx, dy = (poses[k, :2] - self.last_seen[k, :2]).tolist()
            moved[k] = 0.0 if math.isnan(dx) else math.sqrt(dx * dx + dy * dy)
            self.last_seen[k] = poses[k]
        return moved

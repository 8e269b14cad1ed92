# SPDX-License-Identifier: Apache-2.0
"""Truth per beam, from the ids of what the scanner hit: for scoring, never for a SLAM."""

import math

import numpy as np
from numpy.typing import NDArray

from sim.sensors.lidar.receiver import ScanResult
from sim.world.world import World
from slam._jit import njit
from slam.frames import BeamClass, BeamLabels, Float

NONE, STATIC = int(BeamClass.NONE), int(BeamClass.STATIC)
SEMI_STATIC, MOVING = int(BeamClass.SEMI_STATIC), int(BeamClass.MOVING)


class BeamLabeller:
    """Labels scans of one world and remembers where each mover was when last seen.

    Attribute ``last_seen`` (scanners * movers, 3): that memory, of one scanner after the other, NaN
    for what was never seen.
    """

    def __init__(self, world: World, scanners: int = 1) -> None:
        self._world = world
        self.last_seen = np.full((scanners * len(world.scene.movers), 3), np.nan)

    def label(self, result: ScanResult, scanner: int = 0) -> BeamLabels:
        """Labels of the scan that this scanner has just taken.

        ``displacement`` is how far the hit body's origin moved since the scan before that saw it,
        0 the first time and for what cannot move.
        """
        world, n = self._world, len(result.bodies)
        kind, displacement = np.empty(n, dtype=np.uint8), np.empty(n, dtype=np.float32)
        movers = (world.bodies.mover_of_body, world.movers_moving(), world.mover_poses())
        first = scanner * len(world.scene.movers)
        last_seen = self.last_seen[first : first + len(world.scene.movers)]
        _label(result.bodies, movers, last_seen, kind, displacement)
        return BeamLabels(
            body=result.bodies,
            kind=kind,
            displacement=displacement,
            incidence=result.incidence,
            mixed=result.mixed,
        )


@njit
def _label(
    bodies: NDArray[np.int32],
    movers: tuple[NDArray[np.int64], NDArray[np.bool_], Float],
    last_seen: Float,
    kind: NDArray[np.uint8],
    displacement: NDArray[np.float32],
) -> None:
    """Fill the last two; ``movers``: by body its mover, by mover whether it moves and its pose."""
    mover_of_body, moving, poses = movers
    moved = np.full(len(poses), -1.0)  # m since last seen, < 0: not seen in this scan
    for k in range(len(bodies)):
        mover = mover_of_body[bodies[k]] if bodies[k] >= 0 else -1
        displacement[k] = 0.0
        if mover < 0:
            kind[k] = STATIC if bodies[k] >= 0 else NONE
            continue
        if moved[mover] < 0.0:
            dx, dy = poses[mover, 0] - last_seen[mover, 0], poses[mover, 1] - last_seen[mover, 1]
            moved[mover] = 0.0 if math.isnan(dx) else math.sqrt(dx * dx + dy * dy)
            for i in range(3):
                last_seen[mover, i] = poses[mover, i]
        kind[k] = MOVING if moving[mover] else SEMI_STATIC
        displacement[k] = moved[mover]

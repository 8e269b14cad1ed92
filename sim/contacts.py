# SPDX-License-Identifier: Apache-2.0
"""What the robot touches, and how hard."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from sim.bodies import STATIC, Bodies
from slam._jit import njit

Int = NDArray[np.int64]

_MOST = 64  # contacts of the robot that are looked at
HARD_FORCE = 60.0  # N; a robot of 22 kg that brakes on something at more than a third of g


@dataclass(frozen=True, kw_only=True)
class Contact:
    """One thing touched.

    name, kind  of the mover, or "static" and "static"
    force       N, greatest normal force of one substep
    """

    name: str
    kind: str
    force: float

    @property
    def hard(self) -> bool:
        """A collision one would hear: into something fixed or a person, or above HARD_FORCE."""
        return self.kind in ("static", "person") or self.force > HARD_FORCE


@njit
def touched(geoms: NDArray[np.int32], owners: NDArray[np.int64], robot: int, out: Int) -> int:
    """Which contacts, by their geoms (n, 2), are the robot's: rows and what is touched to ``out``.

    owners  (ngeom,) mover of each geom; ``out`` (k, 2). Returns how many.
    """
    found = 0
    for i in range(geoms.shape[0]):
        a, b = owners[geoms[i, 0]], owners[geoms[i, 1]]
        if robot in (a, b) and found < len(out):
            out[found, 0], out[found, 1] = i, a + b - robot
            found += 1
    return found


class RobotContacts:
    """Collects the robot's contacts over substeps until they are taken."""

    def __init__(self, model: mujoco.MjModel, bodies: Bodies) -> None:
        self._model = model
        self._bodies = bodies
        self._mover_of_geom = bodies.mover_of_body[model.geom_bodyid]
        self._forces: dict[int, float] = {}
        self._wrench = np.zeros(6)
        self._found = np.zeros((_MOST, 2), dtype=np.int64)

    def watch(self, data: mujoco.MjData) -> None:
        """Look at the contacts of the substep just made, before the next ones are found."""
        robot = self._bodies.robot
        if data.ncon == 0 or robot is None:
            return
        found = touched(data.contact.geom, self._mover_of_geom, robot, self._found)
        for i, other in self._found[:found].tolist():
            mujoco.mj_contactForce(self._model, data, i, self._wrench)
            force = float(self._wrench[0])
            if force > self._forces.get(other, 0.0):
                self._forces[other] = force

    def take(self) -> list[Contact]:
        """The contacts since the last call, by force; forgets them."""
        movers = self._bodies.scene.movers
        found = [
            Contact(
                name="static" if i == STATIC else movers[i].name,
                kind="static" if i == STATIC else movers[i].kind,
                force=force,
            )
            for i, force in self._forces.items()
        ]
        self._forces.clear()
        return sorted(found, key=lambda c: (-c.force, c.name))

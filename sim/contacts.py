# SPDX-License-Identifier: Apache-2.0
"""What the robot touches, and how hard."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from sim.bodies import STATIC, Bodies
from slam._jit import njit

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
def touched(geoms: NDArray[np.int32], first: int, last: int) -> bool:
    """Whether any of the pairs (n, 2) has a geom of the range; runs at every substep."""
    for i in range(geoms.shape[0]):
        if first <= geoms[i, 0] <= last or first <= geoms[i, 1] <= last:
            return True
    return False


class RobotContacts:
    """Collects the robot's contacts over substeps until they are taken."""

    def __init__(self, model: mujoco.MjModel, bodies: Bodies) -> None:
        self._model = model
        self._bodies = bodies
        self._mover_of_geom = bodies.mover_of_body[model.geom_bodyid]
        own = (
            np.nonzero(self._mover_of_geom == bodies.robot)[0] if bodies.robot is not None else [0]
        )
        self._first, self._last = int(own[0]), int(own[-1])  # all geoms of the robot's one body
        self._forces: dict[int, float] = {}
        self._wrench = np.zeros(6)

    def watch(self, data: mujoco.MjData) -> None:
        """Look at the contacts of the substep just made."""
        if data.ncon == 0 or self._bodies.robot is None:
            return
        geoms = data.contact.geom
        if not touched(geoms, self._first, self._last):
            return
        movers = self._mover_of_geom[geoms]
        for i in np.nonzero((movers == self._bodies.robot).any(axis=1))[0].tolist():
            mujoco.mj_contactForce(self._model, data, i, self._wrench)
            force = float(self._wrench[0])
            other = int(movers[i, 0] + movers[i, 1]) - self._bodies.robot
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

# SPDX-License-Identifier: Apache-2.0
"""What the robot touches, and how hard."""

from dataclasses import dataclass
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.lib.stride_tricks import as_strided
from numpy.typing import NDArray

from scenes.kinds import KINDS
from sim.core.bodies import Bodies
from sim.core.engine import Engine, call_force
from slam._jit import inner
from slam.frames import Float

_MOST = 1024  # contacts that are looked at; chairs on castors have five each
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
    def _person(self) -> bool:
        return self.kind in KINDS and KINDS[self.kind].group == "person"

    @property
    def hard(self) -> bool:
        """A collision one would hear: into something fixed or a person, or above HARD_FORCE."""
        return self.kind == "static" or self._person or self.force > HARD_FORCE


class Touches(NamedTuple):
    """Where the forces on the robot are collected.

    robot   index of its mover; ``owners`` (ngeom,) mover of each geom
    geoms   (k, 2) of the first k contacts, MuJoCo's own memory; k = 0: not known yet
    forces  (movers + 1,) N, greatest normal force so far; the last row is ``STATIC``
    wrench  (6,) room for one contact
    """

    robot: int
    owners: NDArray[np.int64]
    geoms: NDArray[np.int32]
    forces: Float
    wrench: Float


@inner
def collect(engine: Engine, touches: Touches) -> None:
    """Take over the robot's contacts of the substep just made, before the next ones are found."""
    for i in range(len(touches.geoms)):
        call_force(engine.force, engine.model, engine.data, i, touches.wrench)
        force = touches.wrench[0]
        if force == 0.0:  # also what there is none of
            continue
        a, b = touches.owners[touches.geoms[i, 0]], touches.owners[touches.geoms[i, 1]]
        if touches.robot in (a, b):
            other = a + b - touches.robot
            touches.forces[other] = max(touches.forces[other], force)


class RobotContacts:
    """Collects the robot's contacts over substeps, in ``table``, until they are taken."""

    def __init__(self, model: mujoco.MjModel, bodies: Bodies) -> None:
        self._movers = bodies.scene.movers
        robot = -2 if bodies.robot is None else bodies.robot
        owners = bodies.mover_of_body[model.geom_bodyid]
        unknown = np.zeros((0, 4), dtype=np.int32)[:, ::2]  # strided, as what comes in its place
        self._forces = np.zeros(len(self._movers) + 1)
        self.table = Touches(robot, owners, unknown, self._forces, np.zeros(6))

    def locate(self, data: mujoco.MjData) -> bool:
        """Find out where MuJoCo keeps its contacts, which it tells when it has one.

        The memory is the start of its arena, the same for the whole life of ``data``.
        """
        first = data.contact.geom
        if not len(first):
            return False
        geoms = as_strided(first, (_MOST, 2), first.strides)
        self.table = self.table._replace(geoms=geoms)
        return True

    def take(self) -> list[Contact]:
        """The contacts since the last call, by force; forgets them."""
        if not self._forces.any():
            return []
        found = []
        for i in np.flatnonzero(self._forces).tolist():
            static = i == len(self._movers)
            name, kind = ("static",) * 2 if static else (self._movers[i].name, self._movers[i].kind)
            found.append(Contact(name=name, kind=kind, force=float(self._forces[i])))
        self._forces[:] = 0.0
        return sorted(found, key=lambda c: (-c.force, c.name))

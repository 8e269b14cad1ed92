# SPDX-License-Identifier: Apache-2.0
"""Shoves by invisible hands: chairs that roll away, bins that are kicked.

Each thing has its own Poisson process with its own generator, and every event takes the same
number of draws, so the schedule of one thing depends on its seed and rate alone: not on what it
hits, not on how many others there are.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import mujoco
import numpy as np
from numpy.typing import NDArray

from sim.draws import between, waiting
from slam._jit import njit

Float = NDArray[np.float64]
_TICKS_MIN, _TICKS_MAX = 9, 26  # 0.12 to 0.35 s of shove


@njit
def shove(
    time: float,
    tick: float,
    rates: Float,
    counters: NDArray[np.uint64],
    schedule: Float,
    bodies: Float,
    dofs: NDArray[np.int64],
    qfrc: Float,
) -> None:
    """Start and end shoves due at ``time`` by writing generalised forces.

    rates     (n, 4) 1/s, speed min m/s, speed max m/s, spin max rad/s
    schedule  (n, 2) s: start of the next shove, end of the present one (inf: none)
    bodies    (n, 4) mass kg, yaw inertia kg m2, friction of slides N, of yaw N m
    """
    for i in range(len(dofs)):
        dof = dofs[i]
        if time >= schedule[i, 1]:
            schedule[i, 1] = math.inf
            for k in range(3):
                qfrc[dof + k] = 0.0
        if time < schedule[i, 0]:
            continue
        rate, low, high, spin_max = rates[i]
        schedule[i, 0] = time + waiting(counters, i, rate)
        speed = between(counters, i, low, high)
        heading = between(counters, i, -math.pi, math.pi)
        duration = tick * math.floor(between(counters, i, _TICKS_MIN, _TICKS_MAX + 1))
        spin = between(counters, i, -spin_max, spin_max)
        schedule[i, 1] = time + duration - 0.5 * tick
        mass, inertia, friction, yaw_friction = bodies[i]
        # Friction acts on each joint by itself, so it is overcome on each by itself: the shove
        # then gives a heavy visitor chair and a rolling one the speed that was drawn.
        cx, cy = math.cos(heading), math.sin(heading)
        qfrc[dof] = mass * speed * cx / duration + math.copysign(friction, cx)
        qfrc[dof + 1] = mass * speed * cy / duration + math.copysign(friction, cy)
        qfrc[dof + 2] = inertia * spin / duration + math.copysign(yaw_friction, spin)


class Shoves:
    """The shoves of a set of planar bodies of one model."""

    def __init__(
        self,
        model: mujoco.MjModel,
        names: Sequence[str],
        *,
        rates: tuple[float, float, float, float],
        counters: NDArray[np.uint64],
    ) -> None:
        """``rates``: events 1/s, speed min and max m/s, spin max rad/s; same for all ``names``."""
        self.names = tuple(names)
        n = len(self.names)
        self.rates = np.tile(np.array(rates, dtype=np.float64), (n, 1))
        self.counters = counters.copy()
        self.schedule = np.full((n, 2), math.inf)
        self._dofs = np.zeros(n, dtype=np.int64)
        self._bodies = np.zeros((n, 4))
        for i, name in enumerate(self.names):
            dof = int(model.joint(f"{name}/x").dofadr[0])
            body = model.body(f"{name}/base")
            self._dofs[i] = dof
            loss = model.dof_frictionloss
            self._bodies[i] = body.mass[0], body.inertia[2], loss[dof], loss[dof + 2]
            self.schedule[i, 0] = waiting(self.counters, i, rates[0])

    def control(self, time: float, tick: float, qfrc_applied: Float) -> None:
        """Write the forces of the shoves under way at ``time`` s into ``qfrc_applied``."""
        if self.names:
            shove(
                time,
                tick,
                self.rates,
                self.counters,
                self.schedule,
                self._bodies,
                self._dofs,
                qfrc_applied,
            )

    def arrays(self) -> dict[str, NDArray[np.generic]]:
        """The live arrays that are the state."""
        return {"counters": self.counters, "schedule": self.schedule}

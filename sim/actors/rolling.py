# SPDX-License-Identifier: Apache-2.0
"""A set share of the chairs on the move at any time: the direct control for experiments.

In turns, ``round(share * n)`` chairs at once are rolled about as if somebody sat on them and pushed
off with the feet. Who rolls when is a function of time alone; where to and how fast is drawn, a
fixed number of draws for each turn from the chair's own generator. So the schedule depends on the
seed, the share and the number of chairs, not on what a chair meets: one that is held up turns its
heading by the golden angle, without a draw, until it gets away.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from sim.actors.config import CHAIRS
from sim.core.seeds import between, uniform
from sim.core.state import Records, flat, record
from slam._jit import inner
from slam.frames import Float
from slam.shaped import within

# number of the turn, heading rad, speed m/s, spin rad/s, for how long held up s
STATE = record(np.float64, "turn heading speed spin stuck")
GOLDEN = 2.399963229728653  # rad


class Rolled(NamedTuple):
    """What is rolled, n chairs.

    share     how many of them at once
    ranks     (n,) place of each chair in the order of turns
    counters  (n,) generators; state (n,)
    bodies    (n, 4) mass kg, yaw inertia kg m2, friction of slides N, of yaw N m
    dofs      (n,) first of each one's three
    """

    share: int
    ranks: NDArray[np.int64]
    counters: NDArray[np.uint64]
    state: Records
    bodies: Float
    dofs: NDArray[np.int64]


@inner
def roll(time: float, tick: float, rolled: Rolled, qvel: Float, qfrc: Float) -> None:
    """Write the generalised forces on all chairs at ``time`` s into ``qfrc``."""
    share, ranks, counters = rolled.share, rolled.ranks, rolled.counters
    state, bodies, dofs = rolled.state, rolled.bodies, rolled.dofs
    n = len(dofs)
    if share == 0:
        return
    cycle = CHAIRS.turn_s * n / share
    for i in range(n):
        dof, row = dofs[i], state[i]
        since = time - CHAIRS.turn_s * ranks[i] / share
        turn = math.floor(since / cycle)
        phase = since - turn * cycle
        if turn != row.turn:
            row.turn = turn
            row.heading = between(counters, i, -math.pi, math.pi)
            row.speed = between(counters, i, CHAIRS.slowest_mps, CHAIRS.fastest_mps)
            row.spin = between(counters, i, -CHAIRS.spin_max, CHAIRS.spin_max)
            row.stuck = 0.0
        if phase >= CHAIRS.turn_s:
            for k in range(3):
                qfrc[dof + k] = 0.0
            continue
        speed = math.sqrt(qvel[dof] * qvel[dof] + qvel[dof + 1] * qvel[dof + 1])
        row.stuck = row.stuck + tick if speed < 0.3 * row.speed else 0.0
        if row.stuck > CHAIRS.patience_s:
            row.heading, row.stuck = row.heading + GOLDEN, 0.0
        go = row.speed if phase < CHAIRS.turn_s - CHAIRS.brake_s else 0.0
        wanted = (
            go * math.cos(row.heading),
            go * math.sin(row.heading),
            row.spin if go > 0.0 else 0.0,
        )
        for k in range(3):
            mass = bodies[i, 0] if k < 2 else bodies[i, 1]
            friction = bodies[i, 2] if k < 2 else bodies[i, 3]
            accel = (wanted[k] - qvel[dof + k]) / CHAIRS.tau_s
            help_it = math.copysign(friction, wanted[k]) if wanted[k] != 0.0 else 0.0
            qfrc[dof + k] = (
                mass * min(max(accel, -CHAIRS.accel_max), CHAIRS.accel_max) + help_it + 0.0
            )


class Rolling:
    """Chairs (or whatever rolls) of one model, ``share`` of them at any time, as ``table``."""

    def __init__(
        self,
        model: mujoco.MjModel,
        names: Sequence[str],
        *,
        share: float,
        counters: NDArray[np.uint64],
    ) -> None:
        within("moving_share", share, 0.0, 1.0)
        self.names = tuple(names)
        n = len(self.names)
        self.counters = counters[:n].copy()
        self.state = np.full(n, -math.inf, STATE)
        dofs, bodies = inertia_of(model, self.names)
        luck = [uniform(self.counters, i) for i in range(n)]
        ranks = np.empty(n, dtype=np.int64)
        ranks[np.argsort(luck, kind="stable")] = np.arange(n)
        self.table = Rolled(round(share * n), ranks, self.counters, self.state, bodies, dofs)

    def arrays(self) -> dict[str, NDArray[np.generic]]:
        """The live arrays that are the state."""
        return {"counters": self.counters, "state": flat(self.state)}


def inertia_of(model: mujoco.MjModel, names: Sequence[str]) -> tuple[NDArray[np.int64], Float]:
    """(n,) first dof, and (n, 4) mass kg, yaw inertia kg m2, friction of slides N, of yaw N m."""
    dofs, bodies = np.zeros(len(names), dtype=np.int64), np.zeros((len(names), 4))
    for i, name in enumerate(names):
        dof, body = int(model.joint(f"{name}/x").dofadr[0]), model.body(f"{name}/base")
        loss = model.dof_frictionloss
        dofs[i] = dof
        bodies[i] = body.mass[0], body.inertia[2], loss[dof], loss[dof + 2]
        first = int(body.geomadr[0])
        own = range(first, first + int(body.geomnum[0]))
        feet = [g for g in own if model.geom(g).name.startswith(f"{name}/foot")]
        if feet:  # its friction is under its castors, not in its joints (``sim.actors.chairs``)
            grip = float(model.geom_friction[feet[0], 0]) * float(body.mass[0]) * 9.81
            reach = float(np.hypot(*model.geom_pos[feet[0], :2]))
            bodies[i, 2:] = 0.75 * grip, 0.75 * grip * reach
    return dofs, bodies

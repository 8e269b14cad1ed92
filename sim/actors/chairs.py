# SPDX-License-Identifier: Apache-2.0
"""Shoves by invisible hands: chairs that roll away, bins that are kicked, loads that are moved.

Each thing has its own Poisson process with its own generator, and every event takes the same
number of draws, so the schedule of one thing depends on its seed and rate alone: not on what it
hits, not on how many others there are.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from scenes.scene import Scene
from sim.actors.config import ACTORS
from sim.actors.rolling import Rolling, inertia_of
from sim.core.draws import between, waiting
from sim.core.dynamism import Dynamism
from sim.core.seeds import Seeds
from slam._jit import njit

Float = NDArray[np.float64]
_TICKS_MIN, _TICKS_MAX = ACTORS.chairs.push_least_ticks, ACTORS.chairs.push_most_ticks
GROUPS = ("chair", "bin", "load")
IMPULSE_MAX = ACTORS.chairs.impulse_max


class Shoved(NamedTuple):
    """What is shoved, n things.

    rates     (n, 4) 1/s, speed min m/s, speed max m/s, spin max rad/s
    counters  (n,) generators
    schedule  (n, 2) s: start of the next shove, end of the present one (inf: none)
    bodies    (n, 4) mass kg, yaw inertia kg m2, friction of slides N, of yaw N m
    dofs      (n,) first of each one's three
    """

    rates: Float
    counters: NDArray[np.uint64]
    schedule: Float
    bodies: Float
    dofs: NDArray[np.int64]


@njit
def shove(time: float, tick: float, shoved: Shoved, qfrc: Float) -> None:
    """Start and end shoves due at ``time`` s by writing generalised forces into ``qfrc``."""
    rates, counters, schedule, bodies, dofs = shoved
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
        speed = min(speed, IMPULSE_MAX / bodies[i, 0])
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
    """The shoves of a set of planar bodies of one model, as ``table``."""

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
        self.counters = counters[:n].copy()
        self.schedule = np.full((n, 2), math.inf)
        dofs, bodies = inertia_of(model, self.names)
        for i in range(n):
            self.schedule[i, 0] = waiting(self.counters, i, rates[0])
        each = np.tile(np.array(rates, dtype=np.float64), (n, 1))
        self.table = Shoved(each, self.counters, self.schedule, bodies, dofs)

    def arrays(self) -> dict[str, NDArray[np.generic]]:
        """The live arrays that are the state."""
        return {"counters": self.counters, "schedule": self.schedule}


def pushers(
    model: mujoco.MjModel, scene: Scene, rates: Dynamism, seeds: Seeds
) -> dict[str, Shoves | Rolling]:
    """What moves the planar things without a will of their own, by the group they belong to.

    The groups are those of ``scenes.kinds``; people, doors and the robot have a will of their own,
    and what somebody holds is moved by them.
    """
    movers, held = scene.movers, {hold.held for hold in scene.holds}
    groups: dict[str, list[str]] = {group: [] for group in GROUPS}
    for mover in movers:
        if mover.group in groups and mover.name not in held:
            groups[mover.group].append(mover.name)
    shove = (rates.push_speed_min, rates.push_speed_max, rates.push_spin_max)
    kick = (rates.kick_speed_min, rates.kick_speed_max, rates.push_spin_max)
    how = {
        "chair": (rates.chair_push_rate, *shove),
        "bin": (rates.bin_kick_rate, *kick),
        "load": (rates.load_push_rate, *shove),
    }
    made: dict[str, Shoves | Rolling] = {}
    for group, names in groups.items():
        # One counter for each mover of the scene, so that more people leave the chairs' alone.
        counters = seeds.counters(f"{group}s", len(movers))
        if rates.moving_share is not None and group != "bin":
            made[group] = Rolling(model, names, share=rates.moving_share, counters=counters)
        else:
            made[group] = Shoves(model, names, rates=how[group], counters=counters)
    return made


def tables(model: mujoco.MjModel, made: Mapping[str, Shoves | Rolling]) -> tuple[Any, Any]:
    """What ``pushers`` made, as kernels take it: one table of each kind for each of ``GROUPS``."""
    none = np.zeros(0, dtype=np.uint64)
    idle = Shoves(model, (), rates=(0.0, 0.0, 0.0, 0.0), counters=none).table
    still = Rolling(model, (), share=0.0, counters=none).table
    return (
        tuple(p.table if isinstance(p, Shoves) else idle for p in made.values()),
        tuple(p.table if isinstance(p, Rolling) else still for p in made.values()),
    )

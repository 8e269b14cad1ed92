# SPDX-License-Identifier: Apache-2.0
"""Shoves by invisible hands: chairs that roll away, bins that are kicked, loads that are moved.

Each thing has its own Poisson process with its own generator, and every event takes the same
number of draws, so the schedule of one thing depends on its seed and rate alone: not on what it
hits, not on how many others there are.

Chairs have two levels of physics. **planar** (default): a chair slides in the plane; friction acts
on each axis by itself. **free**: it has all six freedoms and stands on the floor with five castors
(or four glides), each a small sphere with the friction that the planar level has in sum. It rocks
when hit, its friction is a circle and not a square, and it turns because its castors drag. The six
freedoms are joints in a row: x, y, yaw as at the planar level, so that these stay the first three
addresses of a chair for everyone who pushes, avoids or draws it, then height, pitch and roll.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from scenes.kinds import Feet, kind_of
from scenes.scene import Scene
from sim.actors.config import CHAIRS
from sim.actors.rolling import Rolling, inertia_of
from sim.core.dynamism import Dynamism
from sim.core.seeds import Seeds, between, waiting
from slam._jit import uncounted
from slam.frames import Float

GROUPS = ("chair", "bin", "load")


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


@uncounted
def shove(time: float, tick: float, shoved: Shoved, qfrc: Float) -> None:
    """Start and end shoves due at ``time`` s by writing generalised forces into ``qfrc``."""
    rates, counters, schedule = shoved.rates, shoved.counters, shoved.schedule
    bodies, dofs = shoved.bodies, shoved.dofs
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
        speed = min(speed, CHAIRS.impulse_max / bodies[i, 0])
        duration = tick * math.floor(
            between(counters, i, CHAIRS.push_least_ticks, CHAIRS.push_most_ticks + 1)
        )
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


LEVELS = ("planar", "free")
GRAVITY = 9.81
FLOOR_BIT, CASTOR_BIT = 16, 32  # they meet each other and nothing else
# Castor friction at walking speed, N per axis: the planar level has friction and damping in its
# joints; here the spheres have it all. Damping counts at 0.5 m/s.
_DAMPED_AT = 0.5


def stand_on_castors(scene: Scene) -> Scene:
    """The scene with every chair at the level "free"; the given one is left as it is."""
    spec = scene.spec.copy()
    spec.worldbody.add_geom(
        name="castor_floor",
        type=mujoco.mjtGeom.mjGEOM_PLANE,
        size=[0.0, 0.0, 1.0],
        group=3,
        contype=FLOOR_BIT,
        conaffinity=CASTOR_BIT,
        rgba=[0.5, 0.5, 0.5, 0.0],
    )
    if abs(float(spec.option.gravity[2]) + GRAVITY) > 0.01:
        spec.option.gravity = [0.0, 0.0, -GRAVITY]
    for mover in scene.movers:
        feet = kind_of(mover.kind).feet
        if feet is not None:
            _set_on_feet(spec, mover.name, feet)
    return replace(scene, spec=spec)


def _set_on_feet(spec: mujoco.MjSpec, name: str, feet: Feet) -> None:
    body = spec.body(f"{name}/base")
    grip = friction_of(spec, name)
    for axis in ("x", "y", "yaw"):
        joint = spec.joint(f"{name}/{axis}")
        joint.frictionloss = 0.0
        joint.damping[0] = 0.0
    slide, hinge = mujoco.mjtJoint.mjJNT_SLIDE, mujoco.mjtJoint.mjJNT_HINGE
    body.add_joint(name=f"{name}/z", type=slide, axis=[0, 0, 1])
    body.add_joint(name=f"{name}/pitch", type=hinge, axis=[0, 1, 0])
    body.add_joint(name=f"{name}/roll", type=hinge, axis=[1, 0, 0])
    circle, radius = feet.circle_m, feet.radius_m
    for k in range(feet.number):
        angle = feet.first_rad + math.tau * k / feet.number
        body.add_geom(
            name=f"{name}/foot{k}",
            type=mujoco.mjtGeom.mjGEOM_SPHERE,
            size=[radius, 0.0, 0.0],
            pos=[circle * math.cos(angle), circle * math.sin(angle), radius],
            group=3,
            mass=0.0,
            contype=CASTOR_BIT,
            conaffinity=FLOOR_BIT,
            condim=3,
            priority=1,
            friction=[grip, 0.005, 0.0001],
        )


def friction_of(spec: mujoco.MjSpec, name: str) -> float:
    """Coefficient that brakes like the planar joints of that chair do on average."""
    joint, mass = spec.joint(f"{name}/x"), float(spec.body(f"{name}/base").mass)
    # A square of friction F per axis brakes with 4/pi F on average over all directions.
    force = 4.0 / math.pi * float(joint.frictionloss) + float(joint.damping[0]) * _DAMPED_AT
    return force / (mass * GRAVITY)

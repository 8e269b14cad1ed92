# SPDX-License-Identifier: Apache-2.0
"""Chairs that stand on their castors: the finer of two levels of chair physics.

**planar** (default): a chair slides in the plane; friction acts on each axis by itself.
**free**: a chair has all six freedoms and stands on the floor with five castors (or four glides),
each a small sphere with the friction that the planar level has in sum. It rocks when hit, its
friction is a circle and not a square, and it turns because its castors drag.

The six freedoms are joints in a row: x, y, yaw as at the planar level, so that these stay the first
three addresses of a chair for everyone who pushes, avoids or draws it, then height, pitch and roll.
"""

from __future__ import annotations

import math
from dataclasses import replace

import mujoco

from scenes.kinds import Feet, kind_of
from scenes.scene import Scene
from slam.errors import InvalidValueError

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


def checked_level(level: str) -> str:
    """One of ``LEVELS``."""
    if level not in LEVELS:
        raise InvalidValueError(f"chairs must be one of {', '.join(LEVELS)}, got {level!r}")
    return level


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

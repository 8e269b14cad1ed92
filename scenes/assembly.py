# SPDX-License-Identifier: Apache-2.0
"""Parts put side by side under their names, then into a scene all at once.

A part is attached under a prefix ("chair3/"), which MuJoCo also puts before the part's references
to materials; so a part's own materials are dropped and the prefix is stripped from the reference.
Attaching costs more the bigger the scene is, so parts first meet in a spec of their own: one for
all whose names differ in the number only ("chair0", "chair1", ...).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache

import mujoco

from scenes.kinds import kind_of
from scenes.marks import Mark, marks
from scenes.mjcf import check_materials, parsed
from scenes.scene import Mover, Pose


def moved(pose: Pose, local: Pose) -> Pose:
    """``local``, given in the frame of ``pose``, in the world."""
    x, y, yaw = pose
    cos, sin = math.cos(yaw), math.sin(yaw)
    turned = math.remainder(yaw + local[2], math.tau)
    return x + cos * local[0] - sin * local[1], y + sin * local[0] + cos * local[1], turned


@cache
def part(name: str) -> mujoco.MjSpec:
    """The parsed part without its materials; copy before use."""
    spec = parsed("parts", name)
    for material in list(spec.materials):
        spec.delete(material)
    return spec


@cache
def part_marks(name: str) -> tuple[Mark, ...]:
    """The marks of a part, in its own frame."""
    return marks(part(name))


@cache
def hull_radius(name: str) -> float:
    """Radius of a planar part's hull, m."""
    return float(part(name).geom("hull").size[0])


@cache
def corners(name: str) -> tuple[tuple[float, float, float], ...]:
    """(x, y, radius) m of a planar part's hulls beside the row along its x axis, in its frame."""
    hulls = (geom for geom in part(name).geoms if geom.name.rstrip("0123456789") == "hull")
    discs = [(float(g.pos[0]), float(g.pos[1]), float(g.size[0])) for g in hulls]
    return tuple(disc for disc in discs if disc[1] != 0.0)


def hulls(name: str) -> tuple[tuple[float, float, float], ...]:
    """(x, y, radius) m of all hulls of a planar part, in its frame."""
    half, radius = kind_of(name).half_length_m, hull_radius(name)
    row = (0.0,) if half == 0.0 else (-half, 0.0, half)
    return (*((x, 0.0, radius) for x in row), *corners(name))


def reach_of(name: str) -> float:
    """Radius of the disc around a planar part that holds all its hulls, m."""
    return max(math.hypot(x, y) + radius for x, y, radius in hulls(name))


def room_of(mover: Mover) -> float:
    """Radius m of the disc that a thing is given where it is put elsewhere; of a door its leaf.

    It holds all hulls of what has hulls at its corners, of everything else the middle one.
    """
    long = mover.group != "door" and corners(mover.kind)
    return reach_of(mover.kind) if long else mover.radius


class Assembly:
    """Parts on their way into a scene."""

    def __init__(self) -> None:
        self._groups: dict[str, mujoco.MjSpec] = {}

    def put(
        self,
        name: str,
        instance: str,
        pose: Pose,
        prepare: Callable[[mujoco.MjSpec], None] | None = None,
    ) -> None:
        """Put a copy of part ``name``, altered by ``prepare``, at ``pose`` as ``instance``."""
        child = part(name).copy()
        if prepare:
            prepare(child)
        kin = instance.rstrip("0123456789")
        group = self._groups.setdefault(kin, mujoco.MjSpec())
        frame = group.worldbody.add_frame(pos=[pose[0], pose[1], 0.0], quat=quaternion(pose[2]))
        group.attach(child, frame=frame, prefix=f"{instance.removeprefix(kin)}/")

    def into(self, spec: mujoco.MjSpec) -> None:
        """Hand everything over to ``spec``, whose materials the parts use from now on.

        Raises ``InvalidValueError`` for a material that ``spec`` does not have.
        """
        for kin, group in self._groups.items():
            geoms = group.geoms  # still the same geoms once attached
            spec.attach(group, frame=spec.worldbody.add_frame(), prefix=kin)
            for geom in geoms:
                geom.material = geom.material.rpartition("/")[2]
            check_materials(spec, geoms, f"part '{kin}'")
        self._groups = {}
        for camera in spec.cameras:
            camera.name = camera.name.rpartition("/")[2]


def quaternion(yaw: float) -> list[float]:
    """Of a turn about the vertical."""
    return [math.cos(0.5 * yaw), 0.0, 0.0, math.sin(0.5 * yaw)]

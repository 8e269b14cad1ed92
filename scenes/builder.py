# SPDX-License-Identifier: Apache-2.0
"""From hand-written MJCF to one model: a plan, parts attached to it, one copy of each material.

A part is attached under a prefix ("chair3/"), which MuJoCo also puts before the part's references
to materials; so a part's own materials are dropped and the prefix is stripped from the reference.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray

from scenes.scene import Kind, Mover, Pose

HERE = Path(__file__).parent
JAMB_OFFSET = 0.04  # m from the plane of a hinge to the middle of its wall, away from the swing


@dataclass(frozen=True, kw_only=True)
class Mark:
    """A site of a plan: ``words`` of its name split at ':', where it is, half sizes of its box."""

    words: tuple[str, ...]
    pose: Pose
    half: tuple[float, float]

    @property
    def rect(self) -> tuple[float, float, float, float]:
        """xmin, ymin, xmax, ymax of an unrotated box, m."""
        (x, y, _), (a, b) = self.pose, self.half
        return x - a, y - b, x + a, y + b


def marks(spec: mujoco.MjSpec) -> list[Mark]:
    """Every site of an uncompiled spec, in the order of the file."""
    return [
        Mark(
            words=tuple(site.name.split(":")),
            pose=(float(site.pos[0]), float(site.pos[1]), _yaw(site)),
            half=(float(site.size[0]), float(site.size[1])),
        )
        for site in spec.sites
    ]


def moved(pose: Pose, local: Pose) -> Pose:
    """``local``, given in the frame of ``pose``, in the world."""
    x, y, yaw = pose
    cos, sin = math.cos(yaw), math.sin(yaw)
    turned = math.remainder(yaw + local[2], math.tau)
    return x + cos * local[0] - sin * local[1], y + sin * local[0] + cos * local[1], turned


class Builder:
    """Fills a plan with parts."""

    def __init__(self, plan: str) -> None:
        self.spec = mujoco.MjSpec.from_file(str(HERE / "plans" / f"{plan}.xml"))
        self.marks = marks(self.spec)
        for site in list(self.spec.sites):
            self.spec.delete(site)
        self.movers: list[Mover] = []
        self.initial: dict[str, Pose] = {}
        self.door_angles: dict[str, float] = {}
        self._boxes = [
            [geom.pos[0], geom.pos[1], geom.size[0], geom.size[1], 0.0]
            for geom in self.spec.geoms
            if geom.name.partition(":")[0] in ("wall", "parapet")
        ]

    @property
    def boxes(self) -> NDArray[np.float64]:
        """(n, 5) walls and furniture so far: cx, cy, half_x, half_y m, yaw rad."""
        return np.array(self._boxes, dtype=np.float64).reshape(-1, 5)

    def find(self, first: str) -> Iterator[Mark]:
        """Marks whose name starts with that word."""
        return (mark for mark in self.marks if mark.words[0] == first)

    def furnish(self, part: str, name: str, pose: Pose) -> list[Mark]:
        """Put a static part; returns its ``seat:...`` marks in the world."""
        self._attach(part, name, pose)
        seats = []
        for mark in _part_marks(part):
            place = moved(pose, mark.pose)
            if mark.words[0].startswith("footprint"):
                self._boxes.append([place[0], place[1], *mark.half, place[2]])
            elif mark.words[0] == "seat":
                seats.append(Mark(words=mark.words, pose=place, half=mark.half))
        return seats

    def add(
        self, kind: Kind, name: str, pose: Pose, *, paint: Mapping[str, str] | None = None
    ) -> Mover:
        """Put something planar that moves. ``paint`` maps material names of the part to others."""
        self._attach(kind, name, (0.0, 0.0, 0.0), paint)
        mover = Mover(name=name, kind=kind, radius=hull_radius(kind))
        self.movers.append(mover)
        self.initial[name] = pose
        if kind == "person":
            self._stand(name, pose)
        return mover

    def add_door(self, name: str, hinge: Pose, *, clockwise: bool, angle: float) -> Mover:
        """Hang a door, at rest at ``angle`` rad from closed, and its frame."""
        side = JAMB_OFFSET if clockwise else -JAMB_OFFSET
        self.furnish("door_frame", f"{name}_frame", moved(hinge, (0.0, side, 0.0)))
        self._attach("door", name, hinge)
        joint = self.spec.joint(f"{name}/hinge")
        joint.springref = angle
        if clockwise:
            joint.axis = [0.0, 0.0, -1.0]
        panel = self.spec.geom(f"{name}/panel")
        mover = Mover(name=name, kind="door", radius=float(panel.pos[0] + panel.size[0]))
        self.movers.append(mover)
        self.initial[name] = hinge
        self.door_angles[name] = angle
        return mover

    def doorway(self, name: str) -> Pose:
        """Middle of a door's opening, and the direction of its closed leaf."""
        width = next(m.radius for m in self.movers if m.name == name)
        return moved(self.initial[name], (0.5 * width, 0.0, 0.0))

    def leaf_box(self, name: str) -> list[float]:
        """The leaf of a door at rest as a box: cx, cy, half_x, half_y, yaw."""
        x, y, yaw = self.initial[name]
        turn = self.door_angles[name] * float(self.spec.joint(f"{name}/hinge").axis[2])
        half = 0.5 * next(m.radius for m in self.movers if m.name == name)
        centre = moved((x, y, yaw + turn), (half, 0.0, 0.0))
        return [centre[0], centre[1], half, 0.025, centre[2]]

    def _attach(
        self, part: str, name: str, pose: Pose, paint: Mapping[str, str] | None = None
    ) -> None:
        child = _part(part).copy()
        for geom in child.geoms if paint else ():
            geom.material = (paint or {}).get(geom.material, geom.material)
        half = 0.5 * pose[2]
        frame = self.spec.worldbody.add_frame(
            pos=[pose[0], pose[1], 0.0], quat=[math.cos(half), 0.0, 0.0, math.sin(half)]
        )
        self.spec.attach(child, frame=frame, prefix=f"{name}/")

    def _stand(self, name: str, pose: Pose) -> None:
        """Put the mocap limbs under the torso; the gait moves them from then on."""
        half = 0.5 * pose[2]
        for limb in ("thigh_l", "shank_l", "thigh_r", "shank_r"):
            body = self.spec.body(f"{name}/{limb}")
            local = (float(body.pos[0]), float(body.pos[1]), 0.0)
            x, y, _ = moved(pose, local)
            body.pos = [x, y, body.pos[2]]
            body.quat = [math.cos(half), 0.0, 0.0, math.sin(half)]


@cache
def _part(name: str) -> mujoco.MjSpec:
    """The parsed part without its materials; copy before use."""
    spec = mujoco.MjSpec.from_file(str(HERE / "parts" / f"{name}.xml"))
    for material in list(spec.materials):
        spec.delete(material)
    return spec


@cache
def _part_marks(name: str) -> tuple[Mark, ...]:
    return tuple(marks(_part(name)))


@cache
def hull_radius(kind: Kind) -> float:
    """Radius of a planar part's hull, m."""
    return float(_part(kind).geom("hull").size[0])


def _yaw(site: mujoco.MjsSite) -> float:
    return (
        float(site.alt.euler[2])
        if site.alt.type == mujoco.mjtOrientation.mjORIENTATION_EULER
        else 0.0
    )

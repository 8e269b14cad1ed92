# SPDX-License-Identifier: Apache-2.0
"""A scene into which a crowd is put: its free floor, who is there already, what they do."""

from __future__ import annotations

import math
from dataclasses import replace

import mujoco
import numpy as np

from scenes import look
from scenes.assembly import Assembly, hull_radius, hulls, moved
from scenes.builder import stand
from scenes.crowd import Crowd
from scenes.kinds import kind_of
from scenes.placement import Floor
from scenes.recipe import DOORWAY_RADIUS, GOAL_RADIUS, MARGIN
from scenes.scene import Hold, Mover, Pose, Role, Scene
from slam.errors import InvalidValueError

TRIES = 400
_STREAM = 100  # of a scene's seed; those of ``scenes.recipe.Draws`` are 0 to 6


class Filling:
    """A scene that is being filled."""

    def __init__(self, scene: Scene, crowd: Crowd, session: int) -> None:
        self.scene, self.crowd = scene, crowd
        self.rng = np.random.default_rng([scene.seed, _STREAM, session])
        self.parts = Assembly()
        self.movers: list[Mover] = []
        self.initial: dict[str, Pose] = {}
        self.roles: dict[str, Role] = {}
        self.holds: list[Hold] = []
        self.floor = _free_floor(scene, list(scene.rooms.values()))
        self.halls = _free_floor(scene, _halls(scene))

    def fits(self, discs: list[tuple[float, float, float]]) -> bool:
        """Whether each disc (x, y, radius m) lies in a room, on free floor."""
        points = np.array([disc[:2] for disc in discs])
        gaps = self.floor.clearance(points)
        inside = all(self._indoors(*disc) for disc in discs)
        return inside and bool((gaps >= np.array([disc[2] for disc in discs]) + MARGIN).all())

    def _indoors(self, x: float, y: float, radius: float) -> bool:
        return any(
            a + radius <= x <= c - radius and b + radius <= y <= d - radius
            for a, b, c, d in self.scene.rooms.values()
        )

    def add(self, kind: str, name: str, pose: Pose) -> None:
        """Put a mover at a pose and take its floor."""
        paint = look.dress(self.rng) if kind_of(kind).group == "person" else {}

        def prepare(child: mujoco.MjSpec) -> None:
            for geom in child.geoms if paint else ():
                geom.material = paint.get(geom.material, geom.material)
            if kind_of(kind).group == "person":
                stand(child, pose)

        self.parts.put(kind, name, (0.0, 0.0, 0.0), prepare)
        self.movers.append(Mover(name=name, kind=kind, radius=hull_radius(kind)))
        self.initial[name] = pose
        self.block(discs_of(kind, pose))

    def block(self, discs: list[tuple[float, float, float]]) -> None:
        """Take floor."""
        for disc in discs:
            self.floor.block(*disc)
            self.halls.block(*disc)

    def anywhere(self, kinds: list[tuple[str, Pose]], what: str) -> list[Pose]:
        """Poses of a rigid set of things, given in the first one's frame, where all have room.

        What is long stands in a hall, where the scene has one.
        """
        floor = self.floor if len(kinds) == 1 else self.halls
        for _ in range(TRIES):
            place = floor.find(self.rng, hull_radius(kinds[0][0]) + MARGIN)
            if place is None:
                break
            first = (*place, float(self.rng.uniform(-math.pi, math.pi)))
            poses = [moved(first, local) for _, local in kinds]
            discs = [
                d for (kind, _), p in zip(kinds, poses, strict=True) for d in discs_of(kind, p)
            ]
            if self.fits(discs):
                return poses
        raise InvalidValueError(f"crowd: {what} does not fit on the floor of '{self.scene.name}'")

    def put(self, named: list[tuple[str, str, Pose]], what: str) -> None:
        """Put a rigid set of things (kind, name, pose in the first one's frame) anywhere."""
        poses = self.anywhere([(kind, local) for kind, _, local in named], what)
        for (kind, name, _), pose in zip(named, poses, strict=True):
            self.add(kind, name, pose)

    def finish(self) -> Scene:
        """A copy of the scene with all that was put into it."""
        scene = self.scene
        spec = scene.spec.copy()
        self.parts.into(spec)
        return replace(
            scene,
            spec=spec,
            movers=(*scene.movers[:-1], *self.movers, scene.movers[-1]),
            initial={**scene.initial, **self.initial},
            roles=dict(self.roles),
            holds=tuple(self.holds),
            options={**scene.options, "crowd": str(self.crowd)},
        )


def reach_of(kind: str) -> float:
    """m from the middle of a thing to the end of its hulls, along its x axis."""
    return kind_of(kind).half_length_m + hull_radius(kind)


def discs_of(kind: str, pose: Pose) -> list[tuple[float, float, float]]:
    """(x, y, radius) m of the hulls of a thing at a pose."""
    return [(*moved(pose, (x, y, 0.0))[:2], radius) for x, y, radius in hulls(kind)]


def _halls(scene: Scene) -> list[tuple[float, float, float, float]]:
    """Rooms with two goals or more, between which long things move; all, where there is none."""
    inside = {
        name: sum(a <= x <= c and b <= y <= d for x, y in scene.goals.values())
        for name, (a, b, c, d) in scene.rooms.items()
    }
    halls = [scene.rooms[name] for name, n in inside.items() if n > 1]
    return halls or list(scene.rooms.values())


def _free_floor(scene: Scene, rects: list[tuple[float, float, float, float]]) -> Floor:
    """The floor of rooms less furniture, doorways, goals and everything that is there already."""
    floor = Floor(rects, scene.obstacles)
    for mover in scene.movers:
        x, y, yaw = scene.initial[mover.name]
        if mover.group == "door":
            middle = moved((x, y, yaw), (0.5 * mover.radius, 0.0, 0.0))
            floor.block(middle[0], middle[1], DOORWAY_RADIUS + 0.5 * mover.radius)
        else:
            for cx, cy, radius in discs_of(mover.kind, (x, y, yaw)):
                floor.block(cx, cy, radius + (0.2 if mover.group == "robot" else 0.0))
    for x, y in scene.goals.values():
        floor.block(x, y, GOAL_RADIUS)
    return floor

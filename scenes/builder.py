# SPDX-License-Identifier: Apache-2.0
"""What moves, added to a copy of a plan: chairs, people, bins, door leaves, the robot."""

from collections.abc import Mapping
from functools import partial

import mujoco
import numpy as np
from numpy.typing import NDArray

from scenes.assembly import Assembly, moved, part, repaint
from scenes.plan import Plan
from scenes.scene import Kind, Mover, Pose
from slam.errors import InvalidValueError

LEAF_HALF = 0.025  # m, half thickness of a door leaf with its trim
TRACK = 0.11  # m from the middle of a wall to that of a leaf that slides before it
LATCH = -0.2  # rad, where the closer of a door that rests closed would pull it: it stays shut
WIDE = 1.25  # rad; whatever its rest, room is kept for a leaf this far open


class Builder:
    """Fills a finished plan with movers; the plan stays as it is."""

    def __init__(self, plan: Plan) -> None:
        self.plan = plan
        self.movers: list[Mover] = []
        self.initial: dict[str, Pose] = {}
        self.door_angles: dict[str, float] = {}
        self._turns: dict[str, float] = {}
        self._parts = Assembly()

    def add(
        self, kind: Kind, name: str, pose: Pose, *, paint: Mapping[str, str] | None = None
    ) -> Mover:
        """Put something planar that moves (``Assembly.put_mover``)."""
        mover = self._parts.put_mover(kind, name, pose, paint or {})
        self.movers.append(mover)
        self.initial[name] = pose
        return mover

    def add_door(self, name: str, hinge: Pose, *, clockwise: bool, angle: float) -> Mover:
        """Hang a door, at rest at ``angle`` rad from closed."""
        turn = -1.0 if clockwise else 1.0

        def prepare(child: mujoco.MjSpec) -> None:
            joint = child.joint("hinge")
            joint.springref = angle if angle > 0.0 else LATCH
            joint.axis = [0.0, 0.0, turn]

        self._parts.put("door", name, hinge, prepare)
        self.door_angles[name], self._turns[name] = angle, turn
        return self._hung("door", name, hinge)

    def add_sliding_door(self, kind: Kind, name: str, edge: Pose, *, left: bool) -> Mover:
        """Hang a sliding door, closed; ``edge`` is the end of its opening, in the wall's middle.

        kind  "door_sliding", or "door_lift" before the cabin of a lift
        left  on which side of the wall it runs, seen along the closed leaf
        """
        track = moved(edge, (0.0, TRACK if left else -TRACK, 0.0))
        paint = {"metal_white": "metal"} if kind == "door_lift" else {}
        self._parts.put(kind, name, track, partial(repaint, paint=paint))
        self.door_angles[name], self._turns[name] = 0.0, 0.0
        return self._hung(kind, name, track)

    def _hung(self, kind: Kind, name: str, pose: Pose) -> Mover:
        panel = part(kind).geom("panel")
        mover = Mover(name=name, kind=kind, radius=float(panel.pos[0] + panel.size[0]))
        self.movers.append(mover)
        self.initial[name] = pose
        return mover

    def doorway(self, name: str) -> Pose:
        """Middle of a door's opening, and the direction of its closed leaf."""
        return moved(self.initial[name], (0.5 * self._width(name), 0.0, 0.0))

    def leaf_box(self, name: str) -> list[float]:
        """The leaf of a door that stands open as a box: cx, cy, half_x, half_y, yaw."""
        x, y, yaw = self.initial[name]
        half = 0.5 * self._width(name)
        if self._turns[name] == 0.0:  # it slides aside
            cx, cy, _ = moved((x, y, yaw), (-half, 0.0, 0.0))
            return [cx, cy, half, LEAF_HALF, yaw]
        yaw += max(self.door_angles[name], WIDE) * self._turns[name]
        cx, cy, turned = moved((x, y, yaw), (half, 0.0, 0.0))
        return [cx, cy, half, LEAF_HALF, turned]

    def leaf_boxes(self) -> NDArray[np.float64]:
        """(n, 5) all leaves, open."""
        return np.array([self.leaf_box(name) for name in self.door_angles]).reshape(-1, 5)

    def check_apart(self) -> None:
        """Raise ``InvalidValueError`` for a thing that stands in another: both would burst."""
        things = [mover for mover in self.movers if mover.group != "door"]
        at = np.array([self.initial[mover.name][:2] for mover in things]).reshape(-1, 2)
        radius = np.array([mover.radius for mover in things])
        for k in range(1, len(things)):
            near = np.hypot(*(at[:k] - at[k]).T) < 0.5 * (radius[:k] + radius[k])
            if near.any():
                x, y = at[k].tolist()
                other = things[int(np.flatnonzero(near)[0])].name
                raise InvalidValueError(f"'{things[k].name}' at ({x:g}, {y:g}) stands in '{other}'")

    def spec(self) -> mujoco.MjSpec:
        """Plan and movers in one; the builder is empty afterwards."""
        spec = self.plan.spec.copy()
        self._parts.into(spec)
        return spec

    def _width(self, name: str) -> float:
        return next(m.radius for m in self.movers if m.name == name)

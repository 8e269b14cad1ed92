# SPDX-License-Identifier: Apache-2.0
"""Every chair, person, door and bin at each scan, as a visualization_msgs/MarkerArray."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from scenes.kinds import kind_of
from scenes.scene import Mover
from slam._jit import njit
from slam.frames import Float
from slam.ros.messages import WORLD
from slam.ros.template import Marks, Template, header, message

LEAF_M = 0.04  # thickness of a door as drawn
_RESTING, _MOVING = (0.55, 0.55, 0.6, 1.0), (0.9, 0.3, 0.1, 1.0)
_CUBE, _CYLINDER = 1, 3


@njit
def _place(poses: Float, reach: Float, heights: Float, out: Float) -> None:
    """Position (m) and quaternion of each marker; a leaf's middle is ``reach`` off its hinge."""
    for k in range(len(poses)):
        yaw = poses[k, 2]
        out[k, 0] = poses[k, 0] + reach[k] * math.cos(yaw)
        out[k, 1] = poses[k, 1] + reach[k] * math.sin(yaw)
        out[k, 2] = 0.5 * heights[k]
        out[k, 5], out[k, 6] = math.sin(0.5 * yaw), math.cos(0.5 * yaw)


class ObjectsMessage:
    """One marker for each mover but the robot, always in the same order.

    ``ns`` its kind, ``id`` its place among the scene's movers, ``text`` its name, ``scale`` its
    size (m), ``color`` orange while it moves and grey while it rests.
    """

    KIND = "visualization_msgs/msg/MarkerArray"

    def __init__(self, movers: Sequence[Mover]) -> None:
        self._rows = [k for k, mover in enumerate(movers) if mover.group != "robot"]
        shown = [movers[k] for k in self._rows]
        marks, n = Marks(), len(shown)
        poses, colors = marks(7 * n).reshape(n, 7), marks(4 * n, np.float32).reshape(n, 4)
        self._heights = np.array([kind_of(mover.kind).height_m for mover in shown])
        self._reach = np.array([0.5 * m.radius if m.group == "door" else 0.0 for m in shown])
        markers = [
            _marker(mover, row, pose, color)
            for mover, row, pose, color in zip(shown, self._rows, poses, colors, strict=True)
        ]
        self._template = Template(self.KIND, message(self.KIND, markers=markers))
        self._poses, self._colors = self._template.index(poses), self._template.index(colors)
        self._placed = np.zeros((n, 7))
        self._palette = np.array([_RESTING, _MOVING], dtype=np.float32)

    def __call__(self, stamp_ns: int, all_poses: Float, moving: NDArray[np.bool_]) -> bytearray:
        """All markers as of that time; both arrays in the order of the scene's movers."""
        raw, rows = self._template.raw, self._rows
        if rows:
            _place(all_poses[rows], self._reach, self._heights, self._placed)
            raw[self._poses] = self._placed.view(np.uint8)
            colors = self._palette[moving[rows].astype(np.int64)]
            raw[self._colors] = colors.view(np.uint8)
        return self._template.stamp(stamp_ns)


def _marker(mover: Mover, row: int, pose: Float, color: NDArray[np.float32]) -> object:
    door, row_of = mover.group == "door", kind_of(mover.kind)
    height, half = row_of.height_m, row_of.half_length_m
    wide, deep = 2.0 * (half + mover.radius), 2.0 * mover.radius
    if door:
        wide, deep = mover.radius, LEAF_M
    return message(
        "visualization_msgs/msg/Marker",
        header=header(WORLD),
        ns=mover.kind,
        id=row,
        type=_CUBE if door or half > 0.0 else _CYLINDER,
        pose=pose,
        scale={"x": wide, "y": deep, "z": height},
        color=color,
        text=mover.name,
    )

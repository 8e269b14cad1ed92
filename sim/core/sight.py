# SPDX-License-Identifier: Apache-2.0
"""Out of view of a robot's scanners: behind what never moves, or outside their fields of view.

Only upright static boxes at the scanner's height hide anything (walls, cabinets): neither glass,
nor a table's legs, nor anything that moves. So what is said to be hidden truly is.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from scenes.footprint import HULL_GROUP, at_rest, static_geoms
from slam import se2
from slam._jit import njit
from slam.frames import Float, LaserSpec

RAYS = 2880  # of a whole turn: an eighth of a degree apart
NEAR_M = 1.2  # m from the laser to a hull: what is nearer counts as in view
SKIRT_M = 0.1  # m around a hull that must be hidden too
ASIDE_RAD = math.radians(20.0)  # beyond the edge of the field of view
SPOT_RAD = 0.02  # half the width of a beam, at most
SLACK_M = 0.1  # m a box must stand above and below the scan plane, as beams spread


class View(NamedTuple):
    """Scanners somewhere.

    eyes   (n, 5) x, y m and heading rad of the middle of each one's field of view, half of that
           field rad, reach of its beams m
    depth  (n, RAYS) m to the first static box by direction in the world
    """

    eyes: Float
    depth: Float


def nobody() -> View:
    """The view of nobody: everything is hidden."""
    return View(np.zeros((0, 5)), np.zeros((0, RAYS)))


@dataclass(frozen=True, kw_only=True, eq=False)
class Eye:
    """A scanner on its robot: pose of the middle of its view there, half the view rad, reach m."""

    mounted: Float
    half: float
    reach: float

    @classmethod
    def of(cls, spec: LaserSpec) -> "Eye":
        """The eye of a scanner."""
        half = min(0.5 * (spec.n_beams - 1) * abs(spec.angle_increment), math.pi)
        middle = spec.angle_min + 0.5 * (spec.n_beams - 1) * spec.angle_increment
        mounted = se2.compose(spec.T_robot_laser, np.array([0.0, 0.0, middle]))
        return cls(mounted=mounted, half=half, reach=float(spec.range_max))


def view_of(eyes: Sequence[Eye], robot: Float, boxes: Float) -> View:
    """From where the robot stands, (3,) m, m, rad, among ``opaque_boxes``."""
    at = [se2.compose(robot, eye.mounted).tolist() for eye in eyes]
    rows = [(*pose, eye.half, eye.reach) for pose, eye in zip(at, eyes, strict=True)]
    return View(np.array(rows), np.array([depths(x, y, boxes) for x, y, _ in at]))


def opaque_boxes(model: mujoco.MjModel, height: float, panes: NDArray[np.bool_]) -> Float:
    """(n, 5) static boxes that no beam at that height, m, gets past: x, y, half sizes m, yaw rad.

    panes  (ngeom,) True for glass
    """
    data = at_rest(model)
    rows = []
    for geom in static_geoms(model).tolist():
        turn: Any = data.geom_xmat[geom]
        upright = turn[8] > 1.0 - 1e-9
        box = model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_BOX
        above = abs(float(data.geom_xpos[geom, 2]) - height) + SLACK_M
        if not box or not upright or panes[geom] or above > float(model.geom_size[geom, 2]):
            continue
        material = model.geom_matid[geom]
        alpha = model.mat_rgba[material, 3] if material >= 0 else model.geom_rgba[geom, 3]
        if alpha < 1.0 or model.geom_group[geom] >= HULL_GROUP:
            continue
        yaw = math.atan2(float(turn[3]), float(turn[0]))
        rows.append((*data.geom_xpos[geom, :2], *model.geom_size[geom, :2], yaw))
    return np.array(rows, dtype=np.float64).reshape(-1, 5)


@njit
def depths(x: float, y: float, boxes: Float) -> Float:
    """(RAYS,) m from a point to the first box (n, 5) in each direction, inf where none is."""
    out = np.full(RAYS, math.inf)
    for b in range(len(boxes)):
        c, s = math.cos(boxes[b, 4]), math.sin(boxes[b, 4])
        dx, dy = x - boxes[b, 0], y - boxes[b, 1]
        u, v = c * dx + s * dy, c * dy - s * dx
        far = math.sqrt(dx * dx + dy * dy)
        size = math.sqrt(boxes[b, 2] ** 2 + boxes[b, 3] ** 2)
        first, count = 0, RAYS
        if far > size:  # only the rays that can meet it
            middle, wide = math.atan2(-dy, -dx), math.asin(size / far)
            first = math.floor((middle - wide) * RAYS / math.tau)
            count = math.ceil(2.0 * wide * RAYS / math.tau) + 2
        for k in range(first, first + count):
            angle = math.tau * k / RAYS - boxes[b, 4]
            along, across = math.cos(angle), math.sin(angle)
            low, high = 0.0, math.inf
            for at, step, half in ((u, along, boxes[b, 2]), (v, across, boxes[b, 3])):
                if abs(step) < 1e-12:
                    if abs(at) > half:
                        high = -1.0
                    continue
                a, z = (-half - at) / step, (half - at) / step
                low, high = max(low, min(a, z)), min(high, max(a, z))
            if low <= high:
                out[k % RAYS] = min(out[k % RAYS], low)
    return out


@njit
def hidden(view: View, x: float, y: float, radius: float) -> bool:
    """Whether nothing of a hull there can be seen, nor is it near."""
    for k in range(len(view.eyes)):  # noqa: SIM110 (kernel)
        if not _hidden(view.eyes[k], view.depth[k], x, y, radius):
            return False
    return True


@njit
def _hidden(eye: Float, depth: Float, x: float, y: float, radius: float) -> bool:
    dx, dy = x - eye[0], y - eye[1]
    far, reach = math.sqrt(dx * dx + dy * dy), radius + SKIRT_M
    if far < radius + NEAR_M:
        return False
    if far - reach > eye[4]:
        return True
    middle, wide = math.atan2(dy, dx), math.asin(reach / far) + SPOT_RAD
    off = middle - eye[2]
    off -= math.tau * math.floor(off / math.tau + 0.5)
    if abs(off) - wide > eye[3] + ASIDE_RAD:
        return True
    first = math.floor((middle - wide) * RAYS / math.tau)
    last = math.ceil((middle + wide) * RAYS / math.tau)
    for k in range(first, last + 1):  # noqa: SIM110 (kernel)
        if depth[k % RAYS] > far - reach:
            return False
    return True

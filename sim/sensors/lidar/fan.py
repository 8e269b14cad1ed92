# SPDX-License-Identifier: Apache-2.0
"""The beams of a scan in the world, and the tables that the caster's kernels share.

A fan is the beams of one sweep of the mirror, at about even steps of azimuth; an interlaced scan is
several of them. Every beam has its own time, hence its own origin and direction, because the robot
moves; and so do the things: poses are noted at the physics steps and are linear in between.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from slam._jit import njit

Float = NDArray[np.float64]
Int = NDArray[np.int64]
Vec3 = tuple[float, float, float]

# mjtGeom
PLANE, SPHERE, CAPSULE, ELLIPSOID, CYLINDER, BOX = 0, 2, 3, 4, 5, 6
PRIMITIVES = (PLANE, SPHERE, CAPSULE, ELLIPSOID, CYLINDER, BOX)
SLACK = 5e-5  # rad and m by which bounds are widened: above what ``_azimuth`` and rounding miss

# Columns of the geom table; the layer is 0 for the room, 1 for panes that a beam may pass.
KIND, SIZE_X, SIZE_Y, SIZE_Z, HALF_HEIGHT, UPRIGHT, LAYER, BODY = range(8)

# Columns of the plan of the fans: angle in the laser frame, its cosine and sine, the slot of the
# last noted poses before the beam, and which part of the way to the next slot it comes at.
ANGLE, ANGLE_COS, ANGLE_SIN, PLAN_SLOT, PLAN_PART = range(5)

# Columns of a laid fan, in the world: azimuth, origin, direction, slot and part as above.
AZIMUTH, ORIGIN_X, ORIGIN_Y, COS, SIN, SLOT, PART = range(7)

# Of each fan: first and last azimuth, beams per radian, and the largest departure of an azimuth
# from even steps.
START, STOP, PER_RADIAN, UNEVEN = range(4)

# Columns of the bounds: a disc that contains the geom during the whole scan, its height above
# the ground and half its vertical extent; and whether the geom moved.
DISC_X, DISC_Y, DISC_RADIUS, DISC_Z, DISC_HALF, MOVED = range(6)

# Columns of the windows: nearest and farthest distance at which the geom can be met, and the
# interval of azimuth, without the width of a spot.
NEAR, FAR, LOW, HIGH = range(4)


@njit
def _wrapped(angle: float) -> float:
    return angle - math.tau * math.floor(angle / math.tau + 0.5)


@njit
def _turned_by(delta: float) -> tuple[float, float]:
    """(cos, sin) of what a robot turns in a step: series to 1e-17 below 0.03 rad."""
    if abs(delta) > 0.03:
        return math.cos(delta), math.sin(delta)
    u = delta * delta
    c = 1.0 - u * (0.5 - u * (1.0 / 24.0 - u * (1.0 / 720.0 - u / 40320.0)))
    return c, delta * (
        1.0 - u * (1.0 / 6.0 - u * (1.0 / 120.0 - u * (1.0 / 5040.0 - u / 362880.0)))
    )


@njit
def lay_fans(plan: Float, lasers: Float, ends: Int, fan: Float, frames: Float) -> None:
    """Fill the (m, 7) table of the beams in the world, and the (fans, 4) frames of the fans.

    plan    (m, 5) of the beams; fan k has the rows ``ends[k]`` to ``ends[k + 1]``
    lasers  (slots, 3); the laser moves evenly between slots
    """
    slot, yaw, turn, cos_yaw, sin_yaw = -1, _wrapped(lasers[0, 2]), 0.0, 1.0, 0.0
    for i in range(plan.shape[0]):
        k, part = int(plan[i, PLAN_SLOT]), plan[i, PLAN_PART]
        if k < slot:  # the mirror turns clockwise
            slot, yaw = -1, _wrapped(lasers[0, 2])
        while slot < k:
            slot += 1
            if slot > 0:
                yaw += _wrapped(lasers[slot, 2] - lasers[slot - 1, 2])
            if slot == k:
                turn = _wrapped(lasers[slot + 1, 2] - lasers[slot, 2])
                cos_yaw, sin_yaw = math.cos(yaw), math.sin(yaw)
        c, s = cos_yaw, sin_yaw
        if turn != 0.0:
            a, b = _turned_by(part * turn)
            c, s = cos_yaw * a - sin_yaw * b, sin_yaw * a + cos_yaw * b
        a, b = plan[i, ANGLE_COS], plan[i, ANGLE_SIN]
        fan[i, COS], fan[i, SIN] = c * a - s * b, s * a + c * b
        fan[i, AZIMUTH] = yaw + part * turn + plan[i, ANGLE]
        fan[i, ORIGIN_X] = lasers[k, 0] + part * (lasers[k + 1, 0] - lasers[k, 0])
        fan[i, ORIGIN_Y] = lasers[k, 1] + part * (lasers[k + 1, 1] - lasers[k, 1])
        fan[i, SLOT], fan[i, PART] = plan[i, PLAN_SLOT], part
    for f in range(ends.size - 1):
        first, last = ends[f], ends[f + 1] - 1
        start, step, uneven = fan[first, AZIMUTH], 1.0, 0.0
        if last > first:
            step = (fan[last, AZIMUTH] - start) / (last - first)
        for i in range(first, last + 1):
            uneven = max(uneven, abs(fan[i, AZIMUTH] - start - (i - first) * step))
        frames[f, START], frames[f, STOP] = start, start + step * (last - first)
        frames[f, PER_RADIAN], frames[f, UNEVEN] = 1.0 / step, uneven + SLACK


@njit
def ray_wedge(frames: Float, slope: float) -> tuple[float, float]:
    """(lowest, highest) azimuth of any ray of the scan."""
    low, high = math.inf, -math.inf
    for f in range(frames.shape[0]):
        widen = frames[f, UNEVEN] + slope
        low, high = min(low, frames[f, START] - widen), max(high, frames[f, STOP] + widen)
    return low, high

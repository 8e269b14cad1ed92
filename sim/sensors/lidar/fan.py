# SPDX-License-Identifier: Apache-2.0
"""The beams of a scan in the world, and the tables that the caster's kernels share.

A fan is the beams of one sweep of the mirror, at about even steps of azimuth; an interlaced scan is
several of them. Every beam has its own time, hence its own origin and direction, because the robot
moves; and so do the things: poses are noted at the physics steps and are linear in between.
"""

import math

import numpy as np
from numpy.typing import NDArray

from sim.sensors.lidar import columns as col
from slam._jit import inner
from slam.frames import Float

Int = NDArray[np.int64]
Vec3 = tuple[float, float, float]

SLACK = 5e-5  # rad and m by which bounds are widened: above what ``_azimuth`` and rounding miss


@inner
def _wrapped(angle: float) -> float:
    return angle - math.tau * math.floor(angle / math.tau + 0.5)


@inner
def row_of(place: float, last: int) -> int:
    """The row of a table that a number falls into, 0 to ``last`` whatever the number."""
    if place < last:
        return int(place) if place > 0.0 else 0
    return last  # not a number, too


@inner
def _turned_by(delta: float) -> tuple[float, float]:
    """(cos, sin) of what a robot turns in a step: series to 1e-17 below 0.03 rad."""
    if abs(delta) > 0.03:
        return math.cos(delta), math.sin(delta)
    u = delta * delta
    c = 1.0 - u * (0.5 - u * (1.0 / 24.0 - u * (1.0 / 720.0 - u / 40320.0)))
    return c, delta * (
        1.0 - u * (1.0 / 6.0 - u * (1.0 / 120.0 - u * (1.0 / 5040.0 - u / 362880.0)))
    )


@inner
def lay_fans(plan: Float, lasers: Float, ends: Int, fan: Float, frames: Float) -> None:
    """Fill the (m, 7) table of the beams in the world, and the (fans, 4) frames of the fans.

    plan    of the beams; fan k has the rows ``ends[k]`` to ``ends[k + 1]``
    lasers  (slots, 3); the laser moves evenly between slots
    """
    slot, yaw, turn, cos_yaw, sin_yaw = -1, _wrapped(lasers[0, col.LASER_YAW]), 0.0, 1.0, 0.0
    for i in range(plan.shape[0]):
        k, part = int(plan[i, col.PLAN_SLOT]), plan[i, col.PLAN_PART]
        if k < slot:  # the mirror turns clockwise
            slot, yaw = -1, _wrapped(lasers[0, col.LASER_YAW])
        while slot < k:
            slot += 1
            if slot > 0:
                yaw += _wrapped(lasers[slot, col.LASER_YAW] - lasers[slot - 1, col.LASER_YAW])
            if slot == k:
                turn = _wrapped(lasers[slot + 1, col.LASER_YAW] - lasers[slot, col.LASER_YAW])
                cos_yaw, sin_yaw = math.cos(yaw), math.sin(yaw)
        c, s = cos_yaw, sin_yaw
        if turn != 0.0:
            a, b = _turned_by(part * turn)
            c, s = cos_yaw * a - sin_yaw * b, sin_yaw * a + cos_yaw * b
        a, b = plan[i, col.ANGLE_COS], plan[i, col.ANGLE_SIN]
        fan[i, col.COS], fan[i, col.SIN] = c * a - s * b, s * a + c * b
        fan[i, col.AZIMUTH] = yaw + part * turn + plan[i, col.ANGLE]
        x, y = lasers[k, col.LASER_X], lasers[k, col.LASER_Y]
        fan[i, col.ORIGIN_X] = x + part * (lasers[k + 1, col.LASER_X] - x)
        fan[i, col.ORIGIN_Y] = y + part * (lasers[k + 1, col.LASER_Y] - y)
        fan[i, col.SLOT], fan[i, col.PART] = plan[i, col.PLAN_SLOT], part
    for f in range(ends.size - 1):
        first, last = ends[f], ends[f + 1] - 1
        start, step, uneven = fan[first, col.AZIMUTH], 1.0, 0.0
        if last > first:
            step = (fan[last, col.AZIMUTH] - start) / (last - first)
        for i in range(first, last + 1):
            uneven = max(uneven, abs(fan[i, col.AZIMUTH] - start - (i - first) * step))
        frames[f, col.START], frames[f, col.STOP] = start, start + step * (last - first)
        frames[f, col.PER_RADIAN], frames[f, col.UNEVEN] = 1.0 / step, uneven + SLACK


@inner
def ray_wedge(frames: Float, slope: float) -> tuple[float, float]:
    """(lowest, highest) azimuth of any ray of the scan."""
    low, high = math.inf, -math.inf
    for f in range(frames.shape[0]):
        widen = frames[f, col.UNEVEN] + slope
        low, high = min(low, frames[f, col.START] - widen), max(high, frames[f, col.STOP] + widen)
    return low, high

# SPDX-License-Identifier: Apache-2.0
"""Numbers as ROS messages carry them, and back without loss.

Messages hold headings as quaternions and a scanner's geometry as float32. Read naively, neither
comes back as it was. Written and read by these functions, both do, bit for bit, while every other
reader sees the same message as ever.
"""

import math
from typing import Any

import numpy as np

from slam import se2
from slam.errors import InvalidValueError
from slam.frames import Float

MOST_POSE_M = 1e9  # from the origin of its frame, which may be that of a map of the earth
_NEARBY = [(i, j) for r in range(5) for i in range(-r, r + 1) for j in range(-r, r + 1)
           if max(abs(i), abs(j)) == r]  # fmt: skip


def yaw_of(x: float, y: float, z: float, w: float) -> float:
    """Heading of a quaternion, rad in [-pi, pi]; of its planar part where it tilts."""
    if x == 0.0 and y == 0.0:
        return se2.wrap(2.0 * math.atan2(z, w))
    return math.atan2(2.0 * (w * z + x * y), w * w + x * x - y * y - z * z)


def planar(pose: Any) -> Float:
    """(x m, y m, theta rad) of a geometry_msgs/Pose; ``InvalidValueError`` for what cannot be."""
    p, q = pose.position, pose.orientation
    if not max(abs(p.x), abs(p.y)) <= MOST_POSE_M or not math.isfinite(p.x + p.y):
        raise InvalidValueError(
            f"pose.position: expected a place within {MOST_POSE_M:g} m, got {p.x:g}, {p.y:g}"
        )
    if not math.isfinite(q.x + q.y + q.z + q.w):
        got = f"{q.x:g}, {q.y:g}, {q.z:g}, {q.w:g}"
        raise InvalidValueError(f"pose.orientation: expected finite numbers, got {got}")
    return np.array([p.x, p.y, yaw_of(q.x, q.y, q.z, q.w)])


def quaternion_of(theta: float) -> tuple[float, float]:
    """(z, w) that ``yaw_of`` reads as exactly ``theta`` (wrapped to [-pi, pi]).

    sin and cos of the half angle do, in two of three cases; in the others one of their neighbours
    a few units in the last place away does, which changes the heading by less than 1e-15 rad.
    """
    theta = se2.wrap(theta)
    z, w = math.sin(0.5 * theta), math.cos(0.5 * theta)
    if 2.0 * math.atan2(z, w) == theta:
        return z, w
    for i, j in _NEARBY:
        near_z, near_w = z + i * math.ulp(z), w + j * math.ulp(w)
        if 2.0 * math.atan2(near_z, near_w) == theta:
            return near_z, near_w
    return z, w


def round_number(value: float) -> float:
    """The shortest decimal that a float32 of ``value`` can mean: 8.182, not 8.18200016."""
    return float(str(np.float32(value)))


def round_angle(value: float) -> float:
    """The same for an angle in rad that was a round number of degrees."""
    wanted, degrees = np.float32(value), math.degrees(value)
    for digits in range(8):
        angle = math.radians(round(degrees, digits))
        if np.float32(angle) == wanted:
            return angle
    return float(wanted)


def round_period(value: float) -> float:
    """The same for a time in s that was one over a round number; 0 stays 0."""
    wanted = np.float32(value)
    if wanted <= 0.0:
        return 0.0
    for digits in range(6):
        rate = round(1.0 / float(wanted), digits)
        if rate > 0.0 and np.float32(1.0 / rate) == wanted:
            return 1.0 / rate
    return float(wanted)

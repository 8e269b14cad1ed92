# SPDX-License-Identifier: Apache-2.0
"""De-skew: the end point of a beam where the robot was at the scan's stamp, once for all."""

import math

import numpy as np

from slam._jit import inner, njit
from slam.arrays import Float


@inner
def deskewed(x: float, y: float, offset: float, twist: Float) -> tuple[float, float]:
    """The point (x, y) m, seen ``offset`` s after the stamp, in the robot frame of the stamp.

    ``twist`` is the body velocity (vx, vy, omega), m/s and rad/s, held over the sweep. Mid-point
    rule: exact to third order in the turned angle.
    """
    if offset == 0.0:
        return x, y
    turn = twist[2] * offset
    c, s = math.cos(0.5 * turn), math.sin(0.5 * turn)
    mx = (c * twist[0] - s * twist[1]) * offset
    my = (s * twist[0] + c * twist[1]) * offset
    c, s = math.cos(turn), math.sin(turn)
    return c * x - s * y + mx, s * x + c * y + my


@njit
def end_points(
    ranges: Float, angles: Float, offsets: Float, T_robot_laser: Float, twist: Float
) -> Float:
    """(n, 2) m ends of beams in the robot frame of the stamp, each sent ``offsets`` s after it.

    NaN where a range is. Compiled: the last bit of NumPy's sines changes with the CPU.
    """
    out = np.empty((len(ranges), 2))
    for k in range(len(ranges)):
        angle = angles[k] + T_robot_laser[2]
        x = T_robot_laser[0] + ranges[k] * math.cos(angle)
        y = T_robot_laser[1] + ranges[k] * math.sin(angle)
        out[k, 0], out[k, 1] = deskewed(x, y, offsets[k], twist)
    return out

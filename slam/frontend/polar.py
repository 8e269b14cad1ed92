# SPDX-License-Identifier: Apache-2.0
"""Compiled distances and angles of many points, whose last bit NumPy's change with the CPU."""

import math

import numpy as np

from slam._jit import inner, njit
from slam.arrays import Bools, Float

BEARING_OFF = 2e-5  # rad, more than ``bearing`` is ever off: 1.15e-5


@inner
def bearing(x: float, y: float) -> float:
    """atan2(y, x) to within ``BEARING_OFF``, several times as fast: to decide what is far from
    a limit (Abramowitz and Stegun 1964, 4.4.49)."""
    wide, high = abs(x), abs(y)
    t = min(wide, high) / max(wide, high, 1e-300)
    q = t * t
    turn = 0.1801410 + q * (-0.0851330 + q * 0.0208351)
    turn = t * (0.9998660 + q * (-0.3302995 + q * turn))
    if high > wide:
        turn = 0.5 * math.pi - turn
    if x < 0.0:
        turn = math.pi - turn
    return math.copysign(turn, y)


@inner
def bin_of(x: float, y: float, step: float, shift: float) -> int:
    """floor(atan2(y, x) / step + shift), by ``bearing`` where that decides it."""
    turns = bearing(x, y) / step + shift
    k, slack = math.floor(turns), BEARING_OFF / step
    if slack < turns - k < 1.0 - slack:
        return k
    return math.floor(math.atan2(y, x) / step + shift)


@njit
def polar(points: Float) -> tuple[Float, Float]:
    """Distances (n,) m and bearings (n,) rad of points (n, 2)."""
    distances, bearings = np.empty(len(points)), np.empty(len(points))
    for k in range(len(points)):
        x, y = points[k, 0], points[k, 1]
        distances[k] = math.sqrt(x * x + y * y)
        bearings[k] = math.atan2(y, x)
    return distances, bearings


@njit
def hidden(landmarks: Float, points: Float, width: float) -> Bools:
    """(n,) landmarks (n, 2) behind one of the points (k, 2): within the angle that ``width`` (m)
    fills at the point's distance, and farther than it by as much."""
    out = np.zeros(len(landmarks), dtype=np.bool_)
    distances, bearings = polar(landmarks)
    reach, towards = polar(points)
    for k in range(len(points)):
        shadow = math.asin(min(width / max(reach[k], width), 1.0))
        for i in range(len(landmarks)):
            turn = towards[k] - bearings[i]
            turn = abs(turn - 2.0 * math.pi * round(turn / (2.0 * math.pi)))
            if turn < shadow and reach[k] + width < distances[i]:
                out[i] = True
    return out

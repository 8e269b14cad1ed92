# SPDX-License-Identifier: Apache-2.0
"""Straight walls and smooth surfaces in one scan, and how far each range is off them.

A straight line at distance d, whose normal points to a, is at range r = d / cos(phi - a): 1 / r is
linear in cos(phi) and sin(phi). Weighted by r^4, the residuals are those of the ranges themselves.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slam.frames import Float

Int = NDArray[np.int64]

LEAST_BEAMS = 12  # of a wall
LEAST_LENGTH_M = 0.8
SPLIT_M = 0.05  # m off the line, at right angles to it, from which it is no straight wall
MOST_INCIDENCE = math.radians(70.0)  # rad from the normal; beyond, the spot smears over the wall
LOST_BEAMS = 2  # beams without a return in a row that a wall may have
JUMP_M = 0.2  # m between neighbours, beside what an oblique wall has
BESIDE = 2  # beams
SMOOTH_M = 0.03  # m off their line: neither an edge nor clutter
ENDS = 1  # beams left out at each end: corners and mixed pixels


@dataclass(frozen=True, kw_only=True, eq=False)
class Wall:
    """``beams`` (k,) numbers of those that returned from it, in order.

    ranges, residuals  (k,) m: measured, and measured less the line's
    incidence          (k,) rad between beam and normal
    holes              beams between its first and its last without a return
    """

    beams: Int
    ranges: Float
    residuals: Float
    incidence: Float
    holes: int

    @property
    def freedom(self) -> int:
        """Ranges less the two numbers of the line."""
        return len(self.beams) - 2

    @property
    def variance(self) -> float:
        """m^2 of a range about the line."""
        return float((self.residuals**2).sum()) / self.freedom


def walls(ranges: Float, angles: Float, split_m: float = SPLIT_M) -> list[Wall]:
    """Straight walls in (n,) ranges m at (n,) rad, NaN where nothing came back."""
    found = []
    for beams in _connected(ranges, angles):
        for part in _straight(ranges, angles, beams, split_m):
            wall = _wall(ranges, angles, part[ENDS : len(part) - ENDS])
            if wall is not None:
                found.append(wall)
    return found


def smooth(ranges: Float, angles: Float) -> tuple[Int, Float]:
    """(k,) beams that lie on one line with ``BESIDE`` more on either side; (k,) rad of incidence.

    Within ``SMOOTH_M`` of that line, at right angles to it, and not more oblique than a wall.
    """
    beams, incidence = [], []
    for at in range(BESIDE, len(ranges) - BESIDE):
        around = slice(at - BESIDE, at + BESIDE + 1)
        own = ranges[around]
        if not np.isfinite(own).all():
            continue
        line, cosines = _line(own, angles[around])
        level = np.abs(own - line) * cosines <= SMOOTH_M
        if level.all() and cosines[BESIDE] >= math.cos(MOST_INCIDENCE):
            beams.append(at)
            incidence.append(math.acos(cosines[BESIDE]))
    return np.array(beams, dtype=np.int64), np.array(incidence)


def _connected(ranges: Float, angles: Float) -> Iterator[Int]:
    """Groups of beams that may lie on one surface."""
    seen = np.flatnonzero(np.isfinite(ranges))
    if len(seen) < LEAST_BEAMS:
        return
    r, gap = ranges[seen], np.diff(seen)
    turned = np.diff(angles[seen])
    oblique = np.minimum(r[1:], r[:-1]) * turned * math.tan(MOST_INCIDENCE)
    apart = (gap > LOST_BEAMS + 1) | (np.abs(np.diff(r)) > JUMP_M + oblique)
    for group in np.split(seen, np.flatnonzero(apart) + 1):
        if len(group) >= LEAST_BEAMS + 2 * ENDS:
            yield group


def _straight(ranges: Float, angles: Float, beams: Int, split_m: float) -> Iterator[Int]:
    """Split at the beam farthest from the chord until all lie near their line."""
    waiting = [beams]
    while waiting:
        part = waiting.pop()
        if len(part) < LEAST_BEAMS + 2 * ENDS:
            continue
        own, toward = ranges[part], angles[part]
        line, cosines = _line(own, toward)
        if (np.abs(own - line) * cosines)[ENDS:-ENDS].max() <= split_m:
            yield part
            continue
        # of the inner points, the one farthest from the chord
        x = own * np.cos(toward)
        y = own * np.sin(toward)
        across = (x - x[0]) * (y[-1] - y[0]) - (y - y[0]) * (x[-1] - x[0])
        at = 1 + int(np.argmax(np.abs(across[1:-1])))
        waiting += [part[:at], part[at:]]


def _line(ranges: Float, angles: Float) -> tuple[Float, Float]:
    """(k,) ranges m of the fitted line, (k,) cosines of incidence."""
    weight = ranges * ranges
    design = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    a, b = np.linalg.lstsq(design * weight[:, None], weight / ranges, rcond=None)[0]
    inverse = design @ np.array([a, b])
    cosines = np.clip(inverse / math.hypot(a, b), 1e-6, 1.0)
    return 1.0 / np.maximum(inverse, 1e-6), cosines


def _wall(ranges: Float, angles: Float, beams: Int) -> Wall | None:
    """The wall of those beams without its too oblique part; None where too little is left."""
    own, toward = ranges[beams], angles[beams]
    _, cosines = _line(own, toward)
    keep = cosines >= math.cos(MOST_INCIDENCE)
    beams, own, toward = beams[keep], own[keep], toward[keep]
    if len(beams) < LEAST_BEAMS:
        return None
    x, y = own * np.cos(toward), own * np.sin(toward)
    if math.hypot(x[-1] - x[0], y[-1] - y[0]) < LEAST_LENGTH_M:
        return None
    line, cosines = _line(own, toward)
    span = int(beams[-1] - beams[0]) + 1
    return Wall(
        beams=beams, ranges=own, residuals=own - line, incidence=np.arccos(cosines),
        holes=span - len(beams),
    )  # fmt: skip

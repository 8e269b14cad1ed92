# SPDX-License-Identifier: Apache-2.0
"""What the present scan can see of the map (section 3.3): how far each direction is free.

A neuron is hidden when the line from the laser to it passes through an observation. De-skewed beams
of an interlaced scanner are not in order of bearing, so they are sorted into bins round the circle.
"""

import math
from typing import NamedTuple

import numpy as np

from slam._jit import inlined, inner, uncounted
from slam.arrays import Float
from slam.frontend.polar import BEARING_OFF, bearing, bin_of

MARGIN_CELLS = 1.5  # cells; a cell seen empty is before a beam's end by this; set by hand
GATE_CELLS = 0.6  # cells; a cell seen empty is this near to a beam, sideways; set by hand
SILENT_M = 30.0  # m, free space that a beam without return shows; LMS-221: its range at 10 %
FEATURE_BIN_DEG = 1.0  # step of the view between point features; set by hand
FEATURE_GAP_DEG = 60.0  # widest gap between features that is seen empty; set by hand


class View(NamedTuple):
    """Free range by bearing about the laser, in laser axes.

    step      rad between bins; bin k is centred at k * step
    limit     (bins,) m: least range of the bin and its two neighbours, 0 where none was measured;
              three, so that a wall seen at a grazing angle is not worn away
    offset    (bins,) bearing of the bin's nearest beam minus the bin's centre, in bins
    farthest  m, longest free range
    margin    m a neuron must be nearer than the limit to be seen empty
    gate      m a neuron may lie beside the nearest beam to be seen by it
    """

    step: float
    limit: Float
    offset: Float
    farthest: float
    margin: float
    gate: float


@uncounted
def fill(
    bearings: Float, ranges: Float, step: float, limit: Float, offset: Float, least: Float
) -> float:
    """Limits and offsets of a ``View`` from beams in any order; the longest of their free ranges.

    ``least`` (at least bins): room to work in.
    """
    bins = len(limit)
    for k in range(bins):
        least[k] = offset[k] = math.inf
    farthest = 0.0
    for beam in range(len(bearings)):
        if ranges[beam] <= 0.0:
            continue
        turns = bearings[beam] / step
        k = math.floor(turns + 0.5)
        off = turns - k
        k %= bins
        least[k] = min(least[k], ranges[beam])
        farthest = max(farthest, ranges[beam])
        if abs(off) < abs(offset[k]):
            offset[k] = off
    for k in range(bins):
        nearest = min(least[k - 1], least[k], least[(k + 1) % bins])
        limit[k] = nearest if nearest < math.inf else 0.0
    return farthest


def view_of_beams(bearings: Float, free_ranges: Float, increment: float, cell: float) -> View:
    """Sort beams (bearing rad, free range m; 0: not measured) into bins of about ``increment``."""
    bins = np.empty((2, n_bins(increment)))
    step = math.tau / bins.shape[1]
    farthest = fill(bearings, free_ranges, step, bins[0], bins[1], np.empty(bins.shape[1]))
    return view_of_bins(bins, farthest, cell)


def n_bins(increment: float) -> int:
    """Bins of about ``increment`` rad round the circle."""
    return max(8, math.floor(math.tau / increment + 1e-6))


def view_of_bins(bins: Float, farthest: float, cell: float) -> View:
    """Of limits and offsets (2, bins) that ``fill`` gave."""
    margin, gate = MARGIN_CELLS * cell, GATE_CELLS * cell
    return View(math.tau / bins.shape[1], bins[0], bins[1], farthest, margin, gate)


def view_of_features(points: Float, cell: float) -> View:
    """What a frame of point features (n, 2) m sees: the sectors between neighbours, as far as the
    farther of the two, and nothing behind a feature.
    """
    order = sorted((math.atan2(y, x), math.hypot(x, y)) for x, y in points.tolist())
    bearings: list[float] = []
    ranges: list[float] = []
    step, widest = math.radians(FEATURE_BIN_DEG), math.radians(FEATURE_GAP_DEG)
    for (b0, r0), (b1, r1) in zip(order, order[1:] + order[:1], strict=True):
        gap = (b1 - b0) % math.tau
        bearings.append(b0)
        ranges.append(r0)
        if gap <= widest:
            between = np.arange(step, gap, step)
            bearings += (b0 + between).tolist()
            ranges += [max(r0, r1)] * len(between)
    view = view_of_beams(np.array(bearings), np.array(ranges), step, cell)
    return view._replace(gate=math.inf)


@inlined
def _beside(view: View, turns: float, r: float) -> float:
    """How far (m) beside the nearest beam a place at range r is, so many bins round; -1: hidden."""
    bins = len(view.limit)
    k = math.floor(turns + 0.5)
    off = turns - k
    if k < 0:
        k += bins
    elif k >= bins:
        k -= bins
    if r >= view.limit[k] - view.margin:
        return -1.0
    after = view.offset[k + 1 if k + 1 < bins else 0] + 1.0
    before = view.offset[k - 1 if k > 0 else bins - 1] - 1.0
    nearest = min(abs(off - view.offset[k]), abs(off - before), abs(off - after))
    return float(nearest * view.step * r)


@inlined
def seen_empty(view: View, dx: float, dy: float, free: float) -> bool:
    """True where a beam passed by (dx, dy) (m, from the laser, laser axes) without stopping.

    ``free``: m, no beam near there went farther, see ``free_around``.
    """
    r = math.sqrt(dx * dx + dy * dy)
    if r >= free - view.margin:
        return False
    turns = bearing(dx, dy) / view.step
    if abs(turns - math.floor(turns + 0.5)) < 0.5 - BEARING_OFF / view.step:
        beside = _beside(view, turns, r)  # in this bin, and not in its neighbour
        if beside < 0.0 or abs(beside - view.gate) > BEARING_OFF * r:
            return 0.0 <= beside <= view.gate
    return 0.0 <= _beside(view, math.atan2(dy, dx) / view.step, r) <= view.gate


@inner
def free_around(view: View, dx: float, dy: float, half: float) -> float:
    """Longest free range (m) in the bins of what is within ``half`` m of (dx, dy): none of it can
    be in view where that is no longer than the way to there. 0 where no beam comes so far.
    """
    r = math.sqrt(dx * dx + dy * dy)
    if r - half >= view.farthest:
        return 0.0
    bins = len(view.limit)
    spread = bins
    if r > 2.0 * half:
        spread = int(half / r / view.step * 1.1) + 2
    if 2 * spread + 1 >= bins:
        return view.farthest
    m = bin_of(dx, dy, view.step, 0.5) - spread
    if m < 0:
        m += bins
    longest = 0.0
    for _ in range(2 * spread + 1):
        longest = max(longest, view.limit[m])
        m = m + 1 if m + 1 < bins else 0
    return longest

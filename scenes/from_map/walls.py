# SPDX-License-Identifier: Apache-2.0
"""Occupied cells as few long boxes."""

import heapq
import math
from itertools import pairwise

import cv2
import numpy as np
from numpy.typing import NDArray

from scenes.from_map.thin import chains, thinned
from slam.errors import InvalidValueError
from slam.frames import Float

Mask = NDArray[np.bool_]

SHELL_M = 0.11  # of what is solid, only so much below its surface is built: nothing sees the rest
REACH_M = 0.10  # cells that far to the side of a line are of its wall
THIN_M, THICK_M = 0.02, 0.08  # half thickness of a wall
LONG_M = 0.3  # a box that is longer is no dot of a dotted wall
DOTS, ROW_M, GAP_M = 6, 0.6, 0.35  # cells of a dotted wall, its least length, its widest gap
DENSE = 0.75  # share of a dotted wall that is within ROW_REACH_M of its cells
ROW_REACH_M = 0.05  # as REACH_M, of a dotted wall
COVER_M = 0.05  # a cell so near to a box is built
ENOUGH, FEW_ENOUGH = 0.97, 0.96  # share of the cells that is, at least; and with few boxes
JOINS = 2  # rounds in which boxes of one line become one
ASIDE_M = 0.10  # an end of a box so far off the line of another is on it
BARE = 1  # cells with nothing occupied beside them that a joined box may add
BRIDGE_M = 0.13  # gaps up to that, in a wall seen now and then, are closed
MAX_WALL_M, MOST_WALLS = 5000.0, 9000  # of a plan; ten times that of the largest log, in boxes
MAX_LINE_M, MOST_LINES = 6000.0, 15_000  # of its middle lines, before they are straight


def disc(metres: float, cell_m: float) -> NDArray[np.uint8]:
    """A disc of that diameter for OpenCV's morphology."""
    n = max(1, 2 * round(0.5 * metres / cell_m) + 1)
    return np.asarray(cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (n, n)), dtype=np.uint8)


def bridged(occupied: Mask, cell_m: float) -> Mask:
    """Occupied cells, and the gaps of dotted walls between them."""
    ones = np.pad(occupied.astype(np.uint8), 8)
    closed = cv2.morphologyEx(ones, cv2.MORPH_CLOSE, disc(BRIDGE_M, cell_m))
    return np.asarray(closed[8:-8, 8:-8] > 0)


def skin(occupied: Mask, cell_m: float) -> Mask:
    """Occupied cells less those deep inside what is solid."""
    padded = np.pad(occupied.astype(np.uint8), 1)
    deep = cv2.distanceTransform(padded, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)[1:-1, 1:-1]
    return np.asarray(occupied & (deep * cell_m <= max(SHELL_M, 1.5 * cell_m)))


def boxes_of(occupied: Mask, cell_m: float, tolerance_m: float, *, few: bool) -> Float:
    """(n, 5) boxes cx, cy, half length, half thickness m, yaw rad, in the frame of the cells.

    The middle lines of walls, straightened until they would be off by ``tolerance_m``; each box
    then takes the place and the thickness of the cells beside it. With ``few``, boxes that lie on
    one line and touch become one, where it is no barer than they are. Raises ``InvalidValueError``
    for more lines than any building has.
    """
    hollow, occupied = skin(bridged(occupied, cell_m), cell_m), skin(occupied, cell_m)
    around = _Around(occupied, cell_m)
    middle = thinned(hollow)
    _check(MAX_LINE_M, float(middle.sum()) * cell_m, "m of middle lines of walls")
    lines = chains(middle)
    _check(MOST_LINES, len(lines), "pieces of lines of walls")
    found = []
    for chain in lines:
        points = np.array(chain, dtype=np.int32)[:, ::-1].reshape(-1, 1, 2)
        for share in (0.5, 1.0, 1.5):
            corners = cv2.approxPolyDP(points, share * tolerance_m / cell_m, closed=False)
            line = (corners.reshape(-1, 2) + 0.5) * cell_m
            if len(line) == 1:
                line = np.vstack([line, line])
            for a, b in pairwise(line):
                box = around.box(a, b)
                if box is not None:
                    found.append(box)
    drawn = np.array(found, dtype=np.float64).reshape(-1, 5)
    near = cv2.dilate(occupied.astype(np.uint8), disc(2.0 * ROW_REACH_M, cell_m))
    pool: Float = np.vstack([drawn, _dotted(drawn, around, occupied, near, cell_m)])
    if not few:
        return _needed(pool, occupied, cell_m, ENOUGH)
    for _ in range(JOINS):
        kept = _needed(pool, occupied, cell_m, FEW_ENOUGH)
        pool = np.vstack([kept, _joined(kept, around, near, cell_m)])
    return _needed(pool, occupied, cell_m, FEW_ENOUGH)


def _check(most: float, found: float, what: str) -> None:
    if found > most:
        raise InvalidValueError(f"{found:.0f} {what}, expected at most {most:g}")


def _joined(boxes: Float, around: "_Around", near: NDArray[np.uint8], cell_m: float) -> Float:
    """Boxes for two that lie on one line and touch; ``near``: cells beside what is occupied."""
    ahead = np.column_stack([np.cos(boxes[:, 4]), np.sin(boxes[:, 4])])
    ends = boxes[:, None, :2] + boxes[:, 2, None, None] * ahead[:, None] * [[-1.0], [1.0]]
    bare = np.array([_bare(box, near, cell_m) for box in boxes])
    found = []
    for k, box in enumerate(boxes):
        away = np.hypot(*(boxes[:, :2] - box[:2]).T)
        close = np.flatnonzero(away <= boxes[:, 2] + box[2] + BRIDGE_M + 2.0 * ASIDE_M)
        off = ends[close] - box[:2]
        u = off[..., 0] * ahead[k, 0] + off[..., 1] * ahead[k, 1]
        v = off[..., 1] * ahead[k, 0] - off[..., 0] * ahead[k, 1]
        low, high, half = u.min(axis=1), u.max(axis=1), box[2]
        touches = (low <= half + BRIDGE_M) & (high >= -half - BRIDGE_M)
        longer = (low < -half) | (high > half)
        on = (abs(v).max(axis=1) <= ASIDE_M) & touches & longer & (boxes[close, 2] <= half)
        own = u[int(np.searchsorted(close, k))]
        for at in np.flatnonzero(on).tolist():
            other = int(close[at])
            both, along = np.vstack([ends[k], ends[other]]), np.hstack([own, u[at]])
            new = around.box(both[along.argmin()], both[along.argmax()])
            if new is None:
                continue
            if _bare(np.array(new), near, cell_m) <= bare[k] + bare[other] + BARE:
                found.append(new)
    return np.array(found, dtype=np.float64).reshape(-1, 5)


def _bare(box: Float, near: NDArray[np.uint8], cell_m: float) -> int:
    """Cells of a box with nothing occupied beside them."""
    window, inside = footprint(box, near.shape, cell_m)
    return int((inside & (1 - near[window])).sum())


def _dotted(
    boxes: Float, around: "_Around", occupied: Mask, near: NDArray[np.uint8], cell_m: float
) -> Float:
    """Boxes along straight rows of cells, with gaps, that no long box covers."""
    left = occupied.astype(np.uint8)
    for box in boxes[2.0 * boxes[:, 2] > LONG_M]:
        window, inside = footprint(box, left.shape, cell_m, COVER_M)
        left[window] &= 1 - inside
    lines = cv2.HoughLinesP(
        left, 1, math.pi / 360.0, DOTS, minLineLength=ROW_M / cell_m, maxLineGap=GAP_M / cell_m
    )
    if lines is None:
        return np.zeros((0, 5))
    ends = (np.asarray(lines, dtype=np.float64).reshape(-1, 2, 2) + 0.5) * cell_m
    rows = []
    for a, b in ends:
        box = around.box(a, b, ROW_REACH_M)
        if box is None:
            continue
        window, inside = footprint(np.array(box), left.shape, cell_m)
        if (near[window] & inside).sum() >= DENSE * inside.sum():
            rows.append(box)
    return np.array(rows).reshape(-1, 5)


def _needed(boxes: Float, occupied: Mask, cell_m: float, enough: float) -> Float:
    """Few of those boxes, the best first: all long ones, and ``enough`` of the cells."""
    number = np.full(occupied.shape, -1, dtype=np.int32)
    number[occupied] = np.arange(int(occupied.sum()))
    cells, covered = [], np.zeros(int(occupied.sum()), dtype=bool)
    for box in boxes:
        window, inside = footprint(box, number.shape, cell_m, COVER_M)
        under = number[window][inside > 0]
        cells.append(under[under >= 0])
    queue = [(-len(own), k) for k, own in enumerate(cells)]
    heapq.heapify(queue)
    kept: list[int] = []
    while queue:
        _, k = heapq.heappop(queue)
        gain = int((~covered[cells[k]]).sum())
        if gain == 0 or (queue and -gain > queue[0][0]):  # another one has become better
            if gain:
                heapq.heappush(queue, (-gain, k))
            continue
        if gain * cell_m < LONG_M and covered.sum() >= enough * len(covered):
            break
        covered[cells[k]] = True
        kept.append(k)
    return boxes[sorted(kept)]


def footprint(
    box: Float, shape: tuple[int, ...], cell_m: float, more_m: float = 0.0
) -> tuple[tuple[slice, slice], NDArray[np.uint8]]:
    """Rows and columns around a box made larger by ``more_m``, and which cells it holds."""
    x, y, a, b, yaw = box.tolist()
    c, s, a, b = math.cos(yaw), math.sin(yaw), a + more_m, b + more_m
    reach = np.array([abs(a * c) + abs(b * s), abs(a * s) + abs(b * c)])
    low = np.floor((np.array([x, y]) - reach) / cell_m).astype(int)
    high = np.ceil((np.array([x, y]) + reach) / cell_m).astype(int)
    rows = slice(max(int(low[1]), 0), max(min(int(high[1]), shape[0]), 0))
    columns = slice(max(int(low[0]), 0), max(min(int(high[0]), shape[1]), 0))
    i, j = np.ogrid[rows, columns]
    dx, dy = (j + 0.5) * cell_m - x, (i + 0.5) * cell_m - y
    inside = (abs(c * dx + s * dy) <= a) & (abs(c * dy - s * dx) <= b)
    return (rows, columns), inside.astype(np.uint8)


class _Around:
    """Occupied cells by place."""

    def __init__(self, occupied: Mask, cell_m: float) -> None:
        self._occupied, self._cell = occupied, cell_m

    def box(self, a: Float, b: Float, reach_m: float = REACH_M) -> list[float] | None:
        """The box of the cells along a line from ``a`` to ``b``; None where there are none."""
        length = math.hypot(*(b - a).tolist())
        ahead = (b - a) / length if length > 0.0 else np.array([1.0, 0.0])
        left = np.array([-ahead[1], ahead[0]])
        low = np.floor((np.minimum(a, b) - reach_m) / self._cell).astype(int)
        high = np.ceil((np.maximum(a, b) + reach_m) / self._cell).astype(int)
        x0, y0 = max(int(low[0]), 0), max(int(low[1]), 0)
        rows, columns = np.nonzero(self._occupied[y0 : int(high[1]), x0 : int(high[0])])
        cells = (np.column_stack([columns + x0, rows + y0]) + 0.5) * self._cell - a
        u, v = (cells * ahead).sum(axis=1), (cells * left).sum(axis=1)
        end = 0.5 * self._cell
        own = (abs(v) <= reach_m) & (u >= -REACH_M) & (u <= length + REACH_M)
        if not own.any():
            return None
        u, v = u[own], v[own]
        first, last = min(float(u.min()) - end, -end), max(float(u.max()), length) + end
        slope = _slope(u, v) if length > 0.4 else 0.0
        offsets = v - slope * (u - 0.5 * length)
        near, far = _quantiles(offsets, (0.12, 0.88))
        half = min(max(0.5 * (far - near) + 0.3 * self._cell, THIN_M), THICK_M)
        middle = a + 0.5 * (first + last) * ahead + 0.5 * (near + far) * left
        yaw = math.atan2(ahead[1], ahead[0]) + math.atan(slope)
        return [*middle.tolist(), 0.5 * (last - first), half, yaw]


def _quantiles(values: Float, shares: tuple[float, ...]) -> list[float]:
    """As ``np.quantile``, to the bit, in a fifth of its time."""
    ordered, found = np.sort(values).tolist(), []
    for share in shares:
        at = share * (len(ordered) - 1)
        k = min(int(at), max(len(ordered) - 2, 0))
        low, high, part = ordered[k], ordered[min(k + 1, len(ordered) - 1)], at - k
        step = high - low
        found.append(high - step * (1.0 - part) if part >= 0.5 else low + step * part)
    return found


def _slope(u: Float, v: Float) -> float:
    """Of the straight line through (u, v), least squares."""
    du = u - u.mean()
    spread = float((du * du).sum())
    return float((du * (v - v.mean())).sum()) / spread if spread > 0.0 else 0.0

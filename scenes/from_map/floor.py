# SPDX-License-Identifier: Apache-2.0
"""Free floor as rooms, spots to visit and passages between rooms."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from slam._jit import njit
from slam.errors import InvalidValueError
from slam.frames import Float

Mask = NDArray[np.bool_]
Rect = tuple[float, float, float, float]
Point = tuple[float, float]

ROBOT_M = 0.26  # radius of the scenes' own robot
MARGIN_M = 0.1  # from a robot to what it must not touch, as in ``scenes.arrangement``
GOAL_M = 0.6  # of floor round a spot to visit, of the scenes' own robot
ROOM_M = 0.65  # half the width of floor that is no passage
GOALS_M = 4.0  # from one spot to visit to the next, at least; less on floor of under 64 m2
MAX_GOALS = 20
LEAST_M2 = 2.0  # of floor that the robot can reach
ANOTHER = "where a smaller one drives, say so by FromMap.robot_m; "
WALLED = 0.4  # share of a room's edge that is wall
CELL_M = 0.1  # on which rooms are cut into rectangles
RECT_M = 0.4  # least side of such a rectangle
MAX_RECTS, ROOM_RECTS = 300, 60  # rectangles of a plan, of a room


@dataclass(frozen=True, kw_only=True)
class Passage:
    """A way from one room to another that is narrower than both.

    at       x m, y m of its middle; rad of the line from side to side
    wide_m   between its sides          rooms  the two it connects
    """

    at: tuple[float, float, float]
    wide_m: float
    rooms: tuple[int, int]


def clearance(free: Mask, cell_m: float) -> Float:
    """m from each cell to what is not free; beyond the picture nothing is."""
    padded = np.pad(free.astype(np.uint8), 1)
    far = cv2.distanceTransform(padded, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)[1:-1, 1:-1]
    return np.asarray(np.maximum(far.astype(np.float64) - 0.5, 0.0) * cell_m)


def reachable(clear: Float, at: tuple[int, int], robot_m: float) -> Mask:
    """Cells that the middle of a robot of that radius can get to from a cell."""
    wide = (clear >= robot_m + MARGIN_M).astype(np.uint8)
    _, labels = cv2.connectedComponents(wide, connectivity=4)
    return np.asarray(labels == labels[at]) if labels[at] else np.zeros(clear.shape, dtype=bool)


def start_cell(
    clear: Float, wanted: tuple[int, int] | None, robot_m: float, source: str
) -> tuple[int, int]:
    """Where the robot starts: there if there is room, else the middle of the largest floor."""
    wide = clear >= robot_m + MARGIN_M
    if wanted is not None and wide[wanted]:
        return wanted
    n, labels, stats, _ = cv2.connectedComponentsWithStats(wide.astype(np.uint8), connectivity=4)
    if n < 2:
        raise InvalidValueError(
            f"{source}: no free floor where {in_words(robot_m)} has room; {ANOTHER}expected rooms "
            "of free cells inside walls of occupied ones (is it a map, are its thresholds right?)"
        )
    largest = 1 + int(np.argmax(stats[1:, cv2.CC_STAT_AREA]))
    own = np.where(labels == largest, clear, 0.0)
    row, column = np.unravel_index(int(np.argmax(own)), own.shape)
    return int(row), int(column)


def in_words(robot_m: float) -> str:
    """A robot as errors call it."""
    return f"a robot of {robot_m:.3g} m radius, {MARGIN_M:g} m from all walls,"


def spots(
    clear: Float, floor: Mask, first: tuple[int, int], cell_m: float, robot_m: float = ROBOT_M
) -> list[tuple[int, int]]:
    """Cells to visit, wide places first, each some metres from the others and from the start."""
    left = np.where(floor & (clear >= GOAL_M - (ROBOT_M - robot_m)), np.minimum(clear, 2.0), 0.0)
    if not left.any():
        left = np.where(floor, clear, 0.0)
    found: list[tuple[int, int]] = []
    area = float(floor.sum()) * cell_m * cell_m
    apart = min(max(GOALS_M, math.sqrt(area / MAX_GOALS)), 0.5 * math.sqrt(area))
    away = round(apart / cell_m)
    _clear_around(left, first, away // 2)
    while len(found) < MAX_GOALS and left.any():
        row, column = np.unravel_index(int(np.argmax(left)), left.shape)
        found.append((int(row), int(column)))
        _clear_around(left, found[-1], away)
    if not found:  # one small room: its far end
        rows, columns = np.nonzero(floor)
        k = int(np.argmax((rows - first[0]) ** 2 + (columns - first[1]) ** 2))
        found.append((int(rows[k]), int(columns[k])))
    return found


def _clear_around(field: Float, at: tuple[int, int], n: int) -> None:
    """Set a disc of ``n`` cells to 0."""
    i, j = at
    rows, columns = slice(max(i - n, 0), i + n + 1), slice(max(j - n, 0), j + n + 1)
    part = field[rows, columns]
    y, x = np.ogrid[: part.shape[0], : part.shape[1]]
    part[(y + rows.start - i) ** 2 + (x + columns.start - j) ** 2 <= n * n] = 0.0


def rooms_of(clear: Float, floor: Mask) -> NDArray[np.int32]:
    """A number for each cell of floor: of the wide place to which the
    widest way leads; 0 elsewhere."""
    wide = ((clear >= ROOM_M) & floor).astype(np.uint8)
    n, seeds = cv2.connectedComponents(wide, connectivity=8)
    if n < 2:
        return np.asarray(floor, dtype=np.int32)
    labels = np.pad(seeds, 1)  # the rim is no floor
    for level in np.arange(ROOM_M, -CELL_M, -0.5 * CELL_M).tolist():
        _grow(labels, np.pad(floor & (clear >= level), 1))
    return np.ascontiguousarray(labels[1:-1, 1:-1])


@njit
def _grow(labels: NDArray[np.int32], ground: Mask) -> None:
    """Let labels spread over ground without one, ring by ring; of several the largest stays."""
    columns = labels.shape[1]
    flat, left = labels.ravel(), ground.ravel()
    around = (-columns - 1, -columns, -columns + 1, -1, 1, columns - 1, columns, columns + 1)
    ring = np.empty(flat.size, dtype=np.int64)
    found, first, last = np.empty(flat.size, dtype=np.int32), 0, 0
    for at in range(flat.size):
        if flat[at] > 0:
            ring[last], last, left[at] = at, last + 1, False
    while first < last:
        end = last
        for k in range(first, last):
            for step in around:
                if left[ring[k] + step]:
                    ring[end], end, left[ring[k] + step] = ring[k] + step, end + 1, False
        for k in range(last, end):
            found[k] = 0
            for step in around:
                found[k] = max(found[k], flat[ring[k] + step])
        for k in range(last, end):
            flat[ring[k]] = found[k]
        first, last = last, end


def outdoors(labels: NDArray[np.int32], built: Mask) -> list[int]:
    """Rooms whose edge is wall for less than ``WALLED`` of its length: what is seen through a gap.

    None where all are so.
    """
    n = int(labels.max()) + 1
    near = cv2.dilate(built.astype(np.uint8), np.ones((3, 3), np.uint8))
    edge, walled = np.zeros(n), np.zeros(n)
    for dy, dx in ((0, 1), (0, -1), (1, 0), (-1, 0)):
        next_ = np.roll(labels, (dy, dx), axis=(0, 1))
        rim = (labels > 0) & (next_ == 0)
        edge += np.bincount(labels[rim], minlength=n)
        walled += np.bincount(labels[rim & (near > 0)], minlength=n)
    known = np.flatnonzero(edge > 0)
    found = [k for k in known.tolist() if walled[k] < WALLED * edge[k]]
    return found if len(found) < len(known) else []


def rectangles(
    inside: Mask, least: int, most: int, share: float
) -> list[tuple[int, int, int, int]]:
    """Largest rectangles (row, column, row, column), half open, until a share is covered."""
    left = inside.copy()
    found: list[tuple[int, int, int, int]] = []
    total = int(inside.sum())
    while len(found) < most and left.sum() > (1.0 - share) * total:
        r0, c0, r1, c1 = _largest(left)
        if min(r1 - r0, c1 - c0) < least:
            break
        found.append((r0, c0, r1, c1))
        left[r0:r1, c0:c1] = False
    return found


@njit
def _largest(mask: NDArray[np.bool_]) -> tuple[int, int, int, int]:
    """The largest rectangle of set cells, by the heights of columns above each row."""
    rows, columns = mask.shape
    height = np.zeros(columns + 1, dtype=np.int64)
    stack = np.zeros(columns + 1, dtype=np.int64)
    best, found = 0, (0, 0, 0, 0)
    for i in range(rows):
        for j in range(columns):
            height[j] = height[j] + 1 if mask[i, j] else 0
        depth = 0
        for j in range(columns + 1):
            while depth > 0 and height[stack[depth - 1]] >= height[j]:
                depth -= 1
                high = height[stack[depth]]
                left = stack[depth - 1] + 1 if depth > 0 else 0
                if high * (j - left) > best:
                    best = high * (j - left)
                    found = (i - high + 1, left, i + 1, j)
            stack[depth] = j
            depth += 1
    return found


def passages_of(labels: NDArray[np.int32], clear: Float, cell_m: float) -> Sequence[Passage]:
    """Where two rooms meet."""
    found = []
    edge = np.zeros(labels.shape, dtype=np.uint8)
    pairs = np.zeros((*labels.shape, 2), dtype=np.int32)
    for shift in ((0, 1), (1, 0)):
        a = labels[: labels.shape[0] - shift[0], : labels.shape[1] - shift[1]]
        b = labels[shift[0] :, shift[1] :]
        meet = (a != b) & (a > 0) & (b > 0)
        part = edge[: a.shape[0], : a.shape[1]]
        part[meet] = 1
        low, high = np.minimum(a, b), np.maximum(a, b)
        pairs[: a.shape[0], : a.shape[1]][meet] = np.stack([low[meet], high[meet]], axis=1)
    n, lines, stats, _ = cv2.connectedComponentsWithStats(edge, connectivity=8)
    for k in range(1, n):
        x, y, w, h = stats[k, :4].tolist()
        rows, columns = np.nonzero(lines[y : y + h, x : x + w] == k)
        rows, columns = rows + y, columns + x
        widest = int(np.argmax(clear[rows, columns]))
        row, column = int(rows[widest]), int(columns[widest])
        points = np.column_stack([columns, rows]).astype(np.float64)
        across = points - points.mean(axis=0)
        xx, yy, xy = (across[:, 0] ** 2).sum(), (across[:, 1] ** 2).sum(), across.prod(axis=1).sum()
        yaw = 0.5 * float(np.arctan2(2.0 * xy, xx - yy))
        wide = 2.0 * float(clear[row, column])
        rooms = tuple(int(v) for v in pairs[row, column])
        at = ((column + 0.5) * cell_m, (row + 0.5) * cell_m, yaw)
        found.append(Passage(at=at, wide_m=wide, rooms=(rooms[0], rooms[1])))
    return found

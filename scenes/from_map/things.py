# SPDX-License-Identifier: Apache-2.0
"""Small things of a map, apart from its walls: legs of chairs, boxes, posts."""

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from scenes.from_map.walls import disc
from slam.errors import InvalidValueError
from slam.frames import Float

Mask = NDArray[np.bool_]

Pose = tuple[float, float, float]
Box = tuple[float, float, float, float, float]

LINK_M = 0.2  # cells that near to each other are of one thing
LARGEST_M = 0.8  # longer side of a thing; what is longer is wall
POST_M = 0.15  # what is smaller is a post: the column of a swivel chair, the leg of a table
FILLED = 0.3  # share of its rectangle that a solid thing fills; below it stands on legs
LEGS, LEGS_M = 5, 0.75  # so many posts at most are legs of one thing, that near to each other
BIN_M = 0.35  # a solid thing up to that is a bin, a larger one a carton
MOST_THINGS = 5000  # of a map; a scene's file has as many at most


@dataclass(frozen=True, kw_only=True)
class Thing:
    """Something small.

    at     x m, y m, yaw rad of its rectangle       half  half its length and width, m
    kind   of mover that is likest to it
    parts  boxes cx, cy, half length, half width m, yaw rad: what the map shows of it
    """

    at: Pose
    half: tuple[float, float]
    kind: str
    parts: tuple[Box, ...]


def things_of(occupied: Mask, cell_m: float) -> tuple[list[Thing], Mask]:
    """Things that stand apart, in the frame of the cells, and the cells that are none of theirs.

    Raises ``InvalidValueError`` for more of them than ``MOST_THINGS``.
    """
    linked = cv2.dilate(occupied.astype(np.uint8), disc(LINK_M, cell_m))
    _, labels, stats, _ = cv2.connectedComponentsWithStats(linked, connectivity=8)
    most = (LARGEST_M + LINK_M) / cell_m
    small = np.hypot(stats[:, cv2.CC_STAT_WIDTH], stats[:, cv2.CC_STAT_HEIGHT]) <= 1.5 * most
    small[0] = False
    if small.sum() > MOST_THINGS:
        raise InvalidValueError(f"{small.sum()} small things, expected at most {MOST_THINGS}")
    parts: list[tuple[Box, bool]] = []
    walls = occupied.copy()
    for k in np.flatnonzero(small).tolist():
        x, y, w, h = stats[k, :4].tolist()
        window = slice(y, y + h), slice(x, x + w)
        own = (labels[window] == k) & occupied[window]
        rows, columns = np.nonzero(own)
        middle, half, yaw = _rectangle((np.column_stack([columns + x, rows + y]) + 0.5) * cell_m)
        half = (half[0] + 0.5 * cell_m, half[1] + 0.5 * cell_m)
        if 2.0 * max(half) > LARGEST_M:
            continue
        walls[window] &= ~own
        solid = len(rows) * cell_m * cell_m > FILLED * 4.0 * half[0] * half[1]
        parts.append(((*middle, *half, yaw), solid))
    return _grouped(parts), walls


def _rectangle(points: Float) -> tuple[tuple[float, float], tuple[float, float], float]:
    """Middle, half sides and yaw of the smallest rectangle around points, m."""
    (x, y), (a, b), turned = cv2.minAreaRect(points.astype(np.float32))
    return (float(x), float(y)), (0.5 * float(a), 0.5 * float(b)), math.radians(turned)


def _grouped(parts: list[tuple[Box, bool]]) -> list[Thing]:
    """Posts near each other are the legs of one thing."""
    posts = [k for k, (box, _) in enumerate(parts) if 2.0 * max(box[2:4]) <= POST_M]
    free, things = set(posts), []
    middles = np.array([box[:2] for box, _ in parts]).reshape(-1, 2)
    for k, (box, solid) in enumerate(parts):
        if k not in free:
            if k not in posts:
                kind = (
                    ("bin" if 2.0 * max(box[2:4]) <= BIN_M else "carton")
                    if solid
                    else "chair_visitor"
                )
                things.append(_thing([box], kind))
            continue
        legs = [k]
        free.discard(k)
        near = np.hypot(*(middles - middles[k]).T) <= LEGS_M + 1e-9  # no other one is its leg
        own = [j for j in free if near[j]]
        for other in sorted(own, key=lambda j: math.dist(parts[j][0][:2], box[:2])):
            spots = [parts[j][0][:2] for j in (*legs, other)]
            if len(legs) < LEGS and max(math.dist(a, b) for a in spots for b in spots) <= LEGS_M:
                legs.append(other)
        free -= set(legs)
        kind = "chair_swivel" if len(legs) == 1 else "chair_visitor"
        things.append(_thing([parts[j][0] for j in legs], kind))
    return things


def _thing(boxes: list[Box], kind: str) -> Thing:
    corners = []
    for x, y, a, b, yaw in boxes:
        c, s = math.cos(yaw), math.sin(yaw)
        corners += [
            (x + i * a * c - j * b * s, y + i * a * s + j * b * c) for i in (-1, 1) for j in (-1, 1)
        ]
    middle, half, yaw = _rectangle(np.array(corners))
    return Thing(at=(*middle, yaw), half=half, kind=kind, parts=tuple(boxes))

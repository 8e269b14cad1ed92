# SPDX-License-Identifier: Apache-2.0
"""A plan drawn over the map that it was made of."""

from __future__ import annotations

import math
from pathlib import Path
from tempfile import TemporaryDirectory

import cv2
import numpy as np
from numpy.typing import NDArray

import scenes
from scenes.from_map import MapPlan
from scenes.kinds import KINDS, PUSHED
from scenes.plan import furniture
from sim.view.mapview import MapView
from slam import se2
from slam.estimate import Raster

Picture = NDArray[np.uint8]

LONGEST_PX, MOST_PX_PER_M = 2400, 60.0
PAPER, UNKNOWN, CELL = (255, 255, 255), (225, 227, 230), (240, 150, 40)
WALL, THING, GOAL, START, GAP = (
    (40, 50, 80),
    (20, 140, 90),
    (200, 30, 40),
    (20, 90, 220),
    (200, 0, 160),
)
FLOORS = ((214, 230, 246), (214, 240, 224), (246, 234, 212), (236, 222, 244), (244, 220, 220))


def over_map(map_: Raster, plan: MapPlan) -> Picture:
    """(height, width, 3) RGB: floor by room, occupied cells orange, walls dark over them."""
    x0, y0, x1, y1 = _extent(plan)
    scale = min(MOST_PX_PER_M, LONGEST_PX / max(x1 - x0, y1 - y0))
    width, height = max(32, round((x1 - x0) * scale)), max(32, round((y1 - y0) * scale))

    def px(points: object) -> NDArray[np.int32]:
        """Pixels of points (n, 2) m."""
        at = np.asarray(points, dtype=np.float64).reshape(-1, 2)
        return np.round(np.column_stack([(at[:, 0] - x0) * scale, (y1 - at[:, 1]) * scale])).astype(
            np.int32
        )

    picture = np.full((height, width, 3), UNKNOWN, dtype=np.uint8)
    known, occupied = _sampled(map_, (x0, y1), scale, (height, width))
    picture[known] = PAPER
    for k, rects in enumerate(plan.rooms.values()):
        for a, b, c, d in rects:
            (left, low), (right, high) = px([[a, b], [c, d]]).tolist()
            cv2.rectangle(picture, (left, high), (right, low), FLOORS[k % len(FLOORS)], -1)
    for box in plan.walls:
        cv2.fillPoly(picture, [px(_corners(*box.tolist()))], WALL, cv2.LINE_AA)
    for thing in plan.things:
        for x, y, a, b, yaw in thing.parts:
            cv2.fillPoly(picture, [px(_corners(x, y, a + 0.02, b + 0.02, yaw))], THING)
    picture[occupied] = CELL
    for gap in plan.gaps:
        x, y, yaw = gap.at
        c, s = 0.5 * gap.wide_m * math.cos(yaw), 0.5 * gap.wide_m * math.sin(yaw)
        ends = px([[x - c, y - s], [x + c, y + s]]).tolist()
        cv2.line(picture, ends[0], ends[1], GAP, 3, cv2.LINE_AA)
    for goal in plan.goals:
        cv2.circle(picture, px(goal)[0].tolist(), 5, GOAL, -1, cv2.LINE_AA)
    cv2.circle(picture, px(plan.start[:2])[0].tolist(), 8, START, -1, cv2.LINE_AA)
    return picture


def _extent(plan: MapPlan) -> tuple[float, float, float, float]:
    """Around the rooms and every wall."""
    low, high = np.array(plan.bounds[:2]), np.array(plan.bounds[2:])
    if len(plan.walls):
        low = np.minimum(low, plan.walls[:, :2].min(axis=0) - 1.0)
        high = np.maximum(high, plan.walls[:, :2].max(axis=0) + 1.0)
    return float(low[0]), float(low[1]), float(high[0]), float(high[1])


def _sampled(
    map_: Raster, corner: tuple[float, float], scale: float, shape: tuple[int, int]
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Which pixels show what is known, and what is occupied."""
    rows, columns = np.nonzero(map_.values > 0.65)
    cells = (np.column_stack([columns, rows]) + 0.5) * map_.resolution_m
    at = se2.transform(map_.T_map_origin, cells)
    i = ((corner[1] - at[:, 1]) * scale).astype(int)
    j = ((at[:, 0] - corner[0]) * scale).astype(int)
    inside = (i >= 0) & (i < shape[0]) & (j >= 0) & (j < shape[1])
    occupied = np.zeros(shape, dtype=bool)
    occupied[i[inside], j[inside]] = True
    y, x = np.mgrid[: shape[0], : shape[1]]
    points = np.column_stack(
        [corner[0] + (x.ravel() + 0.5) / scale, corner[1] - (y.ravel() + 0.5) / scale]
    )
    back = np.floor(se2.transform(se2.inverse(map_.T_map_origin), points) / map_.resolution_m)
    at_cell = back.astype(int)
    height, width = map_.values.shape
    there = ((at_cell >= 0) & (at_cell < [width, height])).all(axis=1)
    known = np.zeros(len(points), dtype=bool)
    known[there] = np.isfinite(map_.values[at_cell[there, 1], at_cell[there, 0]])
    return known.reshape(shape), occupied


def _corners(x: float, y: float, a: float, b: float, yaw: float) -> list[tuple[float, float]]:
    c, s = math.cos(yaw), math.sin(yaw)
    return [(x + u * a * c - v * b * s, y + u * a * s + v * b * c)
            for u, v in ((-1, -1), (1, -1), (1, 1), (-1, 1))]  # fmt: skip


COLUMNS, STEP_M = 7, 4.2
PX = 1400
FONT = cv2.FONT_HERSHEY_SIMPLEX


def kinds() -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Names of what stands and of what can be pushed, which ``put`` takes."""
    return furniture(), tuple(k for k, row in KINDS.items() if row.group in PUSHED)


def picture() -> Picture:
    """(height, width, 3) RGB, from above."""
    names = sorted(sum(kinds(), ()))
    rows = -(-len(names) // COLUMNS)
    spots = {
        name: ((k % COLUMNS + 0.5) * STEP_M, (rows - k // COLUMNS - 0.5) * STEP_M)
        for k, name in enumerate(names)
    }
    wide, high = COLUMNS * STEP_M, rows * STEP_M
    put = "\n".join(f'  ["{name}", {x:.2f}, {y + 0.3:.2f}, 0],' for name, (x, y) in spots.items())
    outline = f"[[0, -2], [{wide}, -2], [{wide}, {high}], [0, {high}], [0, -2]]"
    with TemporaryDirectory() as folder:
        file = Path(folder) / "kinds.toml"
        file.write_text(
            f"walls = [{outline}]\nstart = [1, -1, 0]\nseats = false\nput = [\n{put}\n]\n",
            encoding="utf-8",
        )
        scene = scenes.build(str(file))
    view = MapView(scene, PX, round(PX * (high + 3.2) / (wide + 1.2)))
    drawn = view.draw([scene.initial[mover.name] for mover in scene.movers])
    for name, (x, y) in spots.items():
        (width, _), _ = cv2.getTextSize(name, FONT, 0.48, 1)
        at = view.to_pixels(np.array([[x, y - 0.46 * STEP_M]]))[0]
        place = (round(at[0] - 0.5 * width), round(at[1]))
        cv2.putText(drawn, name, place, FONT, 0.48, (40, 44, 54), 1, cv2.LINE_AA)
    return drawn[: round(view.to_pixels(np.array([[0.0, -0.3]]))[0][1])]

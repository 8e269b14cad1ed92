# SPDX-License-Identifier: Apache-2.0
"""Pictures of scenes from above, with axes in m, a scale and a legend; one of all furniture."""

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import cv2
import numpy as np
from numpy.typing import ArrayLike

import scenes
from scenes.footprint import at_rest
from scenes.kinds import KINDS, PUSHED
from scenes.plan import furniture
from scenes.scene import Scene
from sim.view import draw
from sim.view.draw import Color, Picture, View
from sim.view.mapview import FOOT_PX, WALL, MapView
from slam.frames import Float

LONG_PX, LEAST_PX = 1800, 640  # longer side of the scene; px of the legend's width at least
LEFT_PX, LINE_PX, SIZE, UNIT = 64, 42, 17, 1.4
ICON_PX, ICON_M = 36, 1.3
AROUND_M, MOST_AROUND_M = 0.3, 2.0  # of walls beyond the bounds
FLOOR: Color = (216, 234, 255)  # by which that of rooms is multiplied
ROOM: Color = (190, 206, 222)
CELL: Color = (240, 150, 40)
GOAL, GAP = draw.RED, (200, 0, 160)
COLUMNS, CELL_M, KINDS_PX = 7, 4.2, 1400

THING = "box of a thing"
Entry = tuple[Picture | None, str]


def standing(scene: Scene) -> dict[str, tuple[float, float]]:
    """Furniture that never moves, by name: x, y m of its origin."""
    model = scene.compile()
    data, movers = at_rest(model), {mover.name for mover in scene.movers}
    found = {}
    for body in range(model.nbody):
        name, _, part = model.body(body).name.partition("/")
        if part == "base" and name not in movers:
            found[name] = (float(data.xpos[body, 0]), float(data.xpos[body, 1]))
    return found


def stands(scene: Scene) -> Counter[str]:
    """How many of each kind stand: furniture, and things of a map that do not move."""
    things = sum(geom.name.startswith("wall:thing") for geom in scene.spec.geoms)
    each = Counter(name.rstrip("0123456789") for name in standing(scene))
    return each + Counter({THING: things})


def picture(
    scene: Scene, poses: ArrayLike, cells: Float | None = None, gaps: Sequence[Float] = ()
) -> Picture:
    """(height, width, 3) RGB.

    poses  (n, 3) of its movers;  cells  (n, 2) m of what a map has occupied
    gaps   (2, 2) m each, ends of gaps where doors may hang
    """
    at = np.asarray(poses, dtype=np.float64)
    low, high = np.array(scene.bounds[:2]), np.array(scene.bounds[2:])
    walls = scene.obstacles[:, :2]
    low = np.maximum(np.vstack([walls - AROUND_M, low]).min(axis=0), low - MOST_AROUND_M)
    high = np.minimum(np.vstack([walls + AROUND_M, high]).max(axis=0), high + MOST_AROUND_M)
    scale = LONG_PX / float((high - low).max())
    wide, tall = (max(160, math.ceil(side * scale)) for side in (high - low).tolist())
    bounds = (*low.tolist(), *high.tolist())
    view = MapView(replace(scene, bounds=bounds), wide, tall + FOOT_PX)
    view.room = _tinted(view, scene)
    drawn = view.draw(at)[:tall].copy()
    legend: list[Entry] = [(None, f"can move: {sum(scene.can_move.values())}")]
    first = {mover.kind: pose for mover, pose in zip(scene.movers, at, strict=True)}
    legend += [(_icon(drawn, view, first[k]), f"{n} {k}") for k, n in scene.can_move.items()]
    legend.append((_icon(drawn, view, at[-1]), "robot at its start"))
    legend.append((None, "stands:"))
    legend.append((_swatch(WALL), "wall"))
    places = standing(scene)
    for kind, n in stands(scene).items():
        icon = _icon(drawn, view, places[f"{kind}0"]) if kind != THING else _swatch(WALL)
        legend.append((icon, f"{n} {kind}"))
    legend += [(None, "marks:"), *_marked(drawn, view, scene, cells, gaps)]
    return _framed(drawn, view, bounds, legend)


def _tinted(view: MapView, scene: Scene) -> Picture:
    """What stays, the floor of rooms bluish."""
    room = view.room.copy()
    floor = np.zeros(room.shape[:2], dtype=bool)
    for a, b, c, d in scene.rooms.values():
        (left, bottom), (right, top) = np.round(view.to_pixels([[a, b], [c, d]])).astype(int)
        floor[max(top, 0) : max(bottom, 0), max(left, 0) : max(right, 0)] = True
    room[floor] = (room[floor] * (np.array(FLOOR) / 255.0)).astype(np.uint8)
    return room


def _marked(
    drawn: Picture, view: MapView, scene: Scene, cells: Float | None, gaps: Sequence[Float]
) -> list[Entry]:
    """Draw what the map has, gaps and spots to visit; their lines of the legend."""
    entries: list[Entry] = [(_swatch(ROOM), "floor of rooms"), (_dot(GOAL), "spot to visit")]
    if cells is not None:
        column, row = np.round(view.to_pixels(cells)).astype(int).T
        there = (row >= 0) & (row < drawn.shape[0]) & (column >= 0) & (column < drawn.shape[1])
        drawn[row[there], column[there]] = CELL
        entries.append((_swatch(CELL), "occupied cell of the map"))
    for ends in gaps:
        draw.polyline(drawn, view.to_pixels(ends), GAP, 4)
    if gaps:
        entries.append((_swatch(GAP), f"{len(gaps)} gaps for doors"))
    for name, spot in scene.goals.items():
        x, y = np.round(view.to_pixels([spot])[0]).astype(int).tolist()
        cv2.circle(drawn, (x, y), 7, draw.PAPER, -1, cv2.LINE_AA)
        cv2.circle(drawn, (x, y), 5, GOAL, -1, cv2.LINE_AA)
        draw.text(drawn, name, (x + 9, max(y - 9, 0)), SIZE - 3, GOAL, bold=True)
    return entries


def _framed(
    drawn: Picture, view: MapView, bounds: tuple[float, float, float, float], legend: list[Entry]
) -> Picture:
    """The picture with axes, scale and legend around it."""
    tall, wide = drawn.shape[:2]
    width = LEFT_PX + max(wide, LEAST_PX)
    lines: list[list[tuple[int, Picture | None, str]]] = [[]]
    x = LEFT_PX
    for icon, words in legend:
        own = draw.text_width(words, SIZE, icon is None) + 22 + (ICON_PX + 6) * (icon is not None)
        if x + own > width and lines[-1]:
            lines.append([])
            x = LEFT_PX
        lines[-1].append((x, icon, words))
        x += own
    top = tall + LINE_PX
    height = top + (len(lines) + 2) * LINE_PX
    page = np.full((height, width, 3), draw.PAPER, np.uint8)
    page[:tall, LEFT_PX : LEFT_PX + wide] = drawn
    _axes(page, view, bounds, tall)
    for k, line in enumerate(lines):
        for x, icon, words in line:
            y, left = top + k * LINE_PX + 4, x
            if icon is not None:
                page[y : y + ICON_PX, x : x + ICON_PX] = icon
                left += ICON_PX + 6
            draw.text(page, words, (left, y + 8), SIZE, bold=icon is None)
    foot = page[:, LEFT_PX:]
    draw.scale_bar(foot, View(0.0, 0.0, view.scale, foot.shape[1], height), UNIT)
    return page


def _axes(
    page: Picture, view: MapView, bounds: tuple[float, float, float, float], tall: int
) -> None:
    """x m below the picture, y m left of it."""
    step = draw.round_down(max(bounds[2] - bounds[0], bounds[3] - bounds[1]) / 5.0)
    for axis in (0, 1):
        low, high = bounds[axis], bounds[axis + 2]
        for k in range(math.ceil(low / step), math.floor(high / step) + 1):
            at = np.full((1, 2), bounds[:2])
            at[0, axis] = k * step
            x, y = np.round(view.to_pixels(at)[0]).astype(int).tolist()
            words = f"{k * step:g} m"
            if axis == 0:
                page[tall : tall + 6, LEFT_PX + x] = draw.INK
                left = LEFT_PX + x - draw.text_width(words, SIZE - 3) // 2
                draw.text(page, words, (left, tall + 8), SIZE - 3)
            else:
                page[y, LEFT_PX - 6 : LEFT_PX] = draw.INK
                left = LEFT_PX - 10 - draw.text_width(words, SIZE - 3)
                draw.text(page, words, (left, min(max(y - 9, 0), tall - 18)), SIZE - 3)


def _icon(drawn: Picture, view: MapView, pose: ArrayLike) -> Picture:
    """What stands at a pose, cut out of the picture."""
    x, y = np.round(view.to_pixels([np.asarray(pose)[:2]])[0]).astype(int).tolist()
    half = max(4, round(0.5 * ICON_M * view.scale))
    padded = np.pad(drawn, ((half, half), (half, half), (0, 0)), mode="edge")
    x, y = (min(max(v, 0), n - 1) for v, n in ((x, drawn.shape[1]), (y, drawn.shape[0])))
    part = padded[y : y + 2 * half, x : x + 2 * half]
    return np.asarray(cv2.resize(part, (ICON_PX, ICON_PX), interpolation=cv2.INTER_AREA), np.uint8)


def _swatch(color: Color) -> Picture:
    return np.full((ICON_PX, ICON_PX, 3), color, np.uint8)


def _dot(color: Color) -> Picture:
    icon = _swatch(draw.PAPER)
    cv2.circle(icon, (ICON_PX // 2, ICON_PX // 2), 5, color, -1, cv2.LINE_AA)
    return icon


def kinds() -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Names of what stands and of what can be pushed, which ``put`` takes."""
    return furniture(), tuple(k for k, row in KINDS.items() if row.group in PUSHED)


def kinds_picture() -> Picture:
    """(height, width, 3) RGB of all kinds, each with its name."""
    names = sorted(sum(kinds(), ()))
    rows = -(-len(names) // COLUMNS)
    spots = {
        name: ((k % COLUMNS + 0.5) * CELL_M, (rows - k // COLUMNS - 0.5) * CELL_M)
        for k, name in enumerate(names)
    }
    wide, high = COLUMNS * CELL_M, rows * CELL_M
    put = "\n".join(f'  ["{name}", {x:.2f}, {y + 0.3:.2f}, 0],' for name, (x, y) in spots.items())
    outline = f"[[0, -2], [{wide}, -2], [{wide}, {high}], [0, {high}], [0, -2]]"
    with TemporaryDirectory() as folder:
        file = Path(folder) / "kinds.toml"
        told = f"walls = [{outline}]\nstart = [1, -1, 0]\nseats = false\nput = [\n{put}\n]\n"
        file.write_text(told, encoding="utf-8")
        scene = scenes.build(str(file))
    view = MapView(scene, KINDS_PX, round(KINDS_PX * (high + 3.2) / (wide + 1.2)))
    drawn = view.draw([scene.initial[mover.name] for mover in scene.movers])
    for name, (x, y) in spots.items():
        at = view.to_pixels([[x, y - 0.46 * CELL_M]])[0]
        place = round(at[0] - 0.5 * draw.text_width(name, 14)), round(at[1]) - 12
        draw.text(drawn, name, place, 14)
    page = drawn[: round(view.to_pixels([[0.0, -0.3]])[0][1])]
    page = np.vstack([page, np.full((LINE_PX, *page.shape[1:]), draw.PAPER, np.uint8)])
    draw.scale_bar(page, View(0.0, 0.0, view.scale, page.shape[1], page.shape[0]), 1.0)
    return page

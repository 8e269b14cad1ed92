# SPDX-License-Identifier: Apache-2.0
"""From a map to a plan: walls, things, rooms, spots to visit, doors."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from scenes.from_map import floor as floors
from scenes.from_map.floor import Passage, Point, Rect
from scenes.from_map.things import Thing, things_of
from scenes.from_map.walls import boxes_of, disc, footprint
from scenes.placement import gap_to_boxes
from slam import se2
from slam.errors import InvalidValueError
from slam.estimate import Raster

Float = NDArray[np.float64]
Pose = tuple[float, float, float]

OCCUPIED, FREE = 0.65, 0.25
FINEST_M = 0.025  # cells of a map that are smaller are joined
MAX_SIDE_M, MAX_WALL_M = 1000.0, 5000.0
NEAR_M = 0.05  # a cell of a wall is built where a box is that near
LONG_M = 0.3  # a box that is shorter is a piece of one
SPECK_M = 0.2  # unknown specks of floor up to that are floor
HULL_M = 0.15  # a robot that drives so near to a thing drives through it
LEAK_M = 0.55  # a narrower gap in a wall leads nowhere
FLOOR_M = 0.05  # cells of floor
NEAR_PATH_M = 4.0  # floor of a log is so near to the robot's way
EDGE_M = 0.5  # of walls round the rooms
DOOR_M = (0.7, 1.2)  # gaps that may be doors


@dataclass(frozen=True, kw_only=True, eq=False)
class FromMap:
    """How a map becomes a plan.

    tolerance_m  by which a straightened wall may miss the middle of its cells
    start        x m, y m, heading rad of the robot in the map; None: the map's origin where there
                 is room, else the widest floor
    path         (n, 2) m where a robot has driven: other floor is that near to it; None: anywhere
    things       whether small things apart from walls are taken out of the walls
    """

    tolerance_m: float = 0.05
    start: Pose | None = None
    path: Float | None = None
    things: bool = True

    def __post_init__(self) -> None:
        if not 0.01 <= self.tolerance_m <= 0.5:
            raise InvalidValueError(f"tolerance_m must lie in 0.01..0.5, got {self.tolerance_m}")


@dataclass(frozen=True, kw_only=True)
class Figures:
    """What became of the map.

    walls, pieces   boxes of at least 0.3 m, and shorter ones     wall_m  length of all
    map_wall_m      length of the middle lines of the map's walls
    cells_near      share of occupied cells within 5 cm of a wall or thing
    walls_near      share of the walls' surface within 5 cm of an occupied cell
    floor_m2        free floor that the robot can get to, in the map
    rooms_m2        of it inside rooms
    """

    walls: int
    pieces: int
    wall_m: float
    cells_near: float
    walls_near: float
    floor_m2: float
    rooms_m2: float


@dataclass(frozen=True, kw_only=True, eq=False)
class MapPlan:
    """A plan in the frame of its map, m and rad.

    walls   (n, 5) boxes: cx, cy, half length, half thickness, yaw
    rooms   name -> rectangles xmin, ymin, xmax, ymax
    gaps    passages as wide as a door
    """

    walls: Float
    things: tuple[Thing, ...]
    rooms: dict[str, tuple[Rect, ...]]
    goals: tuple[Point, ...]
    start: Pose
    gaps: tuple[Passage, ...]
    bounds: Rect
    figures: Figures


def plan(map_: Raster, options: FromMap | None = None, *, source: str = "map") -> MapPlan:
    """The plan of a map; ``source`` is what errors call it.

    Raises ``InvalidValueError`` for a map without floor for a robot, and for one whose walls are
    no walls.
    """
    options = options or FromMap()
    map_ = _coarse(map_)
    cell = map_.resolution_m
    occupied, free = map_.values > OCCUPIED, map_.values < FREE
    _check(occupied, free, cell, source)
    things, solid = things_of(occupied, cell) if options.things else ([], occupied)
    walls = boxes_of(solid, cell, options.tolerance_m)
    if 2.0 * walls[:, 2].sum() > MAX_WALL_M:
        raise InvalidValueError(
            f"{source}: {2.0 * walls[:, 2].sum():.0f} m of walls in {len(walls)} pieces; at most "
            f"{MAX_WALL_M:g} m can be built (is it a map of rooms, or noise?)"
        )
    T_map_cells = map_.T_map_origin
    if options.path is not None:  # what the robot drove through was there for a while only
        way = _dense(se2.transform(se2.inverse(T_map_cells), options.path))
        walls = walls[(gap_to_boxes_each(walls, way) > HULL_M) | (2.0 * walls[:, 2] > LONG_M)]
        things = [t for t in things if (gap_to_boxes_each(_thing_boxes([t]), way) > HULL_M).all()]
    boxes = np.vstack([walls, _thing_boxes(things)])
    cells = Cells(map_.values.shape, cell, T_map_cells)
    ground, passable = _floor(free | (occupied & ~solid), walls, boxes, cells)
    if options.path is not None:
        driven = cells.beside(options.path, floors.ROBOT_M + 2.0 * cells.cell_m)
        ground, passable = ground | driven, passable | driven
        ground = cells.reached(driven, ground, NEAR_PATH_M)
    clear = floors.clearance(ground, cells.cell_m)
    labels = floors.rooms_of(clear, ground)
    outdoors = set(floors.outdoors(labels, cells.raster(walls)))
    if options.path is not None:
        outdoors -= set(np.unique(labels[cells.beside(options.path, 0.0)]).tolist())
    ground &= ~np.isin(labels, sorted(outdoors))
    passable = floors.clearance(ground & passable, cells.cell_m)
    begin = floors.start_cell(passable, cells.at(options.start), source)
    reach = floors.reachable(passable, begin)
    area = float(reach.sum()) * cells.cell_m**2
    if area < floors.LEAST_M2:
        raise InvalidValueError(
            f"{source}: the robot can reach {area:.1f} m2 of floor only, expected at least "
            f"{floors.LEAST_M2:g} m2 (is it a map of rooms, or noise?)"
        )
    labels[~_around(reach, ground, cells.cell_m)] = 0
    spots = cells.points([begin, *floors.spots(passable, reach, begin, cells.cell_m)])
    start = options.start or (*spots[0], 0.0)
    gaps = floors.passages_of(labels, clear, cells.cell_m)
    rooms = _rooms(labels, cells.cell_m, T_map_cells)
    return MapPlan(
        walls=_moved(walls, T_map_cells),
        things=tuple(
            replace(
                t,
                at=_turned(t.at, T_map_cells),
                parts=tuple(map(tuple, _moved(np.array(t.parts), T_map_cells).tolist())),
            )
            for t in things
        ),
        rooms=rooms,
        goals=tuple(spots[1:]),
        start=start,
        gaps=tuple(
            replace(gap, at=_turned(gap.at, T_map_cells))
            for gap in gaps
            if DOOR_M[0] <= gap.wide_m <= DOOR_M[1]
        ),
        bounds=_bounds(rooms),
        figures=_figures(walls, boxes, occupied, area, rooms, cell),
    )


def _coarse(map_: Raster) -> Raster:
    """The map in cells that are not needlessly small; what is occupied in any is in all."""
    n = math.ceil(FINEST_M / map_.resolution_m - 1e-6)
    if n <= 1:
        return map_
    values = np.nan_to_num(map_.values, nan=0.5)
    rows, columns = -values.shape[0] % n, -values.shape[1] % n
    values = np.pad(values, ((0, rows), (0, columns)), constant_values=0.5)
    blocks = values.reshape(values.shape[0] // n, n, values.shape[1] // n, n)
    high, low = blocks.max(axis=(1, 3)), blocks.min(axis=(1, 3))
    joined = np.where(high > OCCUPIED, high, low)
    return replace(map_, values=joined, resolution_m=map_.resolution_m * n)


def _check(
    occupied: NDArray[np.bool_], free: NDArray[np.bool_], cell_m: float, source: str
) -> None:
    side = max(occupied.shape) * cell_m
    if side > MAX_SIDE_M:
        raise InvalidValueError(
            f"{source}: {side:.0f} m long ({cell_m:g} m a cell), at most {MAX_SIDE_M:g} m; is its "
            "resolution in metres?"
        )
    if not occupied.any() or not free.any():
        what = "occupied" if free.any() else "free"
        raise InvalidValueError(f"{source}: has no {what} cells (are its thresholds right?)")


class Cells:
    """Cells of a few centimetres on which floor is looked at: each of ``n`` x ``n`` of the map.

    shape, cell_m  of the map and of a cell of it       T_map_cells  (3,) pose of their corner
    """

    def __init__(self, shape: tuple[int, ...], cell_m: float, T_map_cells: Float) -> None:
        self.n = max(1, round(FLOOR_M / cell_m))
        self.shape = (-(-shape[0] // self.n), -(-shape[1] // self.n))
        self.cell_m, self.T_map_cells = cell_m * self.n, T_map_cells

    def mostly(self, mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Which of our cells are set for the most part, given those of the map."""
        down, right = (n * self.n - size for n, size in zip(self.shape, mask.shape, strict=True))
        blocks = np.pad(mask, ((0, down), (0, right))).reshape(self.shape[0], self.n, -1, self.n)
        return np.asarray(2 * blocks.sum(axis=(1, 3)) > self.n * self.n)

    def raster(self, boxes: Float) -> NDArray[np.bool_]:
        """Which cells a box touches."""
        return _raster(boxes, self.shape, self.cell_m)

    def at(self, start: Pose | None) -> tuple[int, int] | None:
        """The cell of the start, or of the origin of the map frame; None where that is off the map.

        Raises ``InvalidValueError`` for a start that was asked for and is off the map.
        """
        place = np.array([start[:2] if start is not None else (0.0, 0.0)])
        row, column = self._cells(place)[0].tolist()
        if 0 <= row < self.shape[0] and 0 <= column < self.shape[1]:
            return row, column
        if start is not None:
            raise InvalidValueError(f"start at ({start[0]:g}, {start[1]:g}) m is off the map")
        return None

    def points(self, cells: list[tuple[int, int]]) -> list[Point]:
        """Their middles in the map, m."""
        at = (np.array(cells)[:, ::-1] + 0.5) * self.cell_m
        return [(x, y) for x, y in se2.transform(self.T_map_cells, at).tolist()]

    def beside(self, path: Float, metres: float) -> NDArray[np.bool_]:
        """Cells within that distance of a way, (n, 2) m in the map."""
        away = np.ones(self.shape, dtype=np.uint8)
        points = np.ascontiguousarray(self._cells(path)[:, ::-1], dtype=np.int32)
        cv2.polylines(away, [points.reshape(-1, 1, 2)], False, 0)
        far = cv2.distanceTransform(away, cv2.DIST_L2, cv2.DIST_MASK_PRECISE) * self.cell_m
        return np.asarray(far <= metres)

    def reached(
        self, begin: NDArray[np.bool_], ground: NDArray[np.bool_], metres: float
    ) -> NDArray[np.bool_]:
        """Ground to which a way of that length leads from where one begins."""
        found, allowed = begin.astype(np.uint8), ground.astype(np.uint8)
        for k in range(round(metres / self.cell_m)):
            shape = cv2.MORPH_CROSS if k % 2 else cv2.MORPH_RECT  # in turn: nearly a disc
            found = cv2.dilate(found, cv2.getStructuringElement(shape, (3, 3))) & allowed
        return np.asarray(found > 0)

    def _cells(self, points: Float) -> NDArray[np.int64]:
        at = se2.transform(se2.inverse(self.T_map_cells), points)
        return np.floor(at[:, ::-1] / self.cell_m).astype(np.int64)


def _floor(
    free: NDArray[np.bool_], walls: Float, boxes: Float, cells: Cells
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Floor of rooms, and where the robot meets neither wall nor thing.

    A gap in a wall that no robot passes ends the floor as the wall does.
    """
    n = round(LEAK_M / cells.cell_m) + 1
    ones = np.pad(cells.raster(walls).astype(np.uint8), n)
    shut = cv2.morphologyEx(ones, cv2.MORPH_CLOSE, disc(LEAK_M, cells.cell_m))[n:-n, n:-n]
    ones = np.pad(cells.mostly(free).astype(np.uint8), n)
    known = cv2.morphologyEx(ones, cv2.MORPH_CLOSE, disc(SPECK_M, cells.cell_m))[n:-n, n:-n]
    return (known > 0) & (shut == 0), ~cells.raster(boxes)


def _raster(boxes: Float, shape: tuple[int, ...], cell_m: float) -> NDArray[np.bool_]:
    """Which cells a box touches."""
    cells = np.zeros(shape, dtype=np.uint8)
    for box in boxes:
        window, inside = footprint(box, shape, cell_m, 0.5 * cell_m)
        cells[window] |= inside
    return cells.astype(bool)


def _thing_boxes(things: list[Thing]) -> Float:
    return np.array([part for thing in things for part in thing.parts]).reshape(-1, 5)


def _dense(path: Float) -> Float:
    """Points along a way, no two further apart than 5 cm."""
    steps = np.hypot(*np.diff(path, axis=0).T)
    n = np.maximum(np.ceil(steps / 0.05).astype(int), 1)
    parts = [
        np.linspace(a, b, k, endpoint=False)
        for a, b, k in zip(path, path[1:], n.tolist(), strict=False)
    ]
    return np.ascontiguousarray(np.vstack([*parts, path[-1:]]))


def gap_to_boxes_each(boxes: Float, points: Float) -> Float:
    """(n,) m from each box to the nearest of some points."""
    return np.array([float(gap_to_boxes(points, box[None]).min()) for box in boxes])


def _around(
    reach: NDArray[np.bool_], ground: NDArray[np.bool_], cell_m: float
) -> NDArray[np.bool_]:
    """Floor at or beside where the robot can get to."""
    away = cv2.distanceTransform((~reach).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    return np.asarray(ground & (away * cell_m <= floors.ROOM_M))


def _rooms(
    labels: NDArray[np.int32], cell_m: float, T_map_cells: Float
) -> dict[str, tuple[Rect, ...]]:
    """Rectangles along the axes of the map, of floor that is all of one room."""
    height, width = labels.shape
    corners = np.array([[0, 0], [width, 0], [0, height], [width, height]]) * cell_m
    low = se2.transform(T_map_cells, corners).min(axis=0)
    high = se2.transform(T_map_cells, corners).max(axis=0)
    step = floors.CELL_M
    columns, rows = (int(v) for v in np.ceil((high - low) / step))
    coarse: NDArray[np.int32] | None = None
    back = se2.inverse(T_map_cells)
    for dy in (0.0, 0.5, 1.0):
        for dx in (0.0, 0.5, 1.0):
            x, y = low[0] + (np.arange(columns) + dx) * step, low[1] + (np.arange(rows) + dy) * step
            points = np.column_stack([np.tile(x, rows), np.repeat(y, columns)])
            at = np.floor(se2.transform(back, points) / cell_m).astype(int)
            known = ((at >= 0) & (at < [width, height])).all(axis=1)
            here = np.zeros(len(at), dtype=np.int32)
            here[known] = labels[at[known, 1], at[known, 0]]
            here = here.reshape(rows, columns)
            coarse = here if coarse is None else np.where(coarse == here, coarse, 0)
    found: dict[str, tuple[Rect, ...]] = {}
    n_rects = 0
    for k in range(1, int(labels.max()) + 1):
        inside = np.asarray(coarse == k)
        if not inside.any() or n_rects >= floors.MAX_RECTS:
            continue
        i, j = np.nonzero(inside)
        i0, j0 = int(i.min()), int(j.min())
        own = inside[i0 : int(i.max()) + 1, j0 : int(j.max()) + 1]
        rects = floors.rectangles(own, round(floors.RECT_M / step), floors.ROOM_RECTS, 0.9)
        if not rects:
            continue
        n_rects += len(rects)
        x0, y0 = low[0] + j0 * step, low[1] + i0 * step
        found[f"room{len(found)}"] = tuple(
            (x0 + c0 * step, y0 + r0 * step, x0 + c1 * step, y0 + r1 * step)
            for r0, c0, r1, c1 in rects
        )
    return found


def _figures(  # noqa: PLR0913 (the makings of a plan)
    walls: Float,
    boxes: Float,
    occupied: NDArray[np.bool_],
    floor_m2: float,
    rooms: dict[str, tuple[Rect, ...]],
    cell_m: float,
) -> Figures:
    """``walls`` and all ``boxes`` in the frame of the cells."""
    rows, columns = np.nonzero(occupied)
    cells = (np.column_stack([columns, rows]) + 0.5) * cell_m
    back = cv2.distanceTransform((~occupied).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    faces = np.vstack([_outline(box) for box in walls]) if len(walls) else np.zeros((0, 2))
    at = np.clip(
        np.floor(faces / cell_m).astype(int), 0, [occupied.shape[1] - 1, occupied.shape[0] - 1]
    )
    off = np.maximum(back[at[:, 1], at[:, 0]] - 0.5, 0.0) * cell_m
    long = 2.0 * walls[:, 2] >= LONG_M
    rects = [rect for own in rooms.values() for rect in own]
    return Figures(
        walls=int(long.sum()),
        pieces=int((~long).sum()),
        wall_m=float(2.0 * walls[:, 2].sum()),
        cells_near=float((gap_to_boxes(cells, boxes) <= NEAR_M).mean()),
        walls_near=float((off <= NEAR_M).mean()) if len(off) else 1.0,
        floor_m2=floor_m2,
        rooms_m2=float(sum((c - a) * (d - b) for a, b, c, d in rects)),
    )


def _outline(box: Float) -> Float:
    """(n, 2) points along the two long sides of a box, 2 cm apart."""
    x, y, a, b, yaw = box.tolist()
    u = np.linspace(-a, a, max(2, round(2.0 * a / 0.02)))
    local = np.vstack([np.column_stack([u, np.full(len(u), side)]) for side in (-b, b)])
    return np.asarray(se2.transform(np.array([x, y, yaw]), local))


def _bounds(rooms: dict[str, tuple[Rect, ...]]) -> Rect:
    """Around all rooms and the walls next to them."""
    rects = np.array([rect for own in rooms.values() for rect in own])
    low, high = rects[:, :2].min(axis=0) - EDGE_M, rects[:, 2:].max(axis=0) + EDGE_M
    return float(low[0]), float(low[1]), float(high[0]), float(high[1])


def _moved(boxes: Float, T: Float) -> Float:
    """(n, 5) boxes in another frame."""
    found = boxes.copy()
    found[:, :2] = se2.transform(T, boxes[:, :2])
    found[:, 4] += T[2]
    return found


def _turned(pose: Pose, T_map_cells: Float) -> Pose:
    x, y, yaw = se2.compose(T_map_cells, np.array(pose)).tolist()
    return x, y, yaw

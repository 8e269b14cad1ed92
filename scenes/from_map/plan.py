# SPDX-License-Identifier: Apache-2.0
"""From a map to a plan: walls, things, rooms, spots to visit, doors."""

import math
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from scenes.from_map.floor import ROBOT_M, Passage, Point, Rect
from scenes.from_map.survey import Cells, Survey, survey
from scenes.from_map.things import Thing, things_of
from scenes.from_map.walls import MAX_WALL_M, MOST_WALLS, boxes_of, skin
from scenes.placement import gap_to_boxes
from scenes.plan_file import check_span
from slam import se2
from slam.errors import InvalidValueError
from slam.estimate import Raster
from slam.frames import Float

Pose = tuple[float, float, float]

OCCUPIED, FREE = 0.65, 0.25
FINEST_M = 0.025  # cells of a map that are smaller are joined
MAX_SIDE_M = 1000.0
MAX_EDGE_M = 3.0 * MAX_WALL_M  # of what is occupied; real walls have three times their length
MAX_AWAY_M = 9e3  # from the origin of the map; a scene has room up to 10 km
NEAR_M = 0.05  # a cell of a wall is built where a box is that near
LONG_M = 0.3  # a box that is shorter is a piece of one
HULL_M = 0.15  # a robot that drives so near to a thing drives through it
RIM_M = 1.0  # of a map round all that is occupied
NOISE = "is it a map of rooms, or noise?"


@dataclass(frozen=True, kw_only=True, eq=False)
class FromMap:
    """How a map becomes a plan.

    tolerance_m  by which a straightened wall may miss the middle of its cells
    start        x m, y m, heading rad of the robot in the map; None: the map's origin where there
                 is room, else the widest floor
    robot_m      radius about its axle of the robot that is to drive there
    path         (n, 2) m where a robot has driven: other floor is that near to it; None: anywhere
    things       whether small things apart from walls are taken out of the walls
    few          whether boxes on one line become one: fewer, a little farther from their cells
    """

    tolerance_m: float = 0.05
    start: Pose | None = None
    robot_m: float = ROBOT_M
    path: Float | None = None
    things: bool = True
    few: bool = True

    def __post_init__(self) -> None:
        if not 0.01 <= self.tolerance_m <= 0.5:
            raise InvalidValueError(f"tolerance_m must lie in 0.01..0.5, got {self.tolerance_m}")
        if not 0.01 <= self.robot_m <= 3.0:
            raise InvalidValueError(f"FromMap.robot_m must lie in 0.01..3, got {self.robot_m}")


@dataclass(frozen=True, kw_only=True)
class Figures:
    """What became of the map.

    walls, pieces   boxes of at least 0.3 m, and shorter ones     wall_m  length of all
    cells_near      share of occupied cells, less those deep in what is solid, within 5 cm of a
                    wall or thing
    walls_near      share of the walls' surface within 5 cm of an occupied cell
    floor_m2        free floor that the robot can get to, in the map
    rooms_m2        of it inside rooms
    shut_off        m2 of the largest part of the floor that it cannot get to, and a place there
    """

    walls: int
    pieces: int
    wall_m: float
    cells_near: float
    walls_near: float
    floor_m2: float
    rooms_m2: float
    shut_off: tuple[float, Point]


@dataclass(frozen=True, kw_only=True, eq=False)
class MapPlan:
    """A plan in the frame of its map, m and rad.

    walls   (n, 5) boxes: cx, cy, half length, half thickness, yaw
    rooms   name -> rectangles xmin, ymin, xmax, ymax
    gaps    passages as wide as a door
    ends    (n, 5) boxes that shut the floor off where the map ends without a wall
    """

    walls: Float
    ends: Float
    things: tuple[Thing, ...]
    rooms: dict[str, tuple[Rect, ...]]
    goals: tuple[Point, ...]
    start: Pose
    gaps: tuple[Passage, ...]
    bounds: Rect
    figures: Figures


def plan(map_: Raster, options: FromMap | None = None, *, source: str = "map") -> MapPlan:
    """The plan of a map; ``source`` is what errors call it.

    Raises ``InvalidValueError`` for a map without floor for a robot, for one whose walls are no
    walls, and for one too large.
    """
    options = options or FromMap()
    map_ = _coarse(_cropped(map_))
    cell = map_.resolution_m
    occupied, free = map_.values > OCCUPIED, map_.values < FREE
    _check(map_, occupied, free, source)
    things, solid, walls = _built(occupied, cell, options, source)
    T_map_cells = map_.T_map_origin
    if options.path is not None:  # what the robot drove through was there for a while only
        way = _dense(se2.transform(se2.inverse(T_map_cells), options.path))
        walls = walls[(_gaps(walls, way) > HULL_M) | (2.0 * walls[:, 2] > LONG_M)]
        things = [t for t in things if (_gaps(_thing_boxes([t]), way) > HULL_M).all()]
    boxes = _thing_boxes(things)
    cells = Cells(map_.values.shape, cell, T_map_cells)
    floor = survey(
        cells, cells.mostly(free | (occupied & ~solid)), walls, boxes,
        start=options.start, path=options.path, robot_m=options.robot_m, source=source,
    )  # fmt: skip
    check_span(source, floor.bounds)
    _check_walls(np.vstack([walls, floor.ends]), source)
    return MapPlan(
        walls=_moved(walls, T_map_cells),
        ends=_moved(floor.ends, T_map_cells),
        things=tuple(
            replace(
                t,
                at=cells.in_map(t.at),
                parts=tuple(map(tuple, _moved(np.array(t.parts), T_map_cells).tolist())),
            )
            for t in things
        ),
        rooms=floor.rooms,
        goals=floor.goals,
        start=floor.start,
        gaps=floor.gaps,
        bounds=floor.bounds,
        figures=_figures(walls, np.vstack([walls, boxes]), occupied, floor, cell),
    )


def _built(
    occupied: NDArray[np.bool_], cell: float, options: FromMap, source: str
) -> tuple[list[Thing], NDArray[np.bool_], Float]:
    """Things, the cells of walls, and walls; ``InvalidValueError`` for what is noise."""
    try:
        things, solid = things_of(occupied, cell) if options.things else ([], occupied)
        walls = boxes_of(solid, cell, options.tolerance_m, few=options.few)
    except InvalidValueError as error:
        raise InvalidValueError(f"{source}: {error} ({NOISE})") from None
    _check_walls(walls, source)
    return things, solid, walls


def _check_walls(walls: Float, source: str) -> None:
    length = 2.0 * float(walls[:, 2].sum())
    if length > MAX_WALL_M or len(walls) > MOST_WALLS:
        raise InvalidValueError(
            f"{source}: {length:.0f} m of walls in {len(walls)} pieces, expected at most "
            f"{MAX_WALL_M:g} m and {MOST_WALLS} ({NOISE})"
        )


def _cropped(map_: Raster) -> Raster:
    """The map without what lies far from all that is occupied."""
    occupied = map_.values > OCCUPIED
    rows, columns = (np.flatnonzero(occupied.any(axis=axis)) for axis in (1, 0))
    if not len(rows):
        return map_
    n = math.ceil(RIM_M / map_.resolution_m)
    r0, c0 = max(int(rows.min()) - n, 0), max(int(columns.min()) - n, 0)
    values = map_.values[r0 : int(rows.max()) + n + 1, c0 : int(columns.max()) + n + 1]
    corner = np.array([c0, r0, 0.0]) * map_.resolution_m
    return replace(map_, values=values, T_map_origin=se2.compose(map_.T_map_origin, corner))


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


def _check(map_: Raster, occupied: NDArray[np.bool_], free: NDArray[np.bool_], source: str) -> None:
    """Raise ``InvalidValueError`` for what is too large, nowhere, or no map of rooms."""
    cell_m, away = map_.resolution_m, float(np.abs(map_.T_map_origin[:2]).max())
    side = max(occupied.shape) * cell_m
    if side > MAX_SIDE_M:
        raise InvalidValueError(
            f"{source}: {side:.0f} m long ({cell_m:g} m a cell), at most {MAX_SIDE_M:g} m; is its "
            "resolution in metres?"
        )
    if away > MAX_AWAY_M:
        raise InvalidValueError(
            f"{source}: what is occupied begins {away:g} m from the origin of the map, expected at "
            f"most {MAX_AWAY_M:g} m"
        )
    if not occupied.any() or not free.any():
        what = "occupied" if free.any() else "free"
        raise InvalidValueError(f"{source}: has no {what} cells (are its thresholds right?)")
    edges = sum(int(np.diff(occupied, axis=axis).sum()) for axis in (0, 1))
    if edges * cell_m > MAX_EDGE_M:
        raise InvalidValueError(
            f"{source}: {edges * cell_m:.0f} m of edges of what is occupied, expected at most "
            f"{MAX_EDGE_M:g} m ({NOISE})"
        )


def _thing_boxes(things: list[Thing]) -> Float:
    return np.array([part for thing in things for part in thing.parts]).reshape(-1, 5)


def _figures(
    walls: Float,
    boxes: Float,
    occupied: NDArray[np.bool_],
    floor: Survey,
    cell_m: float,
) -> Figures:
    """``walls`` and all ``boxes`` in the frame of the cells."""
    rows, columns = np.nonzero(skin(occupied, cell_m))
    cells = np.asarray((np.column_stack([columns, rows]) + 0.5) * cell_m, dtype=np.float64)
    back = cv2.distanceTransform((~occupied).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    faces: Float = np.vstack([np.zeros((0, 2)), *(_outline(box) for box in walls)])
    at = np.clip(
        np.floor(faces / cell_m).astype(int), 0, [occupied.shape[1] - 1, occupied.shape[0] - 1]
    )
    off = np.maximum(back[at[:, 1], at[:, 0]] - 0.5, 0.0) * cell_m
    long = 2.0 * walls[:, 2] >= LONG_M
    rects = [rect for own in floor.rooms.values() for rect in own]
    return Figures(
        walls=int(long.sum()),
        pieces=int((~long).sum()),
        wall_m=float(2.0 * walls[:, 2].sum()),
        cells_near=float((gap_to_boxes(cells, boxes) <= NEAR_M).mean()),
        walls_near=float((off <= NEAR_M).mean()) if len(off) else 1.0,
        floor_m2=floor.area_m2,
        shut_off=floor.shut_off,
        rooms_m2=float(sum((c - a) * (d - b) for a, b, c, d in rects)),
    )


def _outline(box: Float) -> Float:
    """(n, 2) points along the two long sides of a box, 2 cm apart."""
    x, y, a, b, yaw = box.tolist()
    u = np.linspace(-a, a, max(2, round(2.0 * a / 0.02)))
    local = np.vstack([np.column_stack([u, np.full(len(u), side)]) for side in (-b, b)])
    return np.asarray(se2.transform(np.array([x, y, yaw]), local))


def _moved(boxes: Float, T: Float) -> Float:
    """(n, 5) boxes in another frame."""
    found = boxes.copy()
    found[:, :2] = se2.transform(T, boxes[:, :2])
    found[:, 4] += T[2]
    return found


def _dense(path: Float) -> Float:
    """Points along a way, no two further apart than 5 cm."""
    steps = np.hypot(*np.diff(path, axis=0).T)
    n = np.maximum(np.ceil(steps / 0.05).astype(int), 1)
    parts = [
        np.linspace(a, b, k, endpoint=False)
        for a, b, k in zip(path, path[1:], n.tolist(), strict=False)
    ]
    return np.ascontiguousarray(np.vstack([*parts, path[-1:]]))


def _gaps(boxes: Float, points: Float) -> Float:
    """(n,) m from each box to the nearest of some points."""
    return np.array([float(gap_to_boxes(points, box[None]).min()) for box in boxes])

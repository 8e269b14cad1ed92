# SPDX-License-Identifier: Apache-2.0
"""Where the floor of a building is, given its walls: start, spots to visit, rooms, passages."""

import math
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from scenes.from_map import floor as floors
from scenes.from_map.ends import ends_of
from scenes.from_map.floor import Passage, Point, Rect
from scenes.from_map.walls import footprint
from scenes.plan_file import check_span
from slam import se2
from slam.errors import InvalidValueError
from slam.frames import Float

Mask = NDArray[np.bool_]
Pose = tuple[float, float, float]

FLOOR_M, MOST_CELLS = 0.05, 1 << 22  # cells of floor, and so many at most
SPECK_M = 0.2  # unknown specks of floor up to that are floor
LEAK_M = 0.55  # a narrower gap in a wall leads nowhere
GATE_M = 1.6  # what is connected to the edge of a map by a narrower gap is not outside
INSIDE = 0.3  # share of free floor that is inside, or else the walls have too many gaps to say
NEAR_PATH_M = 4.0  # floor of a log is so near to the robot's way
DOOR_CLEAR_M = 1.7  # from the middle of a door to a spot to visit: 1.2 m from its hinge
DOOR_M = (0.7, 1.2)  # gaps that may be doors
RIM = 2  # cells around the floor when rooms are cut
EDGE_M = 0.5  # of floor round the rooms


@dataclass(frozen=True, kw_only=True)
class Survey:
    """What was found, in the frame of the map, m and rad.

    rooms    name -> rectangles xmin, ymin, xmax, ymax     area_m2  that the robot can reach
    shut_off  m2 of the largest part of the floor that it cannot reach, and a place there
    gaps     passages as wide as a door
    bounds   around all rooms and the walls next to them
    ends     (n, 5) boxes that shut the floor off where it ends without a wall
    """

    start: Pose
    goals: tuple[Point, ...]
    rooms: dict[str, tuple[Rect, ...]]
    gaps: tuple[Passage, ...]
    area_m2: float
    shut_off: tuple[float, Point]
    bounds: Rect
    ends: Float


def survey(  # noqa: PLR0913 (what is known of a building)
    cells: "Cells",
    free: Mask,
    walls: Float,
    things: Float,
    *,
    start: Pose | None = None,
    path: Float | None = None,
    robot_m: float = floors.ROBOT_M,
    source: str = "map",
) -> Survey:
    """The floor of a building.

    free           which cells are free floor
    walls, things  (n, 5) boxes in the frame of the cells; things stand on floor
    start, path, robot_m  as in ``FromMap``
    Raises ``InvalidValueError`` where there is no floor for a robot.
    """
    built, leak = cells.raster(walls), 0.5 * LEAK_M / cells.cell_m
    ground = _filled(free, cells) & ~built
    passable = ~built & ~cells.raster(things)
    if path is not None:
        driven = cells.beside(path, robot_m + floors.MARGIN_M + 2.0 * cells.cell_m)
        ground, passable = ground | driven, passable | driven
        known = ground
        wide = floors.clearance(ground, cells.cell_m) >= 0.5 * LEAK_M
        ground &= _away(cells.reached(driven, wide | driven, NEAR_PATH_M)) <= leak
    else:
        inside = ground & ~_outside(built, cells)
        if inside.sum() >= INSIDE * ground.sum():
            ground = inside
        known = ground
    clear = floors.clearance(ground, cells.cell_m)
    labels = floors.rooms_of(clear, ground)
    outdoors = set(floors.outdoors(labels, built))
    if path is not None:
        outdoors -= set(np.unique(labels[cells.beside(path, 0.0)]).tolist())
    ground &= ~np.isin(labels, sorted(outdoors))
    passable_m = floors.clearance(ground & passable, cells.cell_m)
    begin = floors.start_cell(passable_m, cells.at(start), robot_m, source)
    reach = floors.reachable(passable_m, begin, robot_m)
    area = float(reach.sum()) * cells.cell_m**2
    if area < floors.LEAST_M2:
        raise InvalidValueError(
            f"{source}: {floors.in_words(robot_m)} can reach {area:.1f} m2 of floor only, expected "
            f"at least {floors.LEAST_M2:g} m2; {floors.ANOTHER}is it a map of rooms, or noise?"
        )
    labels[~(ground & (_away(reach) * cells.cell_m <= floors.ROOM_M))] = 0  # not beside its ways
    gaps = [
        gap
        for gap in floors.passages_of(labels, clear, cells.cell_m)
        if DOOR_M[0] <= gap.wide_m <= DOOR_M[1]
    ]
    away = reach & ~_beside([gap.at for gap in gaps], cells)
    found = floors.spots(passable_m, away if away.any() else reach, begin, cells.cell_m, robot_m)
    spots = cells.points([begin, *found])
    least_m = floors.RECT_M * min(1.0, robot_m / floors.ROBOT_M)
    rooms = _rooms(labels, cells, least_m, source)
    x, y = start[:2] if start is not None else spots[0]
    goals = [spot for spot in spots[1:] if _inside(spot, rooms)] or spots[1:]
    if not _inside((x, y), rooms):
        half = math.sqrt(0.5) * (
            robot_m + floors.MARGIN_M
        )  # in a corner that the rectangles leave out
        rooms["start"] = ((x - half, y - half, x + half, y + half),)
    bounds = _bounds_of(rooms)
    return Survey(
        start=start or (*spots[0], 0.0),
        goals=tuple(goals),
        rooms=rooms,
        gaps=tuple(replace(gap, at=cells.in_map(gap.at)) for gap in gaps),
        area_m2=area,
        shut_off=_shut_off(passable_m, reach, cells, robot_m),
        bounds=bounds,
        ends=_ends(known & cells.rect(bounds), reach, built, cells, robot_m),
    )


class Cells:
    """Cells of a few centimetres on which floor is looked at: each of ``n`` x ``n`` of the map.

    shape, cell_m  of the map and of a cell of it       T_map_cells  (3,) pose of their corner
    """

    def __init__(self, shape: tuple[int, ...], cell_m: float, T_map_cells: Float) -> None:
        self.n = max(1, round(FLOOR_M / cell_m))
        while shape[0] * shape[1] > MOST_CELLS * self.n**2:
            self.n += 1
        self.shape = (-(-shape[0] // self.n), -(-shape[1] // self.n))
        self.cell_m, self.T_map_cells = cell_m * self.n, T_map_cells

    def mostly(self, mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Which of our cells are set for the most part, given those of the map."""
        down, right = (n * self.n - size for n, size in zip(self.shape, mask.shape, strict=True))
        blocks = np.pad(mask, ((0, down), (0, right))).reshape(self.shape[0], self.n, -1, self.n)
        return np.asarray(2 * blocks.sum(axis=(1, 3)) > self.n * self.n)

    def raster(self, boxes: Float) -> NDArray[np.bool_]:
        """Which cells a box touches, (n, 5) in their frame."""
        return raster_of(boxes, self.shape, self.cell_m)

    def rect(self, rect: Rect) -> NDArray[np.bool_]:
        """Which cells lie in a rectangle along the axes of the map."""
        a, b, c, d = rect
        middle = np.array([0.5 * (a + c), 0.5 * (b + d), 0.0])
        x, y, yaw = se2.compose(se2.inverse(self.T_map_cells), middle).tolist()
        return self.raster(np.array([[x, y, 0.5 * (c - a), 0.5 * (d - b), yaw]]))

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

    def in_map(self, pose: Pose) -> Pose:
        """A pose in the frame of the cells, in the map."""
        x, y, yaw = se2.compose(self.T_map_cells, np.array(pose)).tolist()
        return x, y, yaw

    def beside(self, path: Float, metres: float) -> NDArray[np.bool_]:
        """Cells within that distance of a way, (n, 2) m in the map."""
        way = np.zeros(self.shape, dtype=np.uint8)
        points = np.ascontiguousarray(self._cells(path)[:, ::-1], dtype=np.int32)
        cv2.polylines(way, [points.reshape(-1, 1, 2)], False, 1)
        return np.asarray(_away(way > 0) * self.cell_m <= metres)

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


def _bounds_of(rooms: dict[str, tuple[Rect, ...]]) -> Rect:
    rects = np.array([rect for own in rooms.values() for rect in own])
    low, high = rects[:, :2].min(axis=0) - EDGE_M, rects[:, 2:].max(axis=0) + EDGE_M
    return float(low[0]), float(low[1]), float(high[0]), float(high[1])


def _shut_off(clear: Float, reach: Mask, cells: Cells, robot_m: float) -> tuple[float, Point]:
    left = np.where(reach, 0.0, clear)
    wide = (left >= robot_m + floors.MARGIN_M).astype(np.uint8)
    _, labels, stats, _ = cv2.connectedComponentsWithStats(wide, connectivity=4)
    largest = 1 + int(np.argmax(stats[1:, cv2.CC_STAT_AREA])) if len(stats) > 1 else -1
    part = labels == largest
    row, column = divmod(int(np.argmax(np.where(part, left, 0.0))), left.shape[1])
    area = float((_away(part) * cells.cell_m <= robot_m).sum()) * cells.cell_m**2
    return area, cells.points([(row, column)])[0]


def _ends(known: Mask, reach: Mask, built: Mask, cells: Cells, robot_m: float) -> Float:
    """Walls round the floor in one piece with what the robot can reach; through what is too narrow
    no way leads."""
    room_m = robot_m + floors.MARGIN_M
    half_m = min(0.5 * LEAK_M, room_m)
    wide = floors.clearance(known, cells.cell_m) >= half_m
    _, labels = cv2.connectedComponents(wide.astype(np.uint8), connectivity=4)
    own = wide & np.isin(labels, np.unique(labels[reach & wide]))
    near = (_away(own) * cells.cell_m <= half_m) | (_away(reach) * cells.cell_m <= room_m)
    return ends_of(near & known, built, cells.cell_m)


def _inside(at: Point, rooms: dict[str, tuple[Rect, ...]]) -> bool:
    x, y = at
    return any(a <= x <= c and b <= y <= d for own in rooms.values() for a, b, c, d in own)


def raster_of(boxes: Float, shape: tuple[int, ...], cell_m: float) -> NDArray[np.bool_]:
    """Which cells a box touches."""
    cells = np.zeros(shape, dtype=np.uint8)
    for box in boxes:
        window, inside = footprint(box, shape, cell_m, 0.5 * cell_m)
        cells[window] |= inside
    return cells.astype(bool)


def _beside(poses: list[Pose], cells: Cells) -> Mask:
    """Cells near to where doors may hang, in the frame of the cells."""
    found = np.zeros(cells.shape, dtype=np.uint8)
    for x, y, _ in poses:
        at = (int(x / cells.cell_m), int(y / cells.cell_m))
        cv2.circle(found, at, round(DOOR_CLEAR_M / cells.cell_m), 1, -1)
    return found > 0


def _filled(free: Mask, cells: Cells) -> Mask:
    """Free floor, and specks in it that no beam happened to cross."""
    reach = 0.5 * SPECK_M / cells.cell_m
    n = round(reach) + 2
    apart = _away(np.pad(free, n)) > reach
    return np.asarray((_away(apart) > reach)[n:-n, n:-n])


def _away(mask: Mask) -> NDArray[np.float32]:
    """Cells from each cell to the nearest that is set; far where none is."""
    if not mask.any():
        return np.full(mask.shape, np.inf, dtype=np.float32)
    far = cv2.distanceTransform((~mask).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    return np.asarray(far, dtype=np.float32)


def _outside(walls: Mask, cells: Cells) -> Mask:
    """Cells to which something as wide as ``GATE_M`` gets from beyond the map."""
    reach = 0.5 * GATE_M / cells.cell_m
    n = round(reach) + 2
    wide = (_away(np.pad(walls, n)) > reach).astype(np.uint8)
    _, labels = cv2.connectedComponents(wide, connectivity=4)
    out = _away((labels == labels[0, 0]) & (wide > 0)) <= reach
    return np.asarray(out[n:-n, n:-n])


def _rooms(
    labels: NDArray[np.int32], cells: Cells, least_m: float, source: str
) -> dict[str, tuple[Rect, ...]]:
    """Rectangles along the axes of the map, of floor that is all of one room."""
    from scipy.ndimage import find_objects

    cell_m, T_map_cells = cells.cell_m, cells.T_map_cells
    height, width = labels.shape
    low, high = _corners((0, 0, width, height), cell_m, T_map_cells)
    at_x, at_y = (np.flatnonzero(labels.any(axis=axis)) for axis in (0, 1))
    box = int(at_x[0]), int(at_y[0]), int(at_x[-1]) + 1, int(at_y[-1]) + 1
    first, last = _corners(box, cell_m, T_map_cells)
    check_span(f"{source}: its floor", (*first.tolist(), *last.tolist()))
    step = floors.CELL_M
    begin = np.maximum(np.floor((first - low) / step) - RIM, 0.0).astype(int)
    end = np.ceil(np.minimum((last - low) / step + RIM, (high - low) / step)).astype(int)
    x, y = (low[k] + (np.arange(begin[k], end[k]) + 0.5) * step for k in (0, 1))
    rows, columns = len(y), len(x)
    points = np.column_stack([np.tile(x, rows), np.repeat(y, columns)])
    at = np.floor(se2.transform(se2.inverse(T_map_cells), points) / cell_m).astype(int)
    known = ((at >= 0) & (at < [width, height])).all(axis=1)
    here = np.zeros(len(at), dtype=np.float32)
    here[known] = labels[at[known, 1], at[known, 0]]
    middles = here.reshape(rows, columns)
    around = np.ones((3, 3), np.uint8)
    same = cv2.erode(middles, around) == cv2.dilate(middles, around)
    coarse = np.where(same, middles, 0.0).astype(np.int32)
    found: dict[str, tuple[Rect, ...]] = {}
    n_rects = 0
    for label, window in enumerate(find_objects(coarse), 1):
        if n_rects >= floors.MAX_RECTS:
            break
        own = coarse[window] == label if window else np.zeros((0, 0), dtype=bool)
        rects = floors.rectangles(own, round(least_m / step), floors.ROOM_RECTS, 0.9)
        if not rects:
            continue
        n_rects += len(rects)
        i0, j0 = (along.start for along in window)
        x0, y0 = low[0] + (begin[0] + j0) * step, low[1] + (begin[1] + i0) * step
        corners = np.array(rects)[:, [1, 0, 3, 2]] * step + [x0, y0, x0, y0]
        found[f"room{len(found)}"] = tuple(map(tuple, corners.tolist()))
    return found


def _corners(box: tuple[int, ...], cell_m: float, T_map_cells: Float) -> tuple[Float, Float]:
    """Least and greatest (x, y) m in the map of a box of cells: columns and rows, from and to."""
    corners = np.array([[box[i], box[j]] for i in (0, 2) for j in (1, 3)]) * cell_m
    points = se2.transform(T_map_cells, corners)
    return points.min(axis=0), points.max(axis=0)

# SPDX-License-Identifier: Apache-2.0
"""Plausible places for the things of a scene: seats and spots, rows along walls, floor at a wall.

Goals, doorways and the robot's start stay clear, and so do the ways between the goals: whatever
stands at these places, the robot can do its tour.
"""

import functools
import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from scenes.assembly import room_of
from scenes.kinds import kind_of
from scenes.placement import gap_to_boxes
from scenes.scene import Mover, Pose, Scene
from slam._jit import njit
from slam.frames import Float

Rect = tuple[float, float, float, float]

MARGIN_M = 0.03  # m between hulls, and between a hull and a box
CELL_M = 0.1  # m between the nodes on which floor is looked for
LARGE_M2 = 2e4  # m2 of floor times goals from which on ways are found on coarser nodes
AT_WALL_M = 0.35  # m from a hull to the furniture or wall that it stands at, at most
ROW_M = 0.08  # m between two hulls in a row
DOORWAY_M, GOAL_M, START_M = 0.65, 0.45, 0.7  # m kept clear, as in ``scenes.recipe``
WAY_M = 0.36  # m kept clear either side of a way: the robot's hull and 0.1 m
SWING_RAD = (0.6, 0.9, 1.25, 1.5, 1.75)  # rad, where the leaf of a door may rest
LEAF_M = 0.025  # m, half thickness of a leaf
TIGHT_M = 0.6  # m, ways keep that far from walls where they can
SEAT_BACK = ((0.0, 0.0), (0.12, 0.35), (0.25, -0.4))  # m a chair is pulled out, rad it is turned

SEATED, IN_ROW, AT_WALL = range(3)  # sorts of places


class Candidates(NamedTuple):
    """Places for things of one kind, by sort: rows ``first[s]`` to ``first[s + 1]`` are sort s.

    poses  (n, 3) x m, y m, heading rad       first  (4,)
    """

    poses: Float
    first: NDArray[np.int64]


@njit
def fits(x: float, y: float, radius: float, own: int, discs: Float, boxes: Float) -> bool:
    """Whether a hull has room among discs (n, 3) other than its ``own``, and boxes (m, 5)."""
    for k in range(len(discs)):
        dx, dy, reach = x - discs[k, 0], y - discs[k, 1], radius + discs[k, 2] + MARGIN_M
        if k != own and dx * dx + dy * dy < reach * reach:
            return False
    reach = radius + MARGIN_M
    for k in range(len(boxes)):
        dx, dy = x - boxes[k, 0], y - boxes[k, 1]
        far = reach + boxes[k, 2] + boxes[k, 3]
        if dx * dx + dy * dy > far * far:
            continue
        cos, sin = math.cos(boxes[k, 4]), math.sin(boxes[k, 4])
        out_x = max(abs(dx * cos + dy * sin) - boxes[k, 2], 0.0)
        out_y = max(abs(dy * cos - dx * sin) - boxes[k, 3], 0.0)
        if out_x * out_x + out_y * out_y < reach * reach:
            return False
    return True


class Places:
    """Where each kind of thing may stand in one scene.

    boxes    (n, 5) walls, furniture, and doors' leaves wherever they may rest
    kept     (k, 3) discs x, y, radius m that stay clear
    way      (w, 2) points of the ways between start and goals, m
    """

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        doors = [(scene.initial[m.name], m.radius) for m in scene.movers if m.kind == "door"]
        self.boxes: Float = np.vstack([scene.obstacles.reshape(-1, 5), resting_leaves(scene)])
        self.kept = _kept(scene, doors)
        xmin, ymin, xmax, ymax = (float(b) for b in scene.bounds)
        goals = np.array([scene.start[:2], *scene.goals.values()], dtype=np.float64)
        walls = np.ascontiguousarray(scene.obstacles, dtype=np.float64).tobytes()
        self.way = _ways((xmin, ymin, xmax, ymax), walls, goals.tobytes())
        self._floor = self._nodes()
        self._known: dict[str, Candidates] = {}

    def of(self, mover: Mover) -> Candidates:
        """Places for a thing."""
        if mover.kind not in self._known:
            long = mover.group not in ("chair", "bin")
            radius = room_of(mover)
            rows, walls = self._rows(radius), self._at_walls(radius, long=long)
            if long:  # its long side to the wall
                rows[:, 2] += 0.5 * math.pi
            parts = [self._marked(mover), rows, walls]
            first = np.cumsum([0, *map(len, parts)]).astype(np.int64)
            self._known[mover.kind] = Candidates(np.vstack(parts), first)
        return self._known[mover.kind]

    def _clear(self, poses: Float, radius: float, *, ways: bool) -> Float:
        """Those of (n, 3) poses at which a hull touches nothing that stays."""
        if not len(poses):
            return poses.reshape(-1, 3)
        points = np.ascontiguousarray(poses[:, :2])
        free = gap_to_boxes(points, self.boxes) >= radius + MARGIN_M
        free &= _gap_to_discs(points, self.kept) >= radius
        if ways and len(self.way):
            discs = np.column_stack([self.way, np.full(len(self.way), WAY_M)])
            free &= _gap_to_discs(points, discs) >= radius
        return np.ascontiguousarray(poses[free])

    def _marked(self, mover: Mover) -> Float:
        """Seats for chairs, spots of their kind for others; a chair also pulled out."""
        group, poses = mover.group, []
        for kind, (x, y, yaw) in self.scene.places:
            if kind == "opening":
                continue
            if group == "chair" and kind_of(kind).group == "chair":
                for back, turn in SEAT_BACK:
                    c, s = math.cos(yaw), math.sin(yaw)
                    poses.append((x - back * c, y - back * s, yaw + turn))
            elif group != "chair" and kind == mover.kind:
                poses.append((x, y, yaw))
        return self._clear(np.array(poses).reshape(-1, 3), room_of(mover), ways=False)

    def _rows(self, radius: float) -> Float:
        """Places side by side along the walls of each room, backs to the wall."""
        poses: list[Pose] = []
        step, off = 2.0 * radius + ROW_M, radius + 1.5 * MARGIN_M
        for x0, y0, x1, y1 in self.scene.rooms.values():
            for inset in (off, off + 0.1):
                along_x = np.arange(x0 + off, x1 - off, step).tolist()
                along_y = np.arange(y0 + off, y1 - off, step).tolist()
                poses += [(x, y0 + inset, 0.5 * math.pi) for x in along_x]
                poses += [(x, y1 - inset, -0.5 * math.pi) for x in along_x]
                poses += [(x0 + inset, y, 0.0) for y in along_y]
                poses += [(x1 - inset, y, math.pi) for y in along_y]
        rows = self._clear(np.array(poses).reshape(-1, 3), radius, ways=True)
        if not len(rows):
            return rows
        gap = gap_to_boxes(np.ascontiguousarray(rows[:, :2]), self.boxes)
        return np.ascontiguousarray(rows[gap < radius + 0.15])

    def _at_walls(self, radius: float, *, long: bool) -> Float:
        """Free floor near furniture or a wall; what is ``long`` stands along it."""
        points = self._floor
        if not len(points):
            return np.zeros((0, 3))
        gap = gap_to_boxes(points, self.boxes)
        near = points[(gap >= radius + MARGIN_M) & (gap < radius + AT_WALL_M)]
        # every heading alike often: by the golden angle
        yaw = np.remainder(np.arange(len(near)) * 2.399963229728653, math.tau) - math.pi
        if long:
            east, north = (self._slope(near, axis) for axis in (0, 1))
            yaw = np.array([math.atan2(e, -n) for e, n in zip(east, north, strict=True)])
        return self._clear(np.column_stack([near, yaw]), radius, ways=True)

    def _slope(self, points: Float, axis: int) -> list[float]:
        """How fast the gap to what stands still grows along x or y."""
        step = np.eye(2)[axis] * 0.5 * CELL_M
        ahead, behind = (
            gap_to_boxes(points + step, self.boxes),
            gap_to_boxes(points - step, self.boxes),
        )
        slopes: list[float] = (ahead - behind).tolist()
        return slopes

    def _nodes(self) -> Float:
        """(n, 2) nodes of the floor of all rooms, m."""
        found = [np.zeros((0, 2))]
        for x0, y0, x1, y1 in self.scene.rooms.values():
            x = np.arange(x0 + CELL_M, x1, CELL_M)
            y = np.arange(y0 + CELL_M, y1, CELL_M)
            found.append(np.column_stack([np.repeat(x, len(y)), np.tile(y, len(x))]))
        return np.ascontiguousarray(np.vstack(found))


@functools.lru_cache(maxsize=8)
def _by_content(key: "_Key") -> Places:
    return Places(key.scene)


class _Key:
    """A scene by what its places depend on: the same room is looked at once."""

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        doors = [(scene.initial[m.name], m.radius) for m in scene.movers if m.kind == "door"]
        facts = (scene.start, scene.bounds, scene.places, doors)
        rooms = (sorted(scene.goals.items()), sorted(scene.rooms.items()))
        self._content = repr((facts, rooms)), scene.obstacles.tobytes()

    def __hash__(self) -> int:
        return hash(self._content)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Key) and self._content == other._content


def places_of(scene: Scene) -> Places:
    """The places of a scene; what was found for the same room before is used again."""
    return _by_content(_Key(scene))


def resting_leaves(scene: Scene) -> Float:
    """(n, 5) the leaves of all doors as boxes, at each angle at which they may rest."""
    rows = []
    for mover in scene.movers:
        if mover.kind != "door":
            continue
        x, y, yaw = scene.initial[mover.name]
        half, sign = 0.5 * mover.radius, opens_to(scene, mover.name)
        for turn in SWING_RAD:
            a = yaw + sign * turn
            rows.append((x + half * math.cos(a), y + half * math.sin(a), half, LEAF_M, a))
    return np.array(rows, dtype=np.float64).reshape(-1, 5)


def opens_to(scene: Scene, door: str) -> float:
    """1 for a door that opens counter-clockwise, -1 for one that opens clockwise."""
    return math.copysign(1.0, float(scene.spec.joint(f"{door}/hinge").axis[2]))


def _kept(scene: Scene, doors: Sequence[tuple[Pose, float]]) -> Float:
    rows = [(x, y, GOAL_M) for x, y in scene.goals.values()]
    rows.append((scene.start[0], scene.start[1], START_M))
    for (x, y, yaw), width in doors:
        half = 0.5 * width
        rows.append((x + half * math.cos(yaw), y + half * math.sin(yaw), DOORWAY_M))
    rows += [(pose[0], pose[1], DOORWAY_M) for kind, pose in scene.places if kind == "opening"]
    return np.array(rows, dtype=np.float64).reshape(-1, 3)


@njit
def _gap_to_discs(points: Float, discs: Float) -> Float:
    gaps = np.full(len(points), np.inf)
    for i in range(len(points)):
        for k in range(len(discs)):
            dx, dy = points[i, 0] - discs[k, 0], points[i, 1] - discs[k, 1]
            gaps[i] = min(gaps[i], math.sqrt(dx * dx + dy * dy) - discs[k, 2])
    return gaps


@functools.lru_cache(maxsize=8)
def _ways(bounds: Rect, walls: bytes, goals: bytes) -> Float:
    """(w, 2) nodes on the cheapest ways from each goal to all later ones."""
    from scipy.sparse import coo_matrix  # half a second that rooms without change need not pay
    from scipy.sparse.csgraph import dijkstra

    boxes = np.frombuffer(walls, dtype=np.float64).reshape(-1, 5)
    spots = np.frombuffer(goals, dtype=np.float64).reshape(-1, 2)
    x0, y0, x1, y1 = bounds
    large = len(spots) * (x1 - x0) * (y1 - y0) > LARGE_M2
    cell = 2.0 * CELL_M if large else CELL_M
    nx, ny = round((x1 - x0) / cell) + 1, round((y1 - y0) / cell) + 1
    number = np.arange(nx * ny).reshape(ny, nx)
    rows, columns = np.divmod(number.ravel(), nx)
    nodes = np.column_stack([x0 + columns * cell, y0 + rows * cell])
    gap = gap_to_boxes(np.ascontiguousarray(nodes), boxes)
    tight = np.maximum(TIGHT_M - gap, 0.0) / TIGHT_M
    cost = np.where(gap > WAY_M - CELL_M, 1.0 + 4.0 * tight * tight, np.inf).reshape(ny, nx)
    starts, ends, prices = [], [], []
    for di, dj, length in ((0, 1, 1.0), (1, 0, 1.0), (1, 1, 1.414), (1, -1, 1.414)):
        a = number[: ny - di, max(-dj, 0) : nx - max(dj, 0)].ravel()
        b = number[di:, max(dj, 0) : nx - max(-dj, 0)].ravel()
        price = 0.5 * length * (cost.ravel()[a] + cost.ravel()[b])
        there = np.isfinite(price)
        starts.append(a[there])
        ends.append(b[there])
        prices.append(price[there])
    edges = (np.concatenate(prices), (np.concatenate(starts), np.concatenate(ends)))
    graph = coo_matrix(edges, shape=(nx * ny, nx * ny)).tocsr()
    column = np.clip(np.round((spots[:, 0] - x0) / cell), 0, nx - 1).astype(int)
    row = np.clip(np.round((spots[:, 1] - y0) / cell), 0, ny - 1).astype(int)
    at = row * nx + column
    first = at[:1] if large else at  # of a large floor the ways from the start alone
    _, before = dijkstra(graph, directed=False, indices=first, return_predecessors=True)
    used: set[int] = set()
    for k in range(len(first)):
        back, own = before[k].tolist(), set[int]()
        for node in at[k + 1 :].tolist():
            while node >= 0 and node not in own:  # from there on the way back is known
                own.add(node)
                node = back[node]
        used |= own
    return np.ascontiguousarray(nodes[sorted(used)])

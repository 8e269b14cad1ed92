# SPDX-License-Identifier: Apache-2.0
"""What is wrong with a scene: floor that is shut off, spots to visit, gaps in the walls."""

import math
from collections.abc import Iterator, Sequence
from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from scenes import is_file, look
from scenes.placement import gap_to_boxes
from scenes.scene import Scene
from scenes.scene_file import SceneFile, read
from scripts.scene.picture import standing
from sim.driving.drive import TourConfig
from sim.driving.navgrid import CLEAR_M, NavGrid
from slam.frames import Float

Mask = NDArray[np.bool_]

CELL_M, MOST_CELLS = 0.05, 1 << 22
RIM_M = 0.5  # beyond the bounds: whoever gets there is out
NARROW_M = 0.1  # gaps that are narrower are not told
DOOR_M = 1.2  # from a hinge to a spot to visit
LEAST_M2 = 2.0  # of floor; smaller pockets that the robot cannot reach are not told
MOST_TOLD = 5  # pieces of floor, the largest ones
MOST_NAMED = 2  # walls between the start and such a piece, the nearest to the start
STEP_M, MOST_STEPS = 0.01, 2000  # along the way to a piece of floor


def problems(
    scene: Scene, robot_m: float = TourConfig().robot_radius_m, which: str = ""
) -> Iterator[str]:
    """Each a sentence that names the mark or wall; none for a scene that is as it should be.

    robot_m  what the robot keeps clear about its axle
    which    the scene's name: walls are named by the keys of its file
    """
    ground = _Ground(scene, robot_m, which)
    x, y = scene.start[:2]
    if ground.own < 0:
        yield f"mark 'start:robot' at ({x:.2f}, {y:.2f}) is too near to a wall or furniture"
    if not scene.goals:
        yield "there is no mark 'goal:NAME': the robot has nowhere to drive to"
    shut_off = ground.shut_off() if ground.own > 0 else {}
    rooms = list(scene.rooms.values())
    hinges = [scene.initial[m.name] for m in scene.movers if m.kind == "door"]
    for name, (x, y) in scene.goals.items():
        where = f"mark 'goal:{name}' at ({x:.2f}, {y:.2f})"
        if not any(a <= x <= c and b <= y <= d for a, b, c, d in rooms):
            yield f"{where} is in no room"
        parts = ground.parts(x, y)
        for part in sorted(parts & set(shut_off)):
            shut_off[part].append(name)
        if not parts & {ground.own, *shut_off}:
            yield f"{where} cannot be reached by the robot from its start"
        near = min((math.dist((x, y), hinge[:2]) for hinge in hinges), default=math.inf)
        if near < DOOR_M:
            yield f"{where} is {near:.2f} m from a hinge, expected at least {DOOR_M} m"
    for label, goals in shut_off.items():
        yield ground.why(label, goals)
    way_out = ground.gap_to_nowhere()
    if way_out is not None:
        wide, (u, v) = way_out
        yield (
            f"the walls have a gap to nowhere: {wide:.1f} m wide, at ({u:.2f}, {v:.2f}), "
            f"{ground.beside((u, v))}"
        )


class _Ground:
    """Where the robot has room, and which of it hangs together.

    labels  of cells with room for its middle, 0 elsewhere
    own     that of the start; -1 where the robot has no room there
    """

    def __init__(self, scene: Scene, robot_m: float, which: str) -> None:
        self.scene, self.robot_m, self._which = scene, robot_m, which
        self._file = read(Path(which)) if is_file(which) else None
        x0, y0, x1, y1 = _wider(scene, RIM_M + CLEAR_M)
        cell = max(CELL_M, math.sqrt((x1 - x0) * (y1 - y0) / MOST_CELLS))
        radius = max(robot_m - 0.5 * cell, 0.5 * cell)
        self.grid = NavGrid((x0, y0, x1, y1), scene.obstacles, radius, cell)
        self.cell = cell
        self.labels = _parts(self.grid.clearance >= radius)
        self.own = max(self.parts(*scene.start[:2]), default=-1)
        self._edge = ~self._inside([_wider(scene, RIM_M)])

    def parts(self, x: float, y: float) -> set[int]:
        """The parts of the ground that have cells within one of that place."""
        return set(self.labels[self.grid.around(x, y)].ravel().tolist()) - {0}

    def shut_off(self) -> dict[int, list[str]]:
        """An empty list for each large part that the robot cannot reach, the largest first.

        Of drawn walls without ``rooms`` all that they enclose is floor.
        """
        outside = set(np.unique(self.labels[self._edge]).tolist())
        floor = self._inside(list(self.scene.rooms.values()))
        if self._file is not None and self._file.walls and not self._file.rooms:
            floor = ~np.isin(self.labels, sorted(outside))
        cells = np.bincount(self.labels[floor], minlength=self.own + 1)
        cells[[0, self.own]] = 0
        found = np.argsort(-cells, kind="stable")[: 4 * MOST_TOLD].tolist()
        large = [k for k in found if cells[k] and self._area(self.labels == k) >= LEAST_M2]
        return {k: [] for k in large[:MOST_TOLD]}

    def why(self, label: int, goals: Sequence[str]) -> str:
        """Which walls shut a part off, or how narrow the widest way to it is."""
        here, part = self.labels == self.own, self.labels == label
        x, y = self._at(int(np.argmax(np.where(part, self.grid.clearance, 0.0))))
        with_goals = f", with goals {', '.join(goals)}," if goals else ""
        told = (
            f"{self._area(part):.0f} m2 of floor about ({x:.1f}, {y:.1f}){with_goals} cannot be "
            "reached from the start: "
        )
        way = self._widest(self.grid.clearance, here, part)
        if way is None:
            return f"{told}{self._between(here, part)}"
        wide, (u, v) = way
        return (
            f"{told}the way is {wide:.2f} m wide at ({u:.2f}, {v:.2f}), "
            f"{self.beside((u, v))}; the robot needs {2.0 * self.robot_m:.2f} m"
        )

    def _between(self, here: Mask, part: Mask) -> str:
        """What stands where they are nearest to each other shuts one off from the other."""
        between = self._at(int(np.argmin(_away(here) + _away(part))))
        (a, b), (c, d) = (self._nearest(mask, between) for mask in (here, part))
        n = min(max(2, round(math.dist((a, b), (c, d)) / STEP_M)), MOST_STEPS)
        line = np.column_stack([np.linspace(a, c, n), np.linspace(b, d, n)])
        gaps = np.array([gap_to_boxes(line, box[None]) for box in self.scene.obstacles])
        nearest = gaps.min(axis=1)
        crossed = np.flatnonzero(nearest == nearest.min())  # 0, but for gaps that are not told
        crossed = crossed[np.argsort(gaps[crossed].argmin(axis=1), kind="stable")]
        more = f" (and {len(crossed) - MOST_NAMED} more)" if len(crossed) > MOST_NAMED else ""
        shut = "shuts" if len(crossed) == 1 else "shut"
        return f"{self._names(crossed[:MOST_NAMED].tolist())}{more} {shut} it off"

    def gap_to_nowhere(self) -> tuple[float, tuple[float, float]] | None:
        """The widest way from the start or a goal out of the scene: how wide at its narrowest, and
        where.

        None where walls are all around. A door that stands before a gap shuts it.
        """
        leaves = [
            [*_middle(self.scene.initial[m.name], half), half, 0.03, self.scene.initial[m.name][2]]
            for m, half in ((m, 0.5 * m.radius) for m in self.scene.movers if m.group == "door")
        ]
        clear = self.grid.with_boxes(np.array(leaves).reshape(-1, 5)).clearance
        spots = np.array([self.scene.start[:2], *self.scene.goals.values()])
        cells = np.floor((spots - [self.grid.x0, self.grid.y0]) / self.cell).astype(int).T
        column, row = (
            np.clip(at, 0, n - 1) for at, n in zip(cells, clear.shape[::-1], strict=True)
        )
        here = np.zeros(clear.shape, dtype=bool)
        here[row, column] = True
        return self._widest(clear, here, self._edge)

    def _widest(
        self, clear: Float, here: Mask, there: Mask
    ) -> tuple[float, tuple[float, float]] | None:
        """The widest way from one to the other: how wide at its narrowest, and where; None where
        none is wider than ``NARROW_M``."""

        def way(least: float) -> Mask:
            labels = _parts(clear > least)
            return np.isin(labels, np.setdiff1d(labels[here], [0]))

        low, high = 0.5 * NARROW_M, float(clear[here].max())
        if not (way(low) & there).any():
            return None
        for _ in range(12):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if (way(middle) & there).any() else (low, middle)
        inner, wide = way(high) | here, _parts(clear > high)
        outer = there | np.isin(wide, np.setdiff1d(np.unique(wide[there]), [0]))
        between = np.where(way(low), np.maximum(_away(inner), _away(outer & ~inner)), np.inf)
        return 2.0 * low, self._at(int(np.argmin(between)))

    def beside(self, at: tuple[float, float]) -> str:
        """The two nearest of what stands, by name."""
        point = np.array([at])
        gaps = [float(gap_to_boxes(point, box[None])[0]) for box in self.scene.obstacles]
        return f"beside {self._names(np.argsort(gaps)[:2].tolist())}"

    def _names(self, rows: Sequence[int]) -> str:
        """Obstacles as their files call them."""
        names = [geom.name for geom in self.scene.spec.geoms]
        walls = [name for name in names if name.partition(":")[0] in look.WALLS]
        parts = standing(self.scene)
        found = []
        for row in rows:
            if row < len(walls):
                found.append(_wall(walls[row], self._file, self.scene.plan_file))
                continue
            spot = self.scene.obstacles[row][:2]
            found.append(f"'{min(parts, key=lambda name: math.dist(parts[name], spot))}'")
        return " and ".join(dict.fromkeys(found)) or "nothing"

    def _inside(self, rects: Sequence[tuple[float, float, float, float]]) -> Mask:
        """Cells with their middle in one of some rectangles."""
        found = np.zeros(self.grid.clearance.shape, dtype=bool)
        for a, b, c, d in rects:
            low, high = self._first(b, self.grid.y0), self._first(d, self.grid.y0)
            left, right = self._first(a, self.grid.x0), self._first(c, self.grid.x0)
            found[max(low, 0) : max(high, 0), max(left, 0) : max(right, 0)] = True
        return found

    def _first(self, value: float, begin: float) -> int:
        return math.ceil((value - begin) / self.cell - 0.5)

    def _area(self, part: Mask) -> float:
        """m2 of the floor whose middle line that is."""
        return float((_away(part) * self.cell <= self.robot_m).sum()) * self.cell**2

    def _nearest(self, part: Mask, at: tuple[float, float]) -> tuple[float, float]:
        cells = np.flatnonzero(part)
        i, j = np.divmod(cells, part.shape[1])
        y, x = (i + 0.5) * self.cell + self.grid.y0 - at[1], (j + 0.5) * self.cell + self.grid.x0
        return self._at(int(cells[np.argmin(y * y + (x - at[0]) ** 2)]))

    def _at(self, index: int) -> tuple[float, float]:
        """m, of a cell by its number."""
        row, column = divmod(index, self.labels.shape[1])
        return (
            self.grid.x0 + (column + 0.5) * self.cell,
            self.grid.y0 + (row + 0.5) * self.cell,
        )


def _wall(name: str, file: SceneFile | None, plan_file: str) -> str:
    """A wall by file and key: the polyline of a drawn one, else its geom."""
    if file is None or not file.walls:
        return f"{plan_file}: geom '{name}'"
    key = name.partition(":")[2]
    lines = [
        f"{file.path}: walls[{k}] from ({a[0]:g}, {a[1]:g}) to ({b[0]:g}, {b[1]:g})"
        for k, line in enumerate(file.walls)
        for a, b in pairwise(line)
    ]
    return lines[int(key)] if key.isdigit() else f"{file.path}: '{key}' of things"


def _parts(free: Mask) -> NDArray[np.int32]:
    """A number for each part that hangs together, 0 for what is not free."""
    return np.asarray(cv2.connectedComponents(free.astype(np.uint8), connectivity=4)[1])


def _away(mask: Mask) -> Float:
    """Cells from each cell to the nearest of a mask."""
    far = cv2.distanceTransform((~mask).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    return np.asarray(far, dtype=np.float64)


def _middle(pose: tuple[float, float, float], along: float) -> tuple[float, float]:
    return pose[0] + along * math.cos(pose[2]), pose[1] + along * math.sin(pose[2])


def _wider(scene: Scene, by: float) -> tuple[float, float, float, float]:
    a, b, c, d = scene.bounds
    return a - by, b - by, c + by, d + by

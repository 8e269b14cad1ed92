# SPDX-License-Identifier: Apache-2.0
"""Change out of sight: what the robot has seen stands elsewhere when it sees it again.

Every ``PERIOD_S``, each thing that the robot has seen since it was last drawn and that is out of
view now is drawn once: with probability ``share`` it is rearranged there and then, to another
plausible place (``scenes.arrangement``) that is out of view too, or in exchange with another thing
that was drawn. Where no place is free it is taken out of the building, and brought in later.

What is drawn is a function of the thing and of the moment alone. So nobody else draws other numbers
where one thing is absent, and nothing but a few marks has to be saved.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from scenes.arrangement import IN_ROW, MARGIN_M, Candidates, fits, places_of
from scenes.assembly import room_of
from scenes.scene import Mover, Pose, Scene
from sim.core.bodies import Bodies
from sim.core.seeds import uniform
from sim.core.sight import Eye, View, hidden, opaque_boxes, view_of
from sim.sensors.lidar.surfaces import glass_geoms
from slam._jit import njit
from slam.frames import Float, LaserSpec

Int = NDArray[np.int64]
PERIOD_S = 2.0  # s between two moments
FAR_M, APART_M = 1000.0, 3.0  # from the floor to what is out, beyond any beam; between two of these
ELSEWHERE_M = 0.5  # m, a thing moved by less does not stand elsewhere
REMOVED, SWAPPED = 0.12, 0.12  # of the things rearranged: taken out, exchanged where two are drawn
BACK = 0.5  # of what is out, brought in at a moment
SORTS = (0.45, 0.2, 0.35)  # of the places tried: seats and spots, rows, floor at a wall
TRIES, EACH = 80, 20  # places tried, and of one sort in a row
UNMOVED = ("person", "door", "robot")  # groups that are not rearranged
_STRIDE = np.uint64(0xA24BAED4963EE407)  # sets the moments of one thing apart
SEEN, OUT, PARKED = range(3)  # columns of the marks


@dataclass(frozen=True, kw_only=True)
class Rearrangement:
    """One thing that was rearranged: when, s; which; how; from where, to where (m, m, rad).

    change  "moved", "parked" (in a row at a wall), "unparked", "swapped", "removed", "brought in"
    """

    time_s: float
    name: str
    change: str
    before: Pose
    after: Pose


def is_movable(mover: Mover) -> bool:
    """Whether somebody might put it elsewhere: neither a person nor a door nor the robot."""
    return mover.group not in UNMOVED


def is_out(pose: Float, bounds: tuple[float, float, float, float]) -> bool:
    """Whether a thing at ``pose`` is out of the building."""
    return bool(pose[0] > bounds[2] + 0.5 * FAR_M)


def place_out(row: int, bounds: tuple[float, float, float, float]) -> Pose:
    """Where mover ``row`` is kept while it is out of the building."""
    return bounds[2] + FAR_M + APART_M * row, bounds[1], 0.0


@njit
def find_place(  # noqa: PLR0913 (kernel)
    draws: NDArray[np.uint64],
    start: float,
    thing: tuple[int, float, float, float],
    places: Candidates,
    sorts: tuple[float, float, float],
    around: tuple[Float, Float],
    view: View,
) -> tuple[int, int]:
    """(sort, row of ``places``) of a free place out of view, (-1, -1) where none is found.

    start   in [0, 1): where along the rows to look first
    thing   its row, where it stands x, y, and the radius m of its disc
    sorts   how often each sort of place is tried
    around  discs of all movers and boxes
    """
    own, x, y, radius = thing
    sort = 0
    for attempt in range(TRIES):
        if attempt % EACH == 0 or sort == IN_ROW:  # a row was looked along to its end
            luck, sort = uniform(draws, 0), 0
            while sort < 2 and luck >= sorts[sort]:
                luck, sort = luck - sorts[sort], sort + 1
        first, n = places.first[sort], places.first[sort + 1] - places.first[sort]
        pick = start if sort == IN_ROW else uniform(draws, 0)
        # In a row the next free place is taken, elsewhere another one is drawn.
        for step in range(n if sort == IN_ROW else min(n, 1)):
            row = first + (int(pick * n) + step) % n
            px, py = places.poses[row, 0], places.poses[row, 1]
            dx, dy = px - x, py - y
            if dx * dx + dy * dy < ELSEWHERE_M * ELSEWHERE_M:
                continue
            if hidden(view, px, py, radius) and fits(px, py, radius, own, *around):
                return sort, row
    return -1, -1


@njit
def _fresh(counter: np.uint64, moment: int) -> NDArray[np.uint64]:
    """A generator for a thing and a moment."""
    draws = np.empty(1, dtype=np.uint64)
    draws[0] = counter + np.uint64(moment) * _STRIDE
    return draws


@njit
def note_seen(bodies: NDArray[np.int32], mover_of_body: Int, marks: Int) -> None:
    """Mark what a scan has hit."""
    for body in bodies:
        if body >= 0 and mover_of_body[body] >= 0:
            marks[mover_of_body[body], SEEN] = 1


class Rearranging:
    """Who rearranges the things of one world while the robot looks elsewhere."""

    def __init__(
        self,
        model: mujoco.MjModel,
        scene: Scene,
        bodies: Bodies,
        *,
        share: float,
        counters: NDArray[np.uint64],
    ) -> None:
        """``share``: in (0, 1], of what is drawn; ``counters`` one for each mover."""
        self.share, self._counters = share, counters
        self._scene, self._bodies = scene, bodies
        self._places = places_of(scene)
        self._boxes = np.ascontiguousarray(self._places.boxes)
        self._radius = np.array([room_of(m) for m in scene.movers])
        self._rows = [k for k, m in enumerate(scene.movers) if is_movable(m)]
        self._opaque = opaque_boxes(model, scene.scan_height_m, glass_geoms(model))
        self._eyes: tuple[Sequence[LaserSpec], list[Eye]] = ((), [])
        self.marks = np.zeros((len(scene.movers), 3), dtype=np.int64)
        self.moment = np.zeros(1, dtype=np.int64)

    def arrays(self) -> dict[str, NDArray[np.generic]]:
        """The live arrays that are the state."""
        return {"marks": self.marks, "moment": self.moment}

    def seen(self) -> NDArray[np.bool_]:
        """(n,) whether each mover was seen since it was last drawn."""
        since: NDArray[np.bool_] = self.marks[:, SEEN] == 1
        return since

    def due(self, time_s: float) -> bool:
        """Whether a new moment has come; call it before each scan."""
        now = int(time_s / PERIOD_S)
        if now == self.moment[0]:
            return False
        self.moment[0] = now
        return True

    def saw(self, hit: NDArray[np.int32]) -> None:
        """Take in which bodies a scan has hit, -1 for none."""
        note_seen(hit, self._bodies.mover_of_body, self.marks)

    def rearrange(
        self, time_s: float, specs: Sequence[LaserSpec], poses: Float, busy: NDArray[np.bool_]
    ) -> list[Rearrangement]:
        """Write the new poses of what is rearranged into ``poses`` (n, 3).

        specs  of the robot's scanners
        busy  (n,) things that nobody may take: held, sat on, or absent
        """
        if self._eyes[0] != specs:
            self._eyes = (specs, [Eye.of(spec) for spec in specs])
        robot = self._bodies.robot
        assert robot is not None
        view = view_of(self._eyes[1], poses[robot], self._opaque)
        drawn, back = self._drawn(poses, view, busy)
        done: list[Rearrangement] = []
        left = self._swap(time_s, drawn, poses, done)
        for row in left:
            self._move(time_s, row, poses, view, done)
        for row in back:
            luck, before = self._luck(row), poses[row].copy()
            uniform(luck, 0)
            found = self._find(row, poses, view, luck)
            if found is not None:
                sort, poses[row] = found
                self.marks[row] = 0, 0, int(sort == IN_ROW)
                self._note(time_s, row, "brought in", before, poses[row], done)
        return done

    def _luck(self, row: int) -> NDArray[np.uint64]:
        """A generator of that thing for the present moment."""
        return _fresh(self._counters[row], int(self.moment[0]))

    def _drawn(
        self, poses: Float, view: View, busy: NDArray[np.bool_]
    ) -> tuple[list[int], list[int]]:
        """Rows to rearrange now, and rows to be brought in."""
        drawn, back = [], []
        for row in self._rows:
            if busy[row]:
                continue
            if self.marks[row, OUT]:
                if uniform(self._luck(row), 0) < BACK:
                    back.append(row)
                continue
            x, y, _ = poses[row].tolist()
            if self.marks[row, SEEN] and hidden(view, x, y, float(self._radius[row])):
                self.marks[row, SEEN] = 0
                if uniform(self._luck(row), 0) < self.share:
                    drawn.append(row)
        return drawn, back

    def _swap(
        self, time_s: float, drawn: list[int], poses: Float, done: list[Rearrangement]
    ) -> list[int]:
        """Exchange some of the drawn with each other; returns the rest."""
        left, movers = list(drawn), self._scene.movers
        for row in drawn:
            luck = self._luck(row)
            uniform(luck, 0)
            if row not in left or not uniform(luck, 0) < SWAPPED:
                continue
            for other in left:
                near = math.dist(poses[row, :2], poses[other, :2]) < ELSEWHERE_M
                if movers[other].group != movers[row].group or near:
                    continue
                if self._exchange(row, other, poses):
                    for one, two in ((row, other), (other, row)):
                        self._note(time_s, one, "swapped", poses[two], poses[one], done)
                        self.marks[one, PARKED] = 0
                    left = [k for k in left if k not in (row, other)]
                    break
        return left

    def _exchange(self, one: int, two: int, poses: Float) -> bool:
        """Put each where the other stands; False, and nothing done, where one does not fit."""
        trial = poses.copy()
        trial[[one, two]] = poses[[two, one]]
        discs = self._discs(trial)
        for row in (one, two):
            x, y, _ = trial[row].tolist()
            if not fits(x, y, float(self._radius[row]), row, discs, self._boxes):
                return False
        poses[...] = trial
        return True

    def _discs(self, poses: Float) -> Float:
        """(n, 3) x, y, radius m of all movers; doors, which are boxes, far away."""
        discs = np.column_stack([poses[:, :2], self._radius])
        doors = [m.kind == "door" for m in self._scene.movers]
        discs[doors] = 2.0 * FAR_M, 2.0 * FAR_M, 0.0
        return discs

    def _leaves(self, poses: Float) -> Float:
        """All boxes: those of the room, and the leaves as they stand now."""
        rows = []
        for k, mover in enumerate(self._scene.movers):
            if mover.kind == "door":
                x, y, a = poses[k].tolist()
                half = 0.5 * mover.radius
                rows.append((x + half * math.cos(a), y + half * math.sin(a), half, MARGIN_M, a))
        return np.vstack([self._boxes, np.array(rows).reshape(-1, 5)])

    def _find(self, row: int, poses: Float, view: View, luck: NDArray[np.uint64]) -> Any:
        """(sort, pose) of a place for a thing, None where none is found."""
        mover = self._scene.movers[row]
        start = uniform(_fresh(self._counters[0], int(self.moment[0])), 0)
        thing = (row, float(poses[row, 0]), float(poses[row, 1]), float(self._radius[row]))
        places = self._places.of(mover)
        around = (self._discs(poses), self._leaves(poses))
        sort, at = find_place(luck, start, thing, places, SORTS, around, view)
        return None if at < 0 else (sort, places.poses[at].copy())

    def _move(
        self, time_s: float, row: int, poses: Float, view: View, done: list[Rearrangement]
    ) -> None:
        luck, before = self._luck(row), poses[row].copy()
        uniform(luck, 0)
        uniform(luck, 0)
        found = None
        if uniform(luck, 0) >= REMOVED:
            found = self._find(row, poses, view, luck)
        if found is None:
            poses[row] = place_out(row, self._scene.bounds)
            self.marks[row] = 0, 1, 0
            self._note(time_s, row, "removed", before, poses[row], done)
            return
        was, (sort, poses[row]) = self.marks[row, PARKED], found
        self.marks[row, PARKED] = int(sort == IN_ROW)
        change = "parked" if sort == IN_ROW else "unparked" if was else "moved"
        self._note(time_s, row, change, before, poses[row], done)

    def _note(
        self, time_s: float, row: int, change: str, before: Float, after: Float,
        done: list[Rearrangement],
    ) -> None:  # fmt: skip
        places = [(float(p[0]), float(p[1]), float(p[2])) for p in (before, after)]
        name = self._scene.movers[row].name
        done.append(
            Rearrangement(
                time_s=time_s, name=name, change=change, before=places[0], after=places[1]
            )
        )

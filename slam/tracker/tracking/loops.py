# SPDX-License-Identifier: Apache-2.0
"""Loops closed while driving: key frames, a pose graph over them, and when the map follows it.

The work is done a little with each scan, in whole units (``LoopsConfig.work``), so that no scan
takes long and one stream always gives the same result. For each key frame in turn: its step from
those before, a search for a closure, the graph, and ties to every other passage; searches and ties
pause between matches.
"""

import logging
import math
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial

import numpy as np

from slam import se2
from slam.arrays import Float
from slam.frontend.odometry_prior import inverted
from slam.posegraph import Edge, Relaxation, carried, least_moved
from slam.tracker.belief.places import coarse, spread
from slam.tracker.cell_map import CellMap
from slam.tracker.config import TrackerConfig
from slam.tracker.matching.matcher import Matcher
from slam.tracker.tracking.anchors import map_errors
from slam.tracker.tracking.closures import Closures
from slam.tracker.tracking.keys import KeyFrames
from slam.tracker.tracking.merging import LEFT, MOST_KEYS, Merge
from slam.tracker.tracking.passages import Passages
from slam.tracker.tracking.pausing import Pausing
from slam.tracker.tracking.redraw import Correction, Redrawing, torn_keys

RARE_S = 0.3  # s between frames in the mean, from which on each gets all work; set by hand
NEVER = np.full(3, np.inf)  # where a key frame was tied that was not
_log = logging.getLogger(__name__)


class Loops(KeyFrames):
    """Key frames, closures between them, and the corrections that follow."""

    def __init__(
        self,
        config: TrackerConfig,
        matcher: Matcher,
        new_submap: Callable[[], CellMap],
        new_map: Callable[[], CellMap] | None = None,
    ) -> None:
        """``new_submap`` makes an empty map for a few key frames, ``new_map`` one for all of them;
        without the latter, poses of the past are corrected, and nothing else.
        """
        super().__init__(config.loops)
        self._numbers, self._map_config = config.loops, config.map
        self._relocalise = config.tracking.relocalise
        self._new_map = new_map if config.loops.corrects else None
        self.closures = Closures(config, matcher, new_submap, self.keys)
        self._passages = Passages(config.loops, self.keys)
        self.poses: list[Float] = []  # by the graph, of the key frames in it
        self._chain: list[Edge] = []
        self._edges: dict[tuple[int, int], Edge] = {}
        self.weights: dict[tuple[int, int], float] = {}  # of loops; near 0: let go of
        self._pending: list[Edge] = []  # closures that no other confirms so far
        self._begun: Pausing | None = None  # a search or tie
        self._searched = 0  # key frames that were searched for a closure
        self._ties: deque[int] = deque()  # key frames to tie to other passages
        self._tied: list[Float | None] = []  # where each was when it was tied
        self._later: deque[tuple[int, int]] = deque()  # from which key frame on, and where to tie
        self._first: Float = np.zeros(3)
        self._rough: dict[int, tuple[int, int]] = {}  # found by search, by key frame
        self._links: set[tuple[int, int]] = set()  # over losses: not found by matching
        self._tied_to: set[int] = set()  # key frames with ties
        self._again = 0
        self._most = MOST_KEYS  # key frames in the graph, before some are merged
        self._relaxation: Relaxation | None = None
        self._relaxed: list[tuple[int, int]] = []  # loops in it
        self._fresh, self._surprised = 0, False  # loops since the last one, any that is far off
        self._redrawing: Redrawing | None = None
        self._new_graph = False
        self._weighed = False  # the loops were, and nobody asked what follows
        self._moved = False  # the map was corrected
        self._owed = 0  # units spent before the next work

    def hold(self) -> None:
        """The map is not moved from now on."""
        self._new_map, self._redrawing = None, None

    @property
    def edges(self) -> list[Edge]:
        """Loops found so far."""
        return [*self._edges.values()]

    def work(self, spare: float = 1.0) -> None:
        """Up to ``LoopsConfig.work`` units and a piece, fewer where frames come often or only a
        ``spare`` share of a scan's time is left."""
        if self.way_m < self._numbers.early * self._numbers.long_m or len(self.keys) < 3:
            return
        share = self.keys[-1].start_s / self.keys[-1].frame / RARE_S
        spent, most = self._owed, spare * self._numbers.work * min(max(share, 1.0 / 3.0), 1.0)
        self._owed = 0
        while spent < most:
            cost = self._task()
            if cost == 0:
                break
            spent += cost

    def correction(self, poses: Callable[[], Float]) -> Correction | None:
        """The new map, if one is ready, with all (n, 3) ``poses()`` moved into it."""
        redrawing = self._redrawing
        if redrawing is None or not redrawing.done or self._found or redrawing.outrun:
            return None
        self._redrawing, self._moved, self._weighed = None, True, True
        last = len(self.keys) - 1
        T_new_old = se2.compose(redrawing.pose(last), se2.inverse(self.keys[last].T_map_robot))
        after = np.array([redrawing.pose(k) for k in range(len(self.keys))])
        moved = self._carried(after, poses())
        for k, key in enumerate(self.keys):
            self.keys[k] = replace(key, T_map_robot=after[k])
        return Correction(T_new_old=T_new_old, cell_map=redrawing.cell_map, poses=moved)

    def map_error(self) -> Float | None:
        """(3, 3) by which the map is off here, where the latest frame is a key frame and loops were
        weighed before it; else None: the error of the frame before has grown by what was driven.

        A corrected map may have moved its first key frame: by that it is off the known start, too.
        """
        if not self._weighed or self.keys[-1].frame != self.n_frames - 1:
            return None
        self._weighed, self._owed = False, self._cost(48)
        held = {
            pair: edge
            for pair, edge in self._edges.items()
            if self.weights.get(pair, 0.0) > 0.5 and pair not in self._links
        }
        held |= {(edge.a, edge.b): edge for edge in self._chain if edge.b > edge.a + 1}
        found = spread(self._numbers.loop_m, self._numbers.loop_rad)
        errors = map_errors(self.keys, self._all_poses(), held, self.slack, found)
        here = self.keys[-1].T_map_robot
        off = self._from_start(self.keys[0].T_map_robot, here) - here
        off[2] = se2.wrap(float(off[2]))
        return np.asarray(errors[-1] + np.multiply.outer(off, off))

    def _from_start(self, first: Float, T_map_robot: Float) -> Float:
        """(3,) a pose of a map that has the first key frame at ``first``, in the known start's."""
        return se2.compose(self._first, se2.between(first, T_map_robot))

    def corrected(self, poses: Float) -> Float:
        """All (n, 3) poses so far, moved with the graph; the same while the map is not torn.

        A map that holds together knows more than the key frames of the graph. The first key frame
        is where it was at first, whatever the map's datum.
        """
        if self.way_m < self._numbers.long_m or not (self._moved or self._torn_keys(1.0)):
            return poses
        after = self._all_poses()
        return self._carried(np.array([self._from_start(after[0], one) for one in after]), poses)

    def _all_poses(self) -> list[Float]:
        """By the graph; of key frames that it does not have yet, as they followed online."""
        last = len(self.poses) - 1
        return self.poses + [
            se2.compose(self.poses[last], se2.between(self.keys[last].T_map_robot, key.T_map_robot))
            for key in self.keys[last + 1 :]
        ]

    def _carried(self, after: Float, poses: Float) -> Float:
        before = np.array([key.T_map_robot for key in self.keys])
        at = np.interp(np.arange(len(poses)), self._frames, np.arange(len(self._frames)))
        return carried(before[self._stand], after[self._stand], at, poses)

    def _task(self) -> int:
        """One piece of work; its cost in units, 0 if there is none."""
        if self._redrawing is not None and self._redrawing.outrun:
            self._redrawing, self._new_graph = None, True
        if self._redrawing is not None and not self._redrawing.done:
            return self._redrawing.draw()
        if self._relaxation is not None:
            return self._relax(self._relaxation)
        self.closures.spent = 0
        if self._begun is not None:
            return self._go_on(self._begun)
        if self._searched < len(self.poses):
            self._searched += 1
            return self._search(self._searched - 1)
        solve = self._fresh and (self._surprised or self._fresh >= self._numbers.batch)
        if solve or self._too_many():
            self._relaxed = list(self._edges)
            self._relaxation = Relaxation(np.array(self.poses), self._chain + self.edges)
            return self._cost(48)
        if self._ties:
            return self._go_on(Pausing(partial(self._tie, self._ties.popleft())))
        if len(self.poses) < len(self.keys):
            self._append(len(self.poses))
            return 1 + self.closures.spent
        if self._new_graph:
            self._follow()
            return self._cost(128)
        return self._look_again()

    def _go_on(self, task: Pausing) -> int:
        """A task up to where it pauses or ends; the cost."""
        self._begun = task if task.go_on() else None
        return 1 + self.closures.spent

    def _cost(self, edges: int) -> int:
        """Units of work with all edges of the graph: one for so many of them."""
        return 1 + (len(self._chain) + len(self._edges)) // edges

    def _append(self, j: int) -> None:
        """Chain key frame ``j`` to those before."""
        self._tied.append(None)
        if j == 0:
            self._first = self.keys[0].T_map_robot
            self.poses.append(self._first)
            self.closures.chained.append(self.keys[0].T_map_robot)
            return
        step = self.closures.step(j)
        self._chain.append(step)
        self.poses.append(se2.compose(self.poses[-1], step.T_a_b))

    def _search(self, j: int) -> int:
        """Close a loop at key frame ``j`` if it is on one that no tie goes on with; the cost."""
        if self._edges:
            self._ties.append(j)
        closures = [b for a, b in self._edges if (a, b) not in self._links]
        if self.keys[j].found:
            self._link(j)
        if any(b >= j - self._numbers.every for b in closures[-self._numbers.batch :]):
            return 1
        middle = self._passages.nearest_before(j, self.poses)
        return 1 if middle is None else self._go_on(Pausing(partial(self._close, middle, j)))

    def _close(self, middle: int, j: int) -> Iterator[None]:
        predicted = se2.between(self.poses[middle], self.poses[j])
        gate = self._passages.gate(j, middle)
        if edge := (yield from self.closures.search(middle, j, predicted, gate)):
            self._rough[j] = middle, j
            self._take(edge, predicted)

    def _link(self, j: int) -> None:
        """Tie key frame ``j`` to the last one before the robot was lost, by where it was found.

        The steps between are those of odometry; the map says where they led.
        """
        known = next((k for k in range(j - 1, -1, -1) if self.keys[k].written), -1)
        if known < 0 or j - known == 1:
            return
        T_a_b = se2.between(self.keys[known].T_map_robot, self.keys[j].T_map_robot)
        information = inverted(coarse(self._relocalise))
        edge = Edge(a=known, b=j, T_a_b=T_a_b, information=information, robust=True)
        self._edges[known, j] = edge
        self._links.add((known, j))
        self._fresh, self._surprised = self._fresh + 1, True

    def _take(self, edge: Edge, predicted: Float) -> None:
        """Put a closure into the graph; one that is far off only if another says the same."""
        off = edge.T_a_b - predicted
        off_m, off_rad = math.hypot(off[0], off[1]), abs(se2.wrap(float(off[2])))
        numbers = self._numbers
        if off_m > numbers.agree_m or off_rad > numbers.agree_rad:
            agreeing = [one for one in self._pending if self._passages.agree(one, edge, self.poses)]
            self._pending.append(edge)
            if not agreeing:
                return
            self._pending = [one for one in self._pending[:-1] if one not in agreeing]
            for one in agreeing:
                self._edges[one.a, one.b] = one
        self._surprised |= off_m > numbers.apply_m or off_rad > numbers.apply_rad
        self._edges[edge.a, edge.b] = edge
        self._fresh += 1

    def _relax(self, relaxation: Relaxation) -> int:
        if not relaxation.done:
            relaxation.round()
            return self._cost(1024)
        weights = relaxation.weights[len(self._chain) :].tolist()
        self.weights = dict(zip(self._relaxed, weights, strict=True))
        self.poses = list(relaxation.poses)
        self._relaxation, self._surprised, self._fresh = None, False, 0
        self._weighed = self._new_graph = bool(self._relaxed)
        if self._too_many():
            self._merge()
        return 1

    def _too_many(self) -> bool:
        """Whether key frames are to be merged; in a torn map their corrections would be lost."""
        many = len(self.poses) > self._most and self._redrawing is None
        return many and self._new_map is not None and not self._torn_keys(0.0)

    def _merge(self) -> None:
        """Let older key frames stand for those that are tied near them."""
        graph, numbers = np.array(self.poses), self._numbers
        held = {pair for pair, weight in self.weights.items() if weight > 0.5}
        tied = {b for a, b in held & self._edges.keys() - self._links}
        written = np.array([key.written for key in self.keys[: len(graph)]])
        merge = Merge.of(graph, written, tied, self._searched, numbers)
        self._most = max(MOST_KEYS, round(len(merge.left) / LEFT))
        loose = spread(numbers.loop_m, numbers.loop_rad)
        links = [self._edges[pair] for pair in sorted(self._links & self._edges.keys())]
        links = merge.joined(links, graph, loose)
        self._chain = merge.joined(self._chain, graph, loose)
        stay = {pair: new for pair in self._edges if (new := merge.pair(pair))}
        found = [edge for pair, edge in self._edges.items() if pair not in self._links]
        self._edges = {(edge.a, edge.b): edge for edge in links + merge.those(found)}
        self._links, self._pending = {(e.a, e.b) for e in links}, merge.those(self._pending)
        self.weights = {stay[pair]: weight for pair, weight in self.weights.items() if pair in stay}
        rough = (merge.pair(pair) for pair in self._rough.values())
        self._rough = {pair[1]: pair for pair in rough if pair}
        self._tied_to = {k for old in self._tied_to if (k := merge.number(old)) is not None}
        self._ties = deque(k for old in self._ties if (k := merge.number(old)) is not None)
        self._later = deque(pair for old in self._later if (pair := merge.pair(old)))
        self._tied, self._again = merge.rows(self._tied), 0
        self._searched += len(merge.left) - len(self.poses)
        self.poses = merge.rows(self.poses)
        self.leave(merge)
        self.closures.restart(self.poses)

    def _follow(self) -> None:
        """Begin a new map if the graph denies places of the present one."""
        self._new_graph = False
        short = self.way_m < self._numbers.long_m
        if self._new_map is None or self._redrawing is not None or short:
            return
        torn = self._torn_keys(0.0)
        if not torn or not self._holds_present():
            return
        _log.info("loop closed: the map is torn at %d key frames and drawn anew", torn)
        if self._numbers.datum == "all":
            online = np.array([key.T_map_robot for key in self.keys[: len(self.poses)]])
            self.poses = list(least_moved(np.array(self.poses), online))
        self._redrawing = Redrawing(self._map_config, self._new_map, self.keys, self.poses)

    def _holds_present(self) -> bool:
        """Whether closures hold what was driven since the robot was last lost.

        Lost: at two key frames in a row. Else the graph knows of it what odometry said meanwhile,
        which is not to move the robot.
        """
        written = [key.written for key in self.keys]
        lost = [k for k in range(1, len(written)) if not (written[k - 1] or written[k])]
        if not lost:
            return True
        found = [pair for pair in self._edges if pair not in self._links]
        held = {b for a, b in found if a < lost[-1] < b and self.weights.get((a, b), 0.0) > 0.5}
        return len(held) >= self._numbers.denying

    def _torn_keys(self, new: float) -> int:
        """Key frames at which the graph denies the map; 0 where they are fewer than ``denying``.

        ``new``: weight of closures that came after the latest solution of the graph.
        """
        held = [pair for pair in self._edges if self.weights.get(pair, new) > 0.5]
        if len({b for a, b in held if (a, b) not in self._links}) < self._numbers.denying:
            return 0
        online = np.array([key.T_map_robot for key in self.keys[: len(self.poses)]])
        near, last = self._numbers.submap, max(b for _, b in held)
        near_by = [(k - near, k) for k in range(near, last)
                   if self._passages.way(k - near, k) <= self._numbers.after_m]  # fmt: skip
        torn = torn_keys(self._numbers, held + near_by, online, np.array(self.poses))
        return len(torn) if len(torn) >= self._numbers.denying else 0

    def _tie(self, j: int) -> Iterator[None]:
        """Tie a key frame to all passages along there."""
        first, at, found = self._tied[j] is None, self.poses[j], []
        for middle in self._passages.all_near(j, self.poses):
            predicted = se2.between(self.poses[middle], at)
            if edge := (yield from self.closures.tie(middle, j, predicted)):
                found.append((edge, predicted))
            yield
        self._tied[j] = at
        for edge, predicted in found:
            if self._rough.get(j) == (edge.a, j):
                del self._rough[j]
            self._take(edge, predicted)
            if first and j % self._numbers.every == 0:
                self._later.append((j + 2 * self._numbers.submap, edge.a))
            self._tied_to.add(j)
        # ties take the place of what was found there by a wide search
        near = range(j - self._numbers.every, j + self._numbers.every + 1)
        for k in near if self._tied_to.intersection(near) else ():
            self._edges.pop(self._rough.pop(k, (-1, -1)), None)

    def _look_again(self) -> int:
        """Tie a key frame anew that the graph has moved since; the cost, 0 if there is none."""
        if not self._edges:
            return 0
        if self._later and self._later[0][0] < len(self.poses):
            # what they saw before can now be tied to the passage that came later
            _, middle = self._later.popleft()
            self._ties.extend(range(middle - 1, middle + self._numbers.every - 1))
            return 1
        tied = np.array([NEVER if one is None else one for one in self._tied])
        off = np.roll(np.array(self.poses) - tied, -self._again - 1, axis=0)
        moved = np.flatnonzero(np.hypot(off[:, 0], off[:, 1]) > self._numbers.agree_m)
        if not len(moved):
            return 0
        self._again = (self._again + 1 + int(moved[0])) % len(self.poses)
        self._ties.append(self._again)
        return 1

# SPDX-License-Identifier: Apache-2.0
"""Loops of long runs: key frames, little maps round them, and a pose graph over all.

The online map is left as it is. What comes out is the corrected trajectory, made when it is asked
for. Each key frame is matched to the few before it: matched to the whole map, as it was online, a
step would hide the drift that a loop is to correct. Then it is matched to the little map of the
nearest earlier stretch of the way; and when all are in place, to those of every other passage.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slam import se2
from slam.frames import Float
from slam.frontend.observations import Observations
from slam.frontend.odometry_prior import inverted
from slam.posegraph import Edge, carried, optimise
from slam.tracker.cell_map import CellMap
from slam.tracker.config import TrackerConfig
from slam.tracker.matching.global_search import coarse_field, places
from slam.tracker.matching.matcher import Match, Matcher
from slam.tracker.rasterise import rasterise
from slam.tracker.tracking.relocalise import coarse, spread, support

_log = logging.getLogger(__name__)


@dataclass(frozen=True, kw_only=True, eq=False)
class KeyFrame:
    """One frame that is kept.

    frame         its index among all frames
    T_map_robot   (3,) online
    step          (3,) motion since the previous key frame online, (3, 3) covariance in that frame
    way_m         driven up to here
    """

    frame: int
    T_map_robot: Float
    observations: Observations
    step: Float
    covariance: Float
    way_m: float


class Loops:
    """Collects key frames, closes loops between them when asked."""

    def __init__(
        self, config: TrackerConfig, matcher: Matcher, new_map: Callable[[], CellMap]
    ) -> None:
        """``new_map`` makes an empty map for what a few key frames saw."""
        self._new_map = new_map
        self._numbers = config.loops
        self._slack = spread(config.loops.slack_m, config.loops.slack_rad)
        self._coarse = coarse(config.tracking.relocalise)
        self._matcher = matcher
        self.keys: list[KeyFrame] = []
        self.edges: list[Edge] = []  # loops found so far
        self._tried = 0  # key frames that were looked at
        self._poses: list[Float] = []  # corrected, of the key frames tried
        self._chain: list[Edge] = []  # step by step, without loops; and where it leads
        self._chained: list[Float] = []
        self._submaps: dict[int, CellMap] = {}
        self._fields: dict[int, NDArray[np.uint8]] = {}  # of those that were searched
        self._step: Float = np.zeros(3)
        self._covariance: Float = np.zeros((3, 3))
        self._way_m = 0.0

    def add(
        self, frame: int, T_map_robot: Float, motion: Float, covariance: Float, seen: Observations
    ) -> None:
        """Take a frame: its ``motion`` (3,) since the one before, ``covariance`` in that frame."""
        self._covariance = se2.propagate(self._covariance, self._step, motion, covariance)
        self._step = se2.compose(self._step, motion)
        self._way_m += math.hypot(float(motion[0]), float(motion[1]))
        moved = math.hypot(float(self._step[0]), float(self._step[1]))
        if (
            self.keys
            and moved < self._numbers.key_m
            and abs(float(self._step[2])) < self._numbers.key_rad
        ):
            return
        self.keys.append(
            KeyFrame(
                frame=frame,
                T_map_robot=T_map_robot,
                observations=seen,
                step=self._step,
                covariance=self._covariance + self._slack,
                way_m=self._way_m,
            )
        )
        self._step, self._covariance = np.zeros(3), np.zeros((3, 3))

    def corrected(self, poses: Float) -> Float:
        """All (n, 3) online poses, moved with the graph; the same where no loop was found."""
        if self._way_m < self._numbers.long_m or len(self.keys) < 3:
            return poses
        if self._tried < len(self.keys):
            _log.info("closing loops over %d key frames", len(self.keys))
            while self._tried < len(self.keys):
                self._look(self._tried)
                self._tried += 1
            self._look_again()
        if not self.edges:
            return poses
        keys = np.array([key.T_map_robot for key in self.keys])
        frames = np.array([key.frame for key in self.keys])
        at = np.interp(np.arange(len(poses)), frames, np.arange(len(frames)))
        return carried(keys, np.array(self._poses), at, poses)

    def _optimise(self) -> None:
        self._poses = list(optimise(np.array(self._poses), self._chain + self.edges)[0])

    def _look(self, j: int) -> None:
        """Chain key frame ``j`` to those before, and close a loop if it is on one."""
        if j == 0:
            self._poses.append(self.keys[0].T_map_robot)
            self._chained.append(self.keys[0].T_map_robot)
            return
        step = self._stepped(j)
        self._chain.append(step)
        self._chained.append(se2.compose(self._chained[-1], step.T_a_b))
        self._poses.append(se2.compose(self._poses[-1], step.T_a_b))
        middle = self._nearest(j)
        if middle is None:
            return
        predicted = se2.between(self._poses[middle], self._poses[j])
        edge = self._loop(middle, j, predicted, self._gate(j, middle))
        if edge is None:
            return
        self.edges.append(edge)
        off = edge.T_a_b - predicted
        if (
            math.hypot(off[0], off[1]) > self._numbers.loop_m
            or abs(se2.wrap(float(off[2]))) > self._numbers.loop_rad
        ):
            self._optimise()

    def _stepped(self, j: int) -> Edge:
        """The step to key frame ``j``, matched to the few before it; as online where it is poor."""
        key = self.keys[j]
        step, covariance = key.step, key.covariance
        cell_map = self._map_of(range(max(0, j - self._numbers.recent), j), j - 1)
        start = self._matcher.approach(cell_map, key.observations, step, covariance)
        precision = inverted(covariance)
        match = self._matcher.climb(cell_map, key.observations, start, step, precision)
        if match.matched >= self._numbers.good_step:
            step = match.T_map_robot
            information = self._numbers.information_share * match.tau * match.information
            covariance = inverted(information + precision)
        covariance = covariance + spread(self._numbers.chain_m, self._numbers.chain_rad)
        return Edge(a=j - 1, b=j, T_a_b=step, information=inverted(covariance))

    def _look_again(self) -> None:
        """With every pose near its place, tie each key frame to all passages along there."""
        if not self.edges:
            return
        self._optimise()
        poses = np.array(self._poses)
        ways = np.array([key.way_m for key in self.keys])
        edges = []
        for j in range(len(self.keys)):
            for middle in self._passages(j, poses, ways):
                edge = self._tie(middle, j, se2.between(poses[middle], poses[j]))
                if edge is not None:
                    edges.append(edge)
        self.edges = edges or self.edges
        self._optimise()

    def _passages(self, j: int, poses: Float, ways: Float) -> list[int]:
        """Middles near key frame ``j``, one of each time the robot came along there."""
        middles = np.arange(
            self._numbers.submap, len(poses) - self._numbers.submap, self._numbers.every
        )
        middles = middles[np.abs(ways[middles] - ways[j]) > self._numbers.after_m]
        apart = poses[middles, :2] - poses[j, :2]
        squares = (apart * apart).sum(axis=1)
        found: list[int] = []
        for k in np.argsort(squares, kind="stable"):
            if squares[k] > self._numbers.again_m**2 or len(found) == self._numbers.passages:
                break
            middle = int(middles[k])
            if all(abs(ways[middle] - ways[other]) > self._numbers.after_m for other in found):
                found.append(middle)
        return found

    def _tie(self, middle: int, j: int, predicted: Float) -> Edge | None:
        """Key frame ``j`` matched to the map about ``middle``, near where it is predicted."""
        cell_map, seen = self._submap(middle), self.keys[j].observations
        start = self._matcher.approach(cell_map, seen, predicted, self._coarse)
        match = self._matcher.climb(cell_map, seen, start, predicted, inverted(self._coarse))
        return self._edge(middle, j, match, support(cell_map, seen, match))

    def _gate(self, j: int, middle: int) -> float:
        way = self.keys[j].way_m - self.keys[middle].way_m
        return min(self._numbers.gate_m + self._numbers.gate_share * way, self._numbers.widest_m)

    def _nearest(self, j: int) -> int | None:
        """Middle of the little map nearest to where key frame ``j`` should be."""
        best, nearest = None, math.inf
        for middle in range(self._numbers.submap, j - self._numbers.submap, self._numbers.every):
            if (
                self.keys[j].way_m - self.keys[middle + self._numbers.submap].way_m
                < self._numbers.after_m
            ):
                break
            d = self._poses[middle] - self._poses[j]
            distance = math.hypot(float(d[0]), float(d[1])) - self._gate(j, middle)
            if distance < min(nearest, self._numbers.near_m):
                best, nearest = middle, distance
        return best

    def _loop(self, middle: int, j: int, predicted: Float, gate: float) -> Edge | None:
        """Key frame ``j`` matched to the map about ``middle``, in its frame."""
        cell_map, seen = self._submap(middle), self.keys[j].observations
        short_term = self._matcher.reward.short_term
        found: list[tuple[float, Match]] = []
        about = (predicted, gate, self._numbers.gate_rad)
        if middle not in self._fields:
            self._fields[middle] = coarse_field(cell_map, short_term)
        field = self._fields[middle]
        for place in places(
            cell_map, short_term, seen.points_robot, self._numbers.most, about, field
        ):
            start = self._matcher.approach(cell_map, seen, place, self._coarse)
            match = self._matcher.climb(cell_map, seen, start, place, inverted(self._coarse))
            found.append((support(cell_map, seen, match), match))
        if not found:
            return None
        found.sort(key=lambda one: -one[0])
        (best, match), others = found[0], found[1:]
        alike = any(other > self._numbers.alias * best for other, _ in others)
        return None if alike else self._edge(middle, j, match, best)

    def _edge(self, middle: int, j: int, match: Match, backing: float) -> Edge | None:
        if backing < self._numbers.good_support or match.matched < self._numbers.good_match:
            return None
        information = self._numbers.information_share * match.tau * match.information
        covariance = inverted(information + self._numbers.loose * np.eye(3))
        covariance = covariance + spread(self._numbers.loop_m, self._numbers.loop_rad)
        T_a_b = match.T_map_robot
        return Edge(a=middle, b=j, T_a_b=T_a_b, information=inverted(covariance), robust=True)

    def _submap(self, middle: int) -> CellMap:
        """What the key frames about ``middle`` saw, in the frame of that one."""
        if middle not in self._submaps:
            about = range(middle - self._numbers.submap, middle + self._numbers.submap + 1)
            self._submaps[middle] = self._map_of(about, middle)
        return self._submaps[middle]

    def _map_of(self, members: range, origin: int) -> CellMap:
        """What some key frames saw, in the frame of one, as the chain puts them."""
        cell_map = self._new_map()
        for k in members:
            key, pose = self.keys[k], se2.between(self._chained[origin], self._chained[k])
            rasterise(cell_map, key.observations, pose)
            T_map_laser = se2.compose(pose, key.observations.T_robot_laser)
            cell_map.integrate(key.observations.view, T_map_laser, self._numbers.look_s, write=True)
        return cell_map

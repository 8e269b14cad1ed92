# SPDX-License-Identifier: Apache-2.0
"""Loops of long runs: key frames, little networks round them, and a pose graph over all.

The online map is left as it is. What comes out is the corrected trajectory, made when it is asked
for: each key frame is matched to the little network of the nearest earlier stretch of the way.
"""

from __future__ import annotations

import logging
import math
from dataclasses import dataclass

import numpy as np

from slam import se2
from slam.frames import Float
from slam.posegraph import Edge, carried, optimise
from slam.shunting.config import ShuntingConfig
from slam.shunting.everywhere import places
from slam.shunting.impressions import Observations, stamp
from slam.shunting.matching import Match, Matcher
from slam.shunting.motion import inverted
from slam.shunting.network import Network
from slam.shunting.recovery import COARSE, support

_log = logging.getLogger(__name__)
KEY_M, KEY_RAD = 1.0, 0.6  # between key frames
LONG_M = 100.0  # way from which on loops are looked for
AFTER_M = 15.0  # way between the ends of a loop
GATE_M, GATE_SHARE, WIDEST_M = 1.5, 0.02, 6.0  # how far off a loop may be, + share of the way,
GATE_RAD = 0.5  # and how far turned
MOST = 4  # places looked at for one loop
SUBMAP, EVERY = 4, 4  # key frames on either side of a little network's middle; between two middles
LOOK_S = 1.0
GOOD_MATCH, GOOD_SUPPORT, ALIAS = 0.6, 0.5, 0.9
CHAIN_M, CHAIN_RAD = 0.01, 0.0015  # standard deviation of a step from key frame to key frame, and
LOOP_M, LOOP_RAD = 0.03, 0.003  # of a loop, beside what their matches say
INFORMATION_SHARE = 0.3


@dataclass(frozen=True, kw_only=True, eq=False)
class KeyFrame:
    """One frame that is kept.

    frame         its index among all frames
    T_map_robot   (3,) online
    step          (3,) motion since the previous key frame, and its (3, 3) covariance in that frame
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

    def __init__(self, config: ShuntingConfig, matcher: Matcher) -> None:
        self._config = config
        self._matcher = matcher
        self.keys: list[KeyFrame] = []
        self.edges: list[Edge] = []  # loops found so far
        self._tried = 0  # key frames that were looked at
        self._poses: list[Float] = []  # corrected, of the key frames tried
        self._submaps: dict[int, Network] = {}
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
        if self.keys and moved < KEY_M and abs(float(self._step[2])) < KEY_RAD:
            return
        floor = np.diag([CHAIN_M**2, CHAIN_M**2, CHAIN_RAD**2])
        self.keys.append(
            KeyFrame(
                frame=frame,
                T_map_robot=T_map_robot,
                observations=seen,
                step=self._step,
                covariance=self._covariance + floor,
                way_m=self._way_m,
            )
        )
        self._step, self._covariance = np.zeros(3), np.zeros((3, 3))

    def corrected(self, poses: Float) -> Float:
        """All (n, 3) online poses, moved with the graph; the same where no loop was found."""
        if self._way_m < LONG_M or len(self.keys) < 3:
            return poses
        if self._tried < len(self.keys):
            _log.info("closing loops over %d key frames", len(self.keys))
        while self._tried < len(self.keys):
            self._look(self._tried)
            self._tried += 1
        if not self.edges:
            return poses
        keys = np.array([key.T_map_robot for key in self.keys])
        frames = np.array([key.frame for key in self.keys])
        at = np.interp(np.arange(len(poses)), frames, np.arange(len(frames)))
        return carried(keys, self._optimised(), at, poses)

    def _optimised(self) -> Float:
        start = np.array(self._poses)
        chain = [
            Edge(a=k - 1, b=k, T_a_b=key.step, information=inverted(key.covariance))
            for k, key in enumerate(self.keys[: len(start)])
            if k > 0
        ]
        return optimise(start, chain + self.edges)[0]

    def _look(self, j: int) -> None:
        """Chain key frame ``j`` to those before, and close a loop if it is on one."""
        key = self.keys[j]
        if j == 0:
            self._poses.append(key.T_map_robot)
            return
        self._poses.append(se2.compose(self._poses[-1], key.step))
        middle = self._nearest(j)
        if middle is None:
            return
        predicted = se2.between(self._poses[middle], self._poses[j])
        gate = self._gate(j, middle)
        edge = self._loop(middle, j, predicted, gate)
        if edge is None:
            return
        self.edges.append(edge)
        off = edge.T_a_b - predicted
        if math.hypot(off[0], off[1]) > LOOP_M or abs(se2.wrap(float(off[2]))) > LOOP_RAD:
            self._poses = list(self._optimised())

    def _gate(self, j: int, middle: int) -> float:
        way = self.keys[j].way_m - self.keys[middle].way_m
        return min(GATE_M + GATE_SHARE * way, WIDEST_M)

    def _nearest(self, j: int) -> int | None:
        """Middle of the little network nearest to where key frame ``j`` should be."""
        best, nearest = None, math.inf
        for middle in range(SUBMAP, j - SUBMAP, EVERY):
            if self.keys[j].way_m - self.keys[middle + SUBMAP].way_m < AFTER_M:
                break
            d = self._poses[middle] - self._poses[j]
            distance = math.hypot(float(d[0]), float(d[1])) - self._gate(j, middle)
            if distance < min(nearest, 1.0):
                best, nearest = middle, distance
        return best

    def _loop(self, middle: int, j: int, predicted: Float, gate: float) -> Edge | None:
        """Key frame ``j`` matched to the network about ``middle``, in its frame."""
        network, seen = self._submap(middle), self.keys[j].observations
        short_term = self._matcher.reward.short_term
        found: list[tuple[float, Match]] = []
        about = (predicted, gate, GATE_RAD)
        for place in places(network, short_term, seen.points_robot, MOST, about):
            start = self._matcher.approach(network, seen, place, COARSE)
            match = self._matcher.climb(network, seen, start, place, inverted(COARSE))
            found.append((support(network, seen, match), match))
        if not found:
            return None
        found.sort(key=lambda one: -one[0])
        (best, match), others = found[0], found[1:]
        alike = any(other > ALIAS * best for other, _ in others)
        if alike or best < GOOD_SUPPORT or match.matched < GOOD_MATCH:
            return None
        information = INFORMATION_SHARE * match.tau * match.information
        covariance = inverted(information + np.diag([1.0, 1.0, 1.0]))
        covariance = covariance + np.diag([LOOP_M**2, LOOP_M**2, LOOP_RAD**2])
        T_a_b = match.T_map_robot
        return Edge(a=middle, b=j, T_a_b=T_a_b, information=inverted(covariance), robust=True)

    def _submap(self, middle: int) -> Network:
        """What the key frames about ``middle`` saw, in the frame of that one."""
        if middle not in self._submaps:
            network = Network(self._config)
            for key in self.keys[middle - SUBMAP : middle + SUBMAP + 1]:
                pose = se2.between(self.keys[middle].T_map_robot, key.T_map_robot)
                stamp(network, key.observations, pose)
                T_map_laser = se2.compose(pose, key.observations.T_robot_laser)
                network.integrate(key.observations.view, T_map_laser, LOOK_S, write=True)
            self._submaps[middle] = network
        return self._submaps[middle]

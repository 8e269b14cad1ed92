# SPDX-License-Identifier: Apache-2.0
"""Earlier parts of the way near a key frame: where a loop may close.

A part is known by the key frame in its middle, one in ``LoopsConfig.every``: a little map is drawn
about it. Where the key frames lie, the pose graph says: ``poses``, (3,) each, of those in it.
"""

import math
from collections.abc import Sequence

import numpy as np

from slam import se2
from slam.arrays import Float
from slam.posegraph import Edge
from slam.tracker.tracking.config import LoopsConfig
from slam.tracker.tracking.keys import KeyFrame


class Passages:
    """Finds them; ``keys`` are all key frames, which grow in number."""

    def __init__(self, config: LoopsConfig, keys: list[KeyFrame]) -> None:
        self._numbers, self._keys = config, keys

    def way(self, a: int, b: int) -> float:
        """What was driven between two key frames, m."""
        return abs(self._keys[a].way_m - self._keys[b].way_m)

    def gate(self, j: int, middle: int) -> float:
        """How far key frame ``j`` may have drifted since the one in the middle, m."""
        way = self._keys[j].way_m - self._keys[middle].way_m
        return min(self._numbers.gate_m + self._numbers.gate_share * way, self._numbers.widest_m)

    def all_near(self, j: int, poses: Sequence[Float]) -> list[int]:
        """Middles near key frame ``j``, one of each time the robot came along there."""
        at = np.array(poses)
        ways = np.array([key.way_m for key in self._keys[: len(at)]])
        numbers = self._numbers
        middles = np.arange(numbers.submap, len(at) - numbers.submap, numbers.every)
        middles = middles[np.abs(ways[middles] - ways[j]) > numbers.after_m]
        apart = at[middles, :2] - at[j, :2]
        squares = (apart * apart).sum(axis=1)
        found: list[int] = []
        for k in np.argsort(squares, kind="stable"):
            if squares[k] > numbers.again_m**2 or len(found) == numbers.passages:
                break
            middle = int(middles[k])
            if all(abs(ways[middle] - ways[other]) > numbers.after_m for other in found):
                found.append(middle)
        return found

    def nearest_before(self, j: int, poses: Sequence[Float]) -> int | None:
        """Middle of the little map nearest to where key frame ``j`` should be."""
        best, nearest, numbers = None, math.inf, self._numbers
        for middle in range(numbers.submap, j - numbers.submap, numbers.every):
            if self._keys[j].way_m - self._keys[middle + numbers.submap].way_m < numbers.after_m:
                break
            d = poses[middle] - poses[j]
            distance = math.hypot(float(d[0]), float(d[1])) - self.gate(j, middle)
            if distance < min(nearest, numbers.near_m):
                best, nearest = middle, distance
        return best

    def agree(self, one: Edge, other: Edge, poses: Sequence[Float]) -> bool:
        """Whether two closures put the robot at the same place."""
        if one.b == other.b or self.way(one.b, other.b) > self._numbers.after_m:
            return False
        by_one = se2.compose(poses[one.a], one.T_a_b)
        by_one = se2.compose(by_one, se2.between(poses[one.b], poses[other.b]))
        off = se2.between(by_one, se2.compose(poses[other.a], other.T_a_b))
        near = math.hypot(float(off[0]), float(off[1])) < self._numbers.agree_m
        return near and abs(float(off[2])) < self._numbers.agree_rad

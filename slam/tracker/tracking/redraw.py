# SPDX-License-Identifier: Apache-2.0
"""The map drawn anew from key frames, a few each scan, while tracking goes on in the old one."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from slam import se2
from slam.arrays import Float
from slam.posegraph import relative
from slam.tracker.cell_map import CellMap
from slam.tracker.map_config import MapConfig
from slam.tracker.tracking.closures import DRAWN, draw
from slam.tracker.tracking.config import LoopsConfig
from slam.tracker.tracking.keys import KeyFrame

FAR_M2 = 20.0  # of the range, mean square of what is seen: one unit more; museum, Intel, measured


@dataclass(frozen=True, kw_only=True, eq=False)
class Correction:
    """The map moved, and the robot with it.

    T_new_old  (3,) takes the robot's pose, and all about it, from the old map to the new one
    cell_map   the new one
    poses      (n, 3) of all frames so far, in the new one
    """

    T_new_old: Float
    cell_map: CellMap
    poses: Float


class Redrawing:
    """Draws key frames where a pose graph has put them, those that came since along with them.

    poses  (3,) each, of the key frames known when it began
    """

    def __init__(
        self,
        config: MapConfig,
        new_map: Callable[[], CellMap],
        keys: list[KeyFrame],
        poses: list[Float],
    ) -> None:
        self._config, self._keys = config, keys
        self.cell_map = new_map()
        self._poses, self._last = list(poses), len(poses) - 1
        self._drawn = 0

    @property
    def done(self) -> bool:
        """Whether all key frames are in the map."""
        return self._drawn == len(self._keys)

    @property
    def outrun(self) -> bool:
        """Whether a lost robot was found since: how the way goes on is for a new graph to say."""
        return any(key.found for key in self._keys[self._last + 1 :])

    def pose(self, k: int) -> Float:
        """(3,) of key frame ``k`` in the new map."""
        while len(self._poses) <= k:
            last = self._last
            step = se2.between(
                self._keys[last].T_map_robot, self._keys[len(self._poses)].T_map_robot
            )
            self._poses.append(se2.compose(self._poses[last], step))
        return self._poses[k]

    def draw(self) -> int:
        """One more key frame, for as long as it was the newest; the cost, more where it saw far."""
        k = self._drawn
        key, pose = self._keys[k], self.pose(k)
        self._drawn += 1
        if not key.written:
            return DRAWN
        following = self._keys[k + 1].start_s if k + 1 < len(self._keys) else key.start_s
        look = min(
            max(following - key.start_s, self._config.resumed_look_s), self._config.longest_look_s
        )
        draw(self.cell_map, key, pose, max(look, self._config.first_look_s if k == 0 else 0.0))
        points = key.observations.points_robot
        return DRAWN + int((points * points).sum() / max(len(points), 1) / FAR_M2)


def torn_keys(
    config: LoopsConfig, pairs: list[tuple[int, int]], online: Float, graph: Float
) -> set[int]:
    """The second of each pair of key frames that lies otherwise in the map than in the graph."""
    a, b = np.array(pairs).T
    off = relative(online[a], online[b]) - relative(graph[a], graph[b])
    far = off[:, 0] ** 2 + off[:, 1] ** 2 > config.apply_m**2
    turned = np.abs(se2.wrap_array(off[:, 2])) > config.apply_rad
    return set(b[far | turned].tolist())

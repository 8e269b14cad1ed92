# SPDX-License-Identifier: Apache-2.0
"""The scanner's systematic error in a SLAM: ranges without it, and a map drawn anew without it.

What was drawn before the error was known shows walls where it put them. While the path is short,
the map is therefore drawn anew from its key frames whenever the learnt error has changed: each is
matched to what is drawn already, beginning with the first, which stays where it is. A few key
frames are drawn with each scan, while tracking goes on in the old map.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from slam import se2
from slam.frames import Float, Frame
from slam.frontend.observations import Observations
from slam.frontend.odometry_prior import inverted
from slam.frontend.range_error import (
    DRIFT_M,
    DRIFT_RAD,
    REDRAW_BY_M,
    REDRAW_M,
    REDRAWN_KEYS,
    RangeCorrection,
    RangeError,
)
from slam.posegraph import carried
from slam.tracker.cell_map import CellMap
from slam.tracker.config import TrackerConfig
from slam.tracker.matching.matcher import Matcher
from slam.tracker.tracking.closures import draw
from slam.tracker.tracking.keys import KeyFrame
from slam.tracker.tracking.loops import Loops
from slam.tracker.tracking.redraw import Correction


def less(seen: Observations, error: RangeError, taken: Float, wanted: Float) -> Observations:
    """The same returns with coefficients ``wanted`` taken off instead of ``taken``."""
    laser = seen.T_robot_laser[:2]
    beams = seen.points_robot - laser
    ranges = np.sqrt((beams * beams).sum(axis=1))
    closer = error.at(ranges, wanted) - error.at(ranges, taken)
    shares = np.maximum(1.0 - closer / np.maximum(ranges, 1e-6), 0.0)
    return replace(seen, points_robot=laser + beams * shares[:, None])


class LearntRanges(RangeCorrection):
    """What a tracker with ``range_error.learn`` on does before and after each frame."""

    def __init__(
        self, config: TrackerConfig, matcher: Matcher, new_map: Callable[[], CellMap]
    ) -> None:
        super().__init__(config.frontend.sensor_sigma_m)
        self._map_config, self._matcher, self._new_map = config.map, matcher, new_map
        self._taken: list[Float] = []  # coefficients taken off each key frame
        self._drawn = self._used = self.applied  # by the present map; by the newest frame
        self._new: _NewMap | None = None
        self._precision = inverted(np.diag([DRIFT_M**2, DRIFT_M**2, DRIFT_RAD**2]))

    def seen(self, frame: Frame) -> Frame:
        """The frame with the error taken off its ranges; itself while there is none."""
        self._used = self.applied
        return super().seen(frame)

    def correction(self, loops: Loops, poses: Callable[[], Float]) -> Correction | None:
        """The map drawn anew, if it is ready; else a few key frames more are drawn."""
        keys = loops.keys
        self._taken += [self._used] * (len(keys) - len(self._taken))
        if loops.poses or loops.way_m > REDRAW_M:  # its loops hold the map together
            self._new = None
            return None
        if self._new is None:
            if self.error.differ_m(self.applied, self._drawn) >= REDRAW_BY_M:
                self._drawn = self.applied
                self._new = _NewMap(self._new_map(), [], [])
            return None
        for _ in range(REDRAWN_KEYS):
            if len(self._new.poses) == len(keys):
                new, self._new = self._new, None
                return _moved(new, keys, poses())
            self._draw(self._new, keys)
        return None

    def _draw(self, new: _NewMap, keys: list[KeyFrame]) -> None:
        """Match the next key frame to the new map, and draw it there."""
        k = len(new.poses)
        key = keys[k]
        changed = less(key.observations, self.error, self._taken[k], self._drawn)
        keys[k] = replace(key, observations=changed)
        self._taken[k] = self._drawn
        pose = key.T_map_robot
        if k > 0:
            pose = se2.compose(new.poses[-1], se2.between(new.before[-1], pose))
            everyone = replace(changed, votes=None)
            pose = self._matcher.climb(
                new.cell_map, everyone, pose, pose, self._precision
            ).T_map_robot
        following = keys[k + 1].start_s if k + 1 < len(keys) else key.start_s
        limits = self._map_config
        look = min(max(following - key.start_s, limits.resumed_look_s), limits.longest_look_s)
        if key.written:
            draw(new.cell_map, keys[k], pose, max(look, limits.first_look_s if k == 0 else 0.0))
        new.before.append(key.T_map_robot)
        new.poses.append(pose)


class _NewMap(NamedTuple):
    """A map that is drawn, and the (3,) poses of the key frames in the old one and in it."""

    cell_map: CellMap
    before: list[Float]
    poses: list[Float]


def _moved(new: _NewMap, keys: list[KeyFrame], poses: Float) -> Correction:
    """Key frames and all (n, 3) ``poses`` moved into the new map."""
    before, after = np.array(new.before), np.array(new.poses)
    frames = np.array([key.frame for key in keys])
    at = np.interp(np.arange(len(poses)), frames, np.arange(len(frames)))
    for k, key in enumerate(keys):
        keys[k] = replace(key, T_map_robot=after[k])
    T_new_old = se2.compose(after[-1], se2.inverse(before[-1]))
    moved = carried(before, after, at, poses)
    return Correction(T_new_old=T_new_old, cell_map=new.cell_map, poses=moved)

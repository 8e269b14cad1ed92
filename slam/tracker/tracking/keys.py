# SPDX-License-Identifier: Apache-2.0
"""Key frames of long runs: one each metre or half a radian, with the motion between them."""

import math
from dataclasses import dataclass, replace

import numpy as np

from slam import se2
from slam.arrays import Float
from slam.frontend.motions import extended
from slam.frontend.observations import Observations
from slam.tracker.belief.places import spread
from slam.tracker.tracking.config import LoopsConfig
from slam.tracker.tracking.merging import Merge


@dataclass(frozen=True, kw_only=True, eq=False)
class KeyFrame:
    """One frame that is kept.

    frame         its index among all frames
    T_map_robot   (3,) online; moved with each correction of the map
    step          (3,) motion since the previous key frame online, (3, 3) covariance in that frame
    way_m         driven up to here
    start_s       s since the first frame
    written       whether the map took it in
    found         whether a lost robot was found in the map since the key frame before
    """

    frame: int
    T_map_robot: Float
    observations: Observations
    step: Float
    covariance: Float
    way_m: float
    start_s: float
    written: bool
    found: bool = False


class KeyFrames:
    """Collects key frames from the motions between frames.

    slack     (3, 3) that is added to each step's covariance
    n_frames  frames so far
    """

    def __init__(self, config: LoopsConfig) -> None:
        self._config = config
        self.slack = spread(config.slack_m, config.slack_rad)
        self.keys: list[KeyFrame] = []
        self.n_frames = 0
        self.way_m, self.elapsed_s = 0.0, 0.0
        self._step: Float = np.zeros(3)
        self._covariance: Float = np.zeros((3, 3))
        self._found = False
        self._squares: list[float] = []  # m^2, of the range, mean of each key frame
        self._frames: list[int] = []  # of all key frames there ever were
        self._stand: list[int] = []  # which of the key frames stands for each of them

    def add(  # noqa: PLR0913 (the facts of one frame)
        self,
        T_map_robot: Float,
        motion: Float,
        covariance: Float,
        seen: Observations,
        *,
        elapsed: float = 0.0,
        written: bool = True,
        found: bool = False,
    ) -> None:
        """Take a frame: its ``motion`` (3,) since the one before, ``covariance`` in that frame.

        ``elapsed`` s after the one before; ``written``: the map took it in; ``found``: the robot
        was lost before it, and found in the map.
        """
        self._found |= found
        extended(self._step, self._covariance, motion, covariance)
        self.way_m += math.hypot(float(motion[0]), float(motion[1]))
        self.elapsed_s += elapsed
        moved = math.hypot(float(self._step[0]), float(self._step[1]))
        near = moved < self._config.key_m and abs(float(self._step[2])) < self._config.key_rad
        frame, self.n_frames = self.n_frames, self.n_frames + 1
        if self.keys and near:
            return
        self._frames.append(frame)
        self._stand.append(len(self.keys))
        self.keys.append(
            KeyFrame(
                frame=frame,
                T_map_robot=T_map_robot,
                observations=seen.weighted(None),
                step=self._step,
                covariance=self._covariance + self.slack,
                way_m=self.way_m,
                start_s=self.elapsed_s,
                written=written,
                found=self._found,
            )
        )
        points = seen.points_robot
        self._squares.append(float((points * points).sum(axis=1).mean()) if len(points) else 0.0)
        self._step, self._covariance = np.zeros(3), np.zeros((3, 3))
        self._found = False

    def leave(self, merge: Merge) -> None:
        """Only the key frames that are left; a step is from the one before among them."""
        keys = merge.rows(self.keys)
        for at, before, k in zip(range(1, len(keys)), merge.left, merge.left[1:], strict=False):
            if k == before + 1:
                continue
            step, covariance, gone = np.zeros(3), np.zeros((3, 3)), self.keys[before + 1 : k + 1]
            for key in gone:
                own = key.covariance - self.slack
                covariance = se2.propagate(covariance, step, key.step, own)
                step = se2.compose(step, key.step)
            found, covariance = any(key.found for key in gone), covariance + self.slack
            keys[at] = replace(keys[at], step=step, covariance=covariance, found=found)
        into = [*merge.into.tolist(), *range(len(merge.left), len(keys))]
        self._stand = [into[k] for k in self._stand]
        self._squares = merge.rows(self._squares)
        self.keys[:] = keys

    def anywhere(self, T_map_robot: Float) -> Float:
        """(3, 3) second moment about a pose if the robot is anywhere that it has seen.

        That is in a disc about each key frame, of the root mean square range there. Of a loaded
        map, what was seen since counts.
        """
        off = np.array([key.T_map_robot[:2] for key in self.keys]) - T_map_robot[:2]
        x, y = off[:, 0], off[:, 1]
        disc = 0.25 * sum(self._squares) / len(self._squares)  # m^2 along each axis
        xx, xy, yy = float((x * x).mean()), float((x * y).mean()), float((y * y).mean())
        return np.array([[xx + disc, xy, 0.0], [xy, yy + disc, 0.0], [0.0, 0.0, math.pi**2 / 3.0]])

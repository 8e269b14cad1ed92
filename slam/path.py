# SPDX-License-Identifier: Apache-2.0
"""The path of a SLAM so far: stamps and poses of its frames, which come in order."""

from array import array

import numpy as np

from slam import se2
from slam.errors import InvalidValueError
from slam.estimate import Raster
from slam.frames import Float
from slam.trajectory import Trajectory


class PosePath:
    """Stamps (ns) and poses ``T_map_robot`` (m, m, rad) of the frames so far.

    T_map_odom  (3,) all corrections of the map so far
    moved_by    (3,) by how much the latest pose was moved since the frame before
    """

    def __init__(self) -> None:
        self._stamps = array("q")
        self._poses = array("d")  # three numbers each
        self.T_map_odom, self.moved_by = np.zeros(3), np.zeros(3)

    def __len__(self) -> int:
        return len(self._stamps)

    def check_order(self, stamp_ns: int) -> None:
        """Raise ``InvalidValueError`` unless a frame at ``stamp_ns`` comes after the last one."""
        if self._stamps and stamp_ns <= self._stamps[-1]:
            raise InvalidValueError(
                f"frames must come in order: {stamp_ns} ns after {self._stamps[-1]} ns"
            )

    def add(self, stamp_ns: int, T_map_robot: Float) -> None:
        """The pose of one more frame."""
        self._stamps.append(stamp_ns)
        self._poses.extend(T_map_robot.tolist())

    def correct(self, poses: Float, T_new_old: Float, T_map_robot: Float) -> Float:
        """The map moved: the frames so far were at these (n, 3); the latest pose in it."""
        self._poses = array("d", poses.ravel())
        self.T_map_odom = se2.compose(T_new_old, self.T_map_odom)
        moved = se2.compose(T_new_old, T_map_robot)
        self.moved_by = moved - T_map_robot
        self.moved_by[2] = se2.wrap(float(self.moved_by[2]))
        return moved

    def poses(self) -> Float:
        """(n, 3) m, m, rad, as motion led."""
        return np.array(self._poses).reshape(-1, 3)

    def trajectory(self, poses: Float | None = None) -> Trajectory:
        """The poses as they were reported, or others (n, 3) for the same stamps."""
        return Trajectory(
            stamps_ns=np.array(self._stamps, dtype=np.int64),
            poses=self.poses() if poses is None else poses,
        )


class OnPath:
    """A SLAM without a map that keeps its online poses in ``_path``, which its ``reset`` makes."""

    _path: PosePath

    def map(self) -> Raster | None:
        """None: there is none, or it is the SLAM's own affair."""
        return None

    def trajectory(self) -> Trajectory:
        """The online poses."""
        return self._path.trajectory()

# SPDX-License-Identifier: Apache-2.0
"""A SLAM that knows of one scanner, on a robot with several: it gets the scans of the first."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from slam import se2
from slam.estimate import Estimate, Raster
from slam.frames import Float, Frame, Odometry
from slam.interface import SlamSystem
from slam.oracle import OPTIONAL, Oracle
from slam.trajectory import Trajectory


class OneScanner:
    """``slam`` behind the protocol: frames of the first frame's scanner are its own.

    At those of others, its pose is that of its last own frame, led on by odometry. What ``slam``
    can do beyond the protocol, this can.
    """

    def __init__(self, slam: SlamSystem) -> None:
        self.slam = slam
        for name in OPTIONAL:
            if hasattr(slam, name) and not hasattr(self, name):
                setattr(self, name, getattr(slam, name))
        if hasattr(slam, "estimates_at_end"):
            self.estimates_at_end = self._at_end
        self._forget()

    def _forget(self) -> None:
        self._mount: tuple[float, ...] | None = None
        self._own: Estimate | None = None  # the last
        self._before: Odometry | None = None
        self._step: Float = np.zeros(3)  # since the last own frame, with its covariance
        self._covariance: Float | None = np.zeros((3, 3))
        self._stamps: list[int] = []
        self._steps: dict[int, Float] = {}  # of frames of others, by their place

    def reset(self) -> None:
        """As the SLAM's."""
        self.slam.reset()
        self._forget()

    def update(self, frame: Frame) -> Estimate:
        """The SLAM's, or the last one led on."""
        odometry = self._moved(frame.odometry)
        self._stamps.append(frame.stamp_ns)
        mount = None if frame.scan is None else frame.scan.spec.mount
        if self._own is None or mount == self._mount:
            self._mount, self._step, self._covariance = mount, np.zeros(3), np.zeros((3, 3))
            self._own = self.slam.update(replace(frame, odometry=odometry))
            return self._own
        self._steps[len(self._stamps) - 1] = self._step
        return self._led(self._own, self._step, frame.stamp_ns)

    def _moved(self, now: Odometry) -> Odometry:
        """Take a step; the odometry with the covariance since the last own frame."""
        before, spread = self._before, now.increment_covariance
        self._before = now
        if before is None:
            return now
        step = se2.between(before.T_odom_robot, now.T_odom_robot)
        if self._covariance is not None:
            known = self._covariance, self._step, step
            self._covariance = None if spread is None else se2.propagate(*known, spread)
        self._step = se2.compose(self._step, step)
        return replace(now, increment_covariance=self._covariance)

    def _led(self, own: Estimate, step: Float, stamp_ns: int) -> Estimate:
        covariance = own.covariance
        if covariance.any() and self._covariance is not None:  # zero: no claim
            covariance = se2.propagate(covariance, own.T_map_robot, step, self._covariance)
        T_map_robot = se2.compose(own.T_map_robot, step)
        return replace(own, stamp_ns=stamp_ns, T_map_robot=T_map_robot, covariance=covariance)

    def map(self) -> Raster | None:
        """As the SLAM's."""
        return self.slam.map()

    def trajectory(self) -> Trajectory:
        """The SLAM's, led on from each own frame to those of others after it."""
        own = self.slam.trajectory()
        at = np.searchsorted(own.stamps_ns, self._stamps, side="right") - 1
        poses = [
            se2.compose(own.poses[row], self._steps[k]) if k in self._steps else own.poses[row]
            for k, row in enumerate(at.tolist())
        ]
        return Trajectory(stamps_ns=np.array(self._stamps, dtype=np.int64), poses=np.array(poses))

    def _at_end(self) -> Sequence[tuple[Estimate, float]]:
        answers = iter(self.slam.estimates_at_end())  # type: ignore[attr-defined]
        found: list[tuple[Estimate, float]] = []
        for k, stamp_ns in enumerate(self._stamps):
            if k not in self._steps:
                own = next(answers)
                found.append(own)
            else:
                T_map_robot = se2.compose(own[0].T_map_robot, self._steps[k])
                found.append((replace(own[0], stamp_ns=stamp_ns, T_map_robot=T_map_robot), 0.0))
        return found


def for_several(system: SlamSystem) -> SlamSystem:
    """The system, behind ``OneScanner`` unless it says that it takes several."""
    if isinstance(system, Oracle):
        return Oracle(for_several(system.slam), system.takes_out)
    if getattr(system, "takes_several", False) or isinstance(system, OneScanner):
        return system
    return OneScanner(system)

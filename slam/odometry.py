# SPDX-License-Identifier: Apache-2.0
"""The null system: odometry alone. Every other SLAM is measured against it."""

import numpy as np

from slam import se2
from slam.estimate import Estimate
from slam.frames import Float, Frame, Odometry
from slam.frontend import odometry_prior
from slam.path import OnPath, PosePath


class OdometrySlam(OnPath):
    """Chains odometry from the first frame; no map.

    The covariance is the propagated sum of the increments' own covariances, or, where a stream
    carries none, stays zero with ``converged`` still True: the null system makes no claim.
    """

    takes_several = True

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Forget everything; the next frame is the origin."""
        self._first: Odometry | None = None
        self._before: Odometry | None = None
        self._T_map_robot: Float = np.zeros(3)
        self._covariance: Float = np.zeros((3, 3))
        self._path = PosePath()

    def update(self, frame: Frame) -> Estimate:
        """The odometry pose relative to the first frame.

        Raises ``InvalidValueError`` for a frame that does not come after the last one and where a
        step is none (``slam.frontend.odometry_prior``), as all SLAMs here do.
        """
        self._path.check_order(frame.stamp_ns)
        now = frame.odometry
        if self._first is None or self._before is None:
            self._first = self._before = now
        odometry_prior.motion(self._before, now)
        self._before = now
        T_map_robot = se2.between(self._first.T_odom_robot, now.T_odom_robot)
        increment_covariance = now.increment_covariance
        if increment_covariance is not None and len(self._path):
            T_before_now = se2.between(self._T_map_robot, T_map_robot)
            self._covariance = se2.propagate(
                self._covariance,
                self._T_map_robot,
                T_before_now,
                odometry_prior.known(increment_covariance),
            )
        self._T_map_robot = T_map_robot
        self._path.add(frame.stamp_ns, T_map_robot)
        return Estimate(
            stamp_ns=frame.stamp_ns, T_map_robot=T_map_robot, covariance=self._covariance
        )

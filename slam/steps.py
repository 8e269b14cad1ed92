# SPDX-License-Identifier: Apache-2.0
"""The motion between two frames by odometry, and what can be none."""

from __future__ import annotations

import math

from slam import se2
from slam.errors import InvalidValueError
from slam.frames import Float, Odometry

MOST_STEP_M = 1000.0  # between two frames: farther, the stream is broken or of another run


def increment(before: Odometry, now: Odometry) -> Float:
    """(3,) ``T_before_now``. Raises ``InvalidValueError`` for a step that no robot makes."""
    x, y, _ = before.T_odom_robot.tolist()
    x_now, y_now, _ = now.T_odom_robot.tolist()
    distance = math.hypot(x_now - x, y_now - y)
    if not distance <= MOST_STEP_M:
        raise InvalidValueError(
            f"Odometry.T_odom_robot must move by at most {MOST_STEP_M:g} m from frame to frame, "
            f"got {distance:g} m from {before.stamp_ns} ns to {now.stamp_ns} ns"
        )
    return se2.between(before.T_odom_robot, now.T_odom_robot)

# SPDX-License-Identifier: Apache-2.0
"""A scan as points, for whoever writes a SLAM: ``from slam import deskewed, points_robot``."""

import numpy as np

from slam.errors import InvalidValueError
from slam.frames import Float, Frame
from slam.frontend.deskew import end_points


def points_robot(frame: Frame) -> Float:
    """(n, 2) m, the end points of the valid beams (``Scan.valid``) in the robot frame.

    Counter-clockwise, as the beams are. As if the robot had stood still during the sweep. Raises
    ``InvalidValueError`` for a frame without a scan.
    """
    return _ends(frame, np.zeros(3))


def deskewed(frame: Frame, twist: Float | None = None) -> Float:
    """(n, 2) m, the same points where the robot was at the frame's stamp: its motion is taken out.

    twist  (3,) body velocity during the sweep: m/s, m/s, rad/s. Default that of the odometry, and
           none (then the points are ``points_robot``) where a log does not tell one

    Raises ``InvalidValueError`` for a frame without a scan or a twist of another shape.
    """
    if twist is None:
        twist = frame.odometry.twist
    twist = np.zeros(3) if twist is None else np.asarray(twist, dtype=np.float64)
    if twist.shape != (3,) or not np.isfinite(twist).all():
        raise InvalidValueError(f"twist must be three finite numbers, got {twist.tolist()}")
    return _ends(frame, twist)


def _ends(frame: Frame, twist: Float) -> Float:
    if frame.scan is None:
        raise InvalidValueError(f"the frame of {frame.stamp_ns} ns has no scan")
    spec, valid = frame.scan.spec, frame.scan.valid
    return end_points(
        frame.scan.ranges[valid].astype(np.float64), spec.angles[valid],
        spec.beam_time_offsets[valid], spec.T_robot_laser, np.ascontiguousarray(twist),
    )  # fmt: skip

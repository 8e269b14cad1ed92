# SPDX-License-Identifier: Apache-2.0
"""The rawlog of MRPT: pairs of an action (odometry) and a sensory frame (one planar scan).

Its format is MRPT's serialisation, little endian: of each object the length of its class name with
the top bit set, the name, a version of the layout, the members, and the byte 0x88. The layouts are
those that MRPT 2.5 writes, but for ``CSensoryFrame`` (2), which it reads too. MRPT opens rawlogs
with zlib, which reads uncompressed files as they are.
"""

from __future__ import annotations

import math
import struct
from dataclasses import dataclass

import numpy as np

from slam import se2
from slam.frames import Float, LaserSpec

EPOCH_100NS = 116_444_736_000_000_000  # MRPT's time is 100 ns since 1601: here 1970-01-01
LABEL = b"LASER"
_ODOMETRY, _GAUSSIAN = 0, 0  # CActionRobotMovement2D: emOdometry, mmGaussian


@dataclass(frozen=True, kw_only=True)
class MotionModel:
    """MRPT's Gaussian error of an odometry step: its standard deviations grow with the motion."""

    m_per_m: float
    m_per_rad: float
    rad_per_m: float
    rad_per_rad: float
    least_m: float
    least_rad: float


def _object(name: str, version: int, members: bytes) -> bytes:
    return bytes((0x80 | len(name),)) + name.encode() + bytes((version,)) + members + b"\x88"


def _pose3d(pose: Float) -> bytes:
    """A planar pose in space: position and rotation matrix."""
    x, y, theta = pose.tolist()
    c, s = math.cos(theta), math.sin(theta)
    numbers = (x, y, 0.0, c, -s, 0.0, s, c, 0.0, 0.0, 0.0, 1.0)
    return _object("mrpt::poses::CPose3D", 3, struct.pack("<12d", *numbers))


def action(stamp_ns: int, increment: Float, model: MotionModel) -> bytes:
    """A step (3,) m, m, rad by odometry, in the robot frame before it."""
    gaussian = (
        model.m_per_m, model.m_per_rad, model.rad_per_m, model.rad_per_rad,
        model.least_m, model.least_rad,
    )  # fmt: skip
    members = b"".join((
        struct.pack("<I", _ODOMETRY),
        _object("mrpt::poses::CPose2D", 1, struct.pack("<3d", *increment.tolist())),
        struct.pack("<I6f", _GAUSSIAN, *gaussian),
        struct.pack("<I6f", 0, *(0.0,) * 6),  # the other model, not used
        struct.pack("<??", False, False),  # no velocities, no encoder ticks
        struct.pack("<q", EPOCH_100NS + stamp_ns // 100),
    ))  # fmt: skip
    moved = _object("mrpt::obs::CActionRobotMovement2D", 7, members)
    return _object("mrpt::obs::CActionCollection", 0, struct.pack("<I", 1) + moved)


def sensed(stamp_ns: int, ranges: Float, spec: LaserSpec) -> bytes:
    """A frame of one scan (n_beams,) m; a range that is not finite is no valid one."""
    valid = np.isfinite(ranges)
    aperture = (spec.n_beams - 1) * spec.angle_increment
    middle = np.array([0.0, 0.0, spec.angle_min + aperture / 2.0])
    members = b"".join((
        struct.pack("<f?f", aperture, True, spec.range_max),  # counter-clockwise
        _pose3d(se2.compose(spec.T_robot_laser, middle)),
        struct.pack("<I", spec.n_beams),
        np.where(valid, ranges, 0.0).astype("<f4").tobytes(),
        valid.astype("u1").tobytes(),
        struct.pack("<f", spec.range_sigma_m or 0.01),
        struct.pack("<q", EPOCH_100NS + stamp_ns // 100),
        struct.pack("<f", spec.angle_increment / 2.0),  # of the beam itself
        struct.pack("<I", len(LABEL)) + LABEL,
        struct.pack("<d?", 0.0, False),  # no pitch during the sweep, no intensities
    ))  # fmt: skip
    scan = _object("mrpt::obs::CObservation2DRangeScan", 7, members)
    return _object("mrpt::obs::CSensoryFrame", 2, struct.pack("<I", 1) + scan)

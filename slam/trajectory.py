# SPDX-License-Identifier: Apache-2.0
"""A stamped sequence of poses, and the TUM file that evo reads."""

import math
from dataclasses import dataclass
from decimal import Decimal
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from slam.bounded import text_of
from slam.checked import finite, frozen, set_fields
from slam.errors import InvalidValueError, LogFormatError
from slam.files import write_text
from slam.frames import NS_PER_S, Float

MAX_TUM_BYTES = 1 << 28  # two million poses, 16 hours of scans
MAX_STAMP_S = 9e9  # what 64-bit nanoseconds hold: year 2255


@dataclass(frozen=True, kw_only=True, eq=False)
class Trajectory:
    """``stamps_ns`` (n,) int64, strictly increasing; ``poses`` (n, 3) T_frame_robot (m, m, rad)."""

    stamps_ns: NDArray[np.int64]
    poses: Float

    def __post_init__(self) -> None:
        stamps = frozen("Trajectory", "stamps_ns", self.stamps_ns, (None,), np.int64)
        if np.any(np.diff(stamps) <= 0):
            raise InvalidValueError("Trajectory.stamps_ns must strictly increase")
        poses = frozen("Trajectory", "poses", self.poses, (len(stamps), 3))
        finite("Trajectory", "poses", poses)
        set_fields(self, stamps_ns=stamps, poses=poses)

    def __len__(self) -> int:
        return len(self.stamps_ns)

    def length_m(self) -> float:
        """Distance driven, m."""
        steps = np.diff(self.poses[:, :2], axis=0)
        return float(np.sqrt((steps * steps).sum(axis=1)).sum())


def write_tum(path: Path, trajectory: Trajectory, epoch_ns: int = 0) -> None:
    """``t x y z qx qy qz qw``, one pose a line (TUM RGB-D format, as evo reads).

    epoch_ns  is added to each stamp: of a bag whose frames begin at 0 s (``slam.frames.EPOCH``)
    """
    lines = []
    for stamp_ns, (x, y, theta) in zip(
        (trajectory.stamps_ns + epoch_ns).tolist(), trajectory.poses.tolist(), strict=True
    ):
        qz, qw = math.sin(theta / 2.0), math.cos(theta / 2.0)
        lines.append(f"{tum_stamp(stamp_ns)} {x:.9f} {y:.9f} 0 0 0 {qz:.12f} {qw:.12f}")
    write_text(path, "\n".join(lines) + "\n" if lines else "")


def tum_stamp(stamp_ns: int) -> str:
    """Seconds with all nine digits."""
    seconds, nanoseconds = divmod(abs(stamp_ns), NS_PER_S)
    return f"{'-' if stamp_ns < 0 else ''}{seconds}.{nanoseconds:09d}"


def read_tum(path: Path) -> Trajectory:
    """The planar part of a TUM trajectory file; raises ``LogFormatError`` with the line."""
    lines = text_of(path, MAX_TUM_BYTES).splitlines()
    stamps: list[int] = []
    poses: list[tuple[float, float, float]] = []
    for number, line in enumerate(lines, 1):
        if not line.strip() or line.startswith("#"):
            continue
        try:
            stamp_ns, pose = tum_pose(line.split())
            if stamps and stamp_ns <= stamps[-1]:
                raise ValueError("time does not increase")
        except (ValueError, ArithmeticError) as error:
            raise LogFormatError(path, f"no TUM pose: {error}", number) from error
        stamps.append(stamp_ns)
        poses.append(pose)
    return Trajectory(
        stamps_ns=np.array(stamps, dtype=np.int64), poses=np.array(poses).reshape(-1, 3)
    )


def tum_pose(words: list[str]) -> tuple[int, tuple[float, float, float]]:
    """Stamp (ns, exact: Unix times have more digits than a float) and (x, y, yaw).

    Raises ``ValueError`` or ``ArithmeticError`` for other than eight numbers of a pose.
    """
    if len(words) != 8:
        raise ValueError(f"expected 8 numbers, found {len(words)}")
    x, y, _, qx, qy, qz, qw = values = [float(word) for word in words[1:]]
    if not all(map(math.isfinite, values)) or not abs(float(words[0])) < MAX_STAMP_S:
        raise ValueError(f"expected finite numbers and a time below {MAX_STAMP_S:g} s")
    if qx == qy == qz == qw == 0.0:
        raise ValueError("the quaternion is zero")
    yaw = math.atan2(2.0 * (qw * qz + qx * qy), qw * qw + qx * qx - qy * qy - qz * qz)
    return round(Decimal(words[0]) * NS_PER_S), (x, y, yaw)

# SPDX-License-Identifier: Apache-2.0
"""A stamped sequence of poses, and the TUM file that evo reads."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from slam.errors import InvalidValueError, LogFormatError
from slam.files import write_text
from slam.frames import NS_PER_S, Float, finite, frozen


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
        object.__setattr__(self, "stamps_ns", stamps)
        object.__setattr__(self, "poses", poses)

    def __len__(self) -> int:
        return len(self.stamps_ns)

    def length_m(self) -> float:
        """Distance driven, m."""
        steps = np.diff(self.poses[:, :2], axis=0)
        return float(np.sqrt((steps * steps).sum(axis=1)).sum())


def write_tum(path: Path, trajectory: Trajectory) -> None:
    """``t x y z qx qy qz qw``, one pose a line (TUM RGB-D format, as evo reads)."""
    lines = []
    for stamp_ns, (x, y, theta) in zip(
        trajectory.stamps_ns.tolist(), trajectory.poses.tolist(), strict=True
    ):
        seconds, nanoseconds = divmod(stamp_ns, NS_PER_S)
        qz, qw = math.sin(theta / 2.0), math.cos(theta / 2.0)
        lines.append(f"{seconds}.{nanoseconds:09d} {x:.9f} {y:.9f} 0 0 0 {qz:.12f} {qw:.12f}")
    write_text(path, "\n".join(lines) + "\n" if lines else "")


def read_tum(path: Path) -> Trajectory:
    """The planar part of a TUM trajectory file; raises ``LogFormatError`` with the line."""
    stamps: list[int] = []
    poses: list[tuple[float, float, float]] = []
    for number, line in enumerate(path.read_text().splitlines(), 1):
        if not line.strip() or line.startswith("#"):
            continue
        words = line.split()
        try:
            if len(words) != 8:
                raise ValueError(f"expected 8 numbers, found {len(words)}")
            whole, _, fraction = words[0].partition(".")
            stamps.append(int(whole) * NS_PER_S + int((fraction + "000000000")[:9]))
            x, y, _, qx, qy, qz, qw = (float(word) for word in words[1:])
        except ValueError as error:
            raise LogFormatError(path, str(error), number) from error
        yaw = math.atan2(2.0 * (qw * qz + qx * qy), 1.0 - 2.0 * (qy * qy + qz * qz))
        poses.append((x, y, yaw))
    return Trajectory(
        stamps_ns=np.array(stamps, dtype=np.int64), poses=np.array(poses).reshape(-1, 3)
    )

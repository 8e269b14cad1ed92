# SPDX-License-Identifier: Apache-2.0
"""Real logs where there are some, and synthetic CARMEN logs written line by line."""

import math
import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from slam import se2

N = 181
END = "0 0 0"


def _data_folder(name: str) -> Path:
    """The folder of a real log, or a loud skip."""
    root = os.environ.get("MOBILIA_DATA")
    folder = Path(root) if root else Path(__file__).resolve().parents[4] / "shared" / "data"
    if not (folder / name).is_dir():
        pytest.skip(f"NO REAL LOGS: {folder / name} is missing (set MOBILIA_DATA to their folder)")
    return folder / name


@pytest.fixture
def data_folder() -> Callable[[str], Path]:
    """Name -> folder of a real log; skips the test without it."""
    return _data_folder


@pytest.fixture
def carmen_text() -> "CarmenText":
    """Makers of the lines of a CARMEN log."""
    return CarmenText()


class CarmenText:
    """Lines of a log: a robot on a gentle S; the ranges are arbitrary but differ."""

    def path_poses(self, n: int, step: float = 0.3) -> list[np.ndarray]:
        """A gentle S, ``step`` m and at most 0.2 rad between poses."""
        poses = [np.array([0.5, -0.25, 0.3])]
        for k in range(1, n):
            poses.append(se2.compose(poses[-1], [step, 0.0, 0.2 * math.sin(k)]))
        return poses

    def words(self, values: object) -> str:
        return " ".join(f"{v:.6f}" for v in np.asarray(values, dtype=float).tolist())

    def ranges(self, k: int, n: int = N) -> str:
        return " ".join(f"{2.0 + 0.01 * ((7 * i + 3 * k) % 100):.2f}" for i in range(n))

    def flaser(
        self, k: int, t: float, laser: object, robot: object, n: int = N, text: str = ""
    ) -> str:
        body = text or self.ranges(k, n)
        poses = f"{self.words(laser)} {self.words(robot)}"
        return f"FLASER {n} {body} {poses} {t:.6f} host {t:.6f}\n"

    def odom(self, t: float, pose: object) -> str:
        return f"ODOM {self.words(pose)} {END} {t:.6f} host {t:.6f}\n"

    def geometry(self, n: int = N, mode: str = " 0") -> str:
        step = math.pi / (n - 1)
        return f"1 {-math.pi / 2:.6f} {math.pi:.6f} {step:.6f} 8.0 0.01{mode} {n}"

    def robotlaser(
        self,
        k: int,
        t: float,
        laser: object,
        robot: object,
        *,
        tail: str = "0 0 0 0 0",
        mode: str = " 0",
    ) -> str:
        poses = f"{self.words(laser)} {self.words(robot)}"
        scan = f"{self.geometry(N, mode)} {self.ranges(k)} 0"
        return f"ROBOTLASER1 {scan} {poses} {tail} {t:.6f} host {t:.6f}\n"

    def rawlaser(self, k: int, t: float) -> str:
        return f"RAWLASER1 {self.geometry()} {self.ranges(k)} 0 {t:.6f} host {t:.6f}\n"

    def plain_log(self, n: int = 8, offset: float = 0.0) -> str:
        """FLASER lines on raw odometry, with ODOM lines between."""
        lines = ["# comment\n", f"PARAM robot_frontlaser_offset {offset} nohost 0\n"]
        for k, pose in enumerate(self.path_poses(n)):
            lines.append(self.odom(k + 0.4, se2.compose(pose, [-0.1, 0.0, -0.05])))
            lines.append(self.flaser(k, k + 0.5, se2.compose(pose, [offset, 0.0, 0.0]), pose))
            lines.append(self.odom(k + 0.6, se2.compose(pose, [0.1, 0.0, 0.05])))
        return "".join(lines)

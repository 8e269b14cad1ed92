# SPDX-License-Identifier: Apache-2.0
"""When a scan's beams are among the physics steps, for what is interpolated to them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sim.sensors.lidar.device import STEPS_PER_S, LaserScanner
from sim.sensors.odometry.encoders import WheelOdometry
from slam import se2
from slam.frames import Float, Odometry


@dataclass(frozen=True, kw_only=True)
class ScanTiming:
    """When a scan's first and last beam are, in rows of its physics steps (``schedule.Window``).

    What the encoders and the truth say is interpolated to these between the steps.
    """

    offset_ns: int
    first: float
    last: float
    sweep_s: float

    @classmethod
    def of(cls, laser: LaserScanner) -> ScanTiming:
        """Of the scan that was begun last."""
        offset_ns = laser.scanner.stamp_offset_ns
        first = laser.window.first + offset_ns * 1e-9 * STEPS_PER_S
        # Beams that are all measured at once: the twist is that of the step from there.
        sweep = laser.spec.sweep_duration or 1.0 / STEPS_PER_S
        return cls(
            offset_ns=offset_ns, first=first, last=first + sweep * STEPS_PER_S, sweep_s=sweep
        )

    def odometry(
        self, encoders: WheelOdometry, travel: Float, stamp_ns: int, touched: bool
    ) -> Odometry:
        """Advance the encoders over a scan; ``travel`` (rows, 2) m rolled at its steps."""
        self.roll(encoders, travel, touched)
        return encoders.reading(stamp_ns=stamp_ns, sweep_s=self.sweep_s)

    def roll(self, encoders: WheelOdometry, travel: Float, touched: bool) -> None:
        """The same without the reading."""
        encoders.over_scan(travel, self.first, self.last, contact=touched)

    def truth(self, path: Float) -> Float:
        """(3,) pose at the first beam; ``path`` (rows, 3)."""
        k = min(int(self.first), len(path) - 2)
        if self.first == k:
            x, y, theta = path[k].tolist()
            return np.array([x, y, se2.wrap(theta)])
        return se2.interpolate(path[k], path[k + 1], self.first - k)

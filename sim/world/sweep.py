# SPDX-License-Identifier: Apache-2.0
"""The time of one scan: physics steps, where the robot was at each, when its beams are."""

from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np

from sim.core.packed import packed
from sim.sensors.lidar.device import STEPS_PER_S, LaserScanner
from sim.sensors.lidar.schedule import Window
from sim.sensors.odometry.encoders import WheelOdometry
from sim.world.substeps import Watch
from sim.world.world import SUBSTEPS_PER_S, World
from slam import se2
from slam.frames import NS_PER_S, Float, Odometry


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
    def of(cls, laser: LaserScanner) -> "ScanTiming":
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
        """Advance the encoders over a scan; ``travel`` (rows, 3) m rolled at its steps."""
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


class Sweep:
    """Lets a world live through one scan after the other.

    path    (rows, 3) true poses of the robot at the steps of the last scan
    travel  (rows, 3) m that its wheels had rolled at these, left, right and sideways
    timing  of that scan's beams among the steps

    Where a scan begins between two steps, row 0 is the step before.
    """

    timing: ScanTiming

    def __init__(self, laser: LaserScanner) -> None:
        rows = laser.caster.poses.shape[0]  # for a scan of whatever phase
        self._rows: tuple[Float, Float] = (np.zeros((rows, 3)), np.zeros((rows, 3)))
        self._window: Window | None = None  # that watch and timing are of
        self._watch: Any = None
        self.path, self.travel = self._rows

    def renew(self) -> None:
        """The next scan is of another scanner, or of a state that was loaded."""
        self._window = None

    def over_scan(self, world: World, laser: LaserScanner) -> int:
        """Let the time of one scan pass; the stamp of its earliest beam, ns."""
        noted = laser.begin(world.data)
        window = laser.window
        if window.before:  # the scan begins within the step that the one before ended with
            for rows, own in zip(self._rows, (self.path, self.travel), strict=True):
                rows[0] = own[-2]
        world.read_robot(self._rows[0][window.before], self._rows[1][window.before])
        if laser.carried:
            self._rows[0][0] = self._rows[0][1]
        if window is not self._window:
            self._window, self.timing = window, ScanTiming.of(laser)
            self._watch = packed(Watch(window.marks, noted, *self._rows))
            self.path, self.travel = (rows[: window.last + 1] for rows in self._rows)
        start_ns, phase = world.time_ns, laser.phase
        if phase:
            start_ns = round((world.step_count - phase) * Fraction(NS_PER_S, SUBSTEPS_PER_S))
        world.advance(window.before, window.last, self._watch)
        return start_ns + self.timing.offset_ns

# SPDX-License-Identifier: Apache-2.0
"""The time of one scan: physics steps, and where the robot was at each of them."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

import numpy as np

from sim.sensors.lidar.device import LaserScanner
from sim.sensors.lidar.schedule import Window
from sim.sensors.scan_timing import ScanTiming
from sim.sensors.tag_cameras import TagCameras
from sim.world.substeps import plain
from sim.world.world import SUBSTEPS_PER_S, World
from slam.frames import NS_PER_S, Float


class Sweep:
    """Lets a world live through one scan after the other.

    path    (rows, 3) true poses of the robot at the steps of the last scan
    travel  (rows, 2) m that its wheels had rolled at these
    timing  of that scan's beams among the steps

    Where a scan begins between two steps, row 0 is the step before.
    """

    timing: ScanTiming

    def __init__(self, laser: LaserScanner) -> None:
        rows = laser.caster.poses.shape[0]  # for a scan of whatever phase
        self._rows: tuple[Float, Float] = (np.zeros((rows, 3)), np.zeros((rows, 2)))
        self._window: Window | None = None  # that watch and timing are of
        self._watch: Any = None
        self.path, self.travel = self._rows

    def renew(self) -> None:
        """The next scan is of another scanner, or of a state that was loaded."""
        self._window = None

    def over_scan(self, world: World, laser: LaserScanner, tags: TagCameras | None) -> int:
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
            self._watch = plain((window.marks, noted, *self._rows))
            self.path, self.travel = (rows[: window.last + 1] for rows in self._rows)
        start_ns, phase = world.time_ns, laser.phase
        if phase:
            start_ns = round((world.step_count - phase) * Fraction(NS_PER_S, SUBSTEPS_PER_S))
        self._steps(world, window, tags)
        return start_ns + self.timing.offset_ns

    def _steps(self, world: World, window: Window, tags: TagCameras | None) -> None:
        first = window.before
        # With ceiling cameras the world stops after every step for them to look.
        for stop in range(first + 1, window.last + 1) if tags else (window.last,):
            world.advance(first, stop, self._watch)
            if tags is not None:
                tags.note(world.time_ns, world.data)
            first = stop

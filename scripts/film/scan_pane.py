# SPDX-License-Identifier: Apache-2.0
"""The pane of a log's scan: around the robot, its front up, beams by what they hit."""

from __future__ import annotations

import math

import numpy as np

from sim.view import draw
from sim.view.draw import Picture, View
from sim.view.scans import FAN, beams
from slam import se2
from slam.frames import Frame

MOST_M = 80.0  # of what is shown
_FRONT_UP = np.array([0.0, 0.0, math.pi / 2.0])


class RobotScan:
    """Paints scans, or the features of a log that has these; what is shown grows with them."""

    def __init__(self, size: tuple[int, int], unit: float) -> None:
        self._size, self._unit = size, unit
        self._reach = 5.0

    def __call__(self, frame: Frame) -> Picture:
        """(height, width, 3) uint8 RGB."""
        width, height = self._size
        T_robot_laser, ends, colors = beams(frame)
        points = se2.transform(T_robot_laser, ends)
        if len(ends):
            far = 1.15 * float(np.percentile(np.hypot(ends[:, 0], ends[:, 1]), 90))
            self._reach = max(self._reach, min(far, MOST_M))
        spec = None if frame.scan is None else frame.scan.spec
        wide = spec is not None and spec.n_beams * spec.angle_increment > 1.2 * math.pi
        behind = 1.0 if wide else 0.12  # of that: so far down from the robot the pane reaches
        bounds = (-self._reach, -behind * self._reach, self._reach, self._reach)
        view = View.fitting(bounds, width, height)
        picture: Picture = np.full((height, width, 3), draw.PAPER, np.uint8)
        pixels = view.pixels(se2.transform(_FRONT_UP, points))
        if spec is not None and len(points):
            origin = view.pixels(se2.transform(_FRONT_UP, T_robot_laser[None, :2]))
            draw.polygon(picture, np.vstack([origin, pixels]), draw.paler(FAN, 0.7))
        draw.dots(picture, pixels, colors, 2.0 * self._unit)
        draw.robot(picture, view, _FRONT_UP, draw.INK)
        draw.scale_bar(picture, view, self._unit)
        return picture

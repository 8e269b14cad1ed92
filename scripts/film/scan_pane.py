# SPDX-License-Identifier: Apache-2.0
"""The pane of the scan: in the true world where there is one, around the robot for a log.

Beams are coloured by what they hit where the frame says so.
"""

from __future__ import annotations

import math

import cv2
import numpy as np

from sim.view import draw
from sim.view.draw import Picture
from sim.view.scans import LEGEND, beam_colors, beam_ends
from slam import se2
from slam.frames import Float, Frame

_RINGS_M = (1.0, 2.0, 5.0, 10.0, 20.0, 40.0, 80.0)


def legend(picture: Picture, at: tuple[int, int], unit: float) -> None:
    """The colours of the beams in one line, from ``at`` to the right."""
    x, y = at
    radius = max(2, round(4 * unit))
    for word, color in LEGEND:
        middle = (x + radius, y + round(8 * unit))
        cv2.circle(picture, middle, radius, color, cv2.FILLED, cv2.LINE_AA)
        x = draw.text(picture, word, (x + round(13 * unit), y), round(12 * unit), draw.INK)
        x += round(11 * unit)


class RobotScan:
    """Paints a scan around the robot, its front up; the rings grow with what it has seen."""

    def __init__(self, size: tuple[int, int], unit: float) -> None:
        self._size, self._unit = size, unit
        self._reach = 5.0

    def __call__(self, frame: Frame) -> Picture:
        """(height, width, 3) uint8 RGB."""
        width, height = self._size
        picture: Picture = np.full((height, width, 3), 255, np.uint8)
        if frame.scan is None:
            self._landmarks(picture, frame)
            return picture
        spec = frame.scan.spec
        ends = beam_ends(frame.scan)
        lengths = frame.scan.ranges[frame.scan.valid]
        if len(lengths):
            self._reach = max(self._reach, min(float(np.percentile(lengths, 90)) * 1.15, 80.0))
        wide = spec.n_beams * spec.angle_increment > 1.2 * math.pi
        pixels = self._pixels(se2.transform(spec.T_robot_laser, ends), wide)
        origin = self._pixels(spec.T_robot_laser[None, :2], wide)
        known = ~np.isnan(pixels[:, 0])
        fan = np.vstack([origin, pixels[known]])
        draw.polygon(picture, fan, (255, 236, 214))
        self._rings(picture, wide)
        draw.dots(picture, pixels[known], beam_colors(frame)[known], 2.0 * self._unit)
        self._robot(picture, wide)
        return picture

    def _pixels(self, points: Float, wide: bool) -> Float:
        """(n, 2) px of points in the robot frame: x up, y to the left."""
        width, height = self._size
        if wide:  # the robot in the middle
            scale, foot = min(width, height) / 2.0 / self._reach, height / 2.0
        else:
            scale, foot = min(width / 2.0, height * 0.86) / self._reach, height * 0.9
        return np.stack([width / 2.0 - points[:, 1] * scale, foot - points[:, 0] * scale], axis=1)

    def _rings(self, picture: Picture, wide: bool) -> None:
        center, edge = self._pixels(np.array([[0.0, 0.0], [1.0, 0.0]]), wide)
        scale = float(center[1] - edge[1])
        middle = tuple(draw.fixed(center).tolist())
        shown = [r for r in _RINGS_M if r <= self._reach][-3:]
        for meters in shown:
            radius = round(meters * scale * 16.0)
            cv2.circle(picture, middle, radius, draw.GRID, 1, cv2.LINE_AA, 4)
            at = (round(float(center[0])) + 4, round(float(center[1]) - meters * scale) + 2)
            draw.text(picture, f"{meters:g} m", at, round(11 * self._unit), draw.MUTED)

    def _robot(self, picture: Picture, wide: bool) -> None:
        size = max(0.3, self._reach * 0.03)
        body = size * np.array([[1.0, 0.0], [-0.7, 0.65], [-0.7, -0.65]])
        draw.polygon(picture, self._pixels(body, wide), draw.INK)

    def _landmarks(self, picture: Picture, frame: Frame) -> None:
        """Of a log that holds point features instead of scans."""
        points = np.zeros((0, 2)) if frame.features is None else frame.features.points_robot
        if len(points):
            farthest = float(np.hypot(points[:, 0], points[:, 1]).max())
            self._reach = max(self._reach, min(1.05 * farthest, 80.0))
        self._rings(picture, wide=False)
        pixels = self._pixels(points, wide=False)
        draw.dots(picture, pixels, [draw.BLUE] * len(pixels), 4.0 * self._unit)
        self._robot(picture, wide=False)

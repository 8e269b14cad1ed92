# SPDX-License-Identifier: Apache-2.0
"""The pane of the scan: in the true world where there is one, around the robot for a log.

Beams are coloured by what they hit where the frame says so.
"""

from __future__ import annotations

import math

import cv2
import numpy as np
from numpy.typing import NDArray

from scripts.film import draw
from scripts.film.draw import Color, Picture
from slam import se2
from slam.frames import BeamClass, Float, Frame, Scan

LEGEND: tuple[tuple[str, Color], ...] = (
    ("static", draw.AZURE),
    ("semi-static", draw.TEAL),
    ("moving", draw.MAGENTA),
    ("mixed pixel", draw.VIOLET),
    ("no return", draw.GRAY),
)
_BY_KIND = {
    BeamClass.STATIC: draw.AZURE,
    BeamClass.SEMI_STATIC: draw.TEAL,
    BeamClass.MOVING: draw.MAGENTA,
}
SILENT_M = 1.2  # how long a beam without return is drawn
_RINGS_M = (1.0, 2.0, 5.0, 10.0, 20.0, 40.0, 80.0)


def beam_colors(frame: Frame) -> NDArray[np.uint8]:
    """(n_beams, 3) RGB by what each beam hit; the colour of raw LIDAR where nothing says."""
    assert frame.scan is not None
    colors = np.empty((frame.scan.spec.n_beams, 3), np.uint8)
    colors[:] = draw.BLUE
    if frame.labels is not None:
        for kind, color in _BY_KIND.items():
            colors[frame.labels.kind == kind] = color
        colors[frame.labels.mixed] = draw.VIOLET
    colors[~frame.scan.valid] = draw.GRAY
    return colors


def beam_ends(scan: Scan) -> Float:
    """(n_beams, 2) m in the laser frame, NaN without a return (not de-skewed)."""
    ranges = np.where(scan.valid, scan.ranges.astype(np.float64), np.nan)
    angles = scan.spec.angles
    return np.stack([ranges * np.cos(angles), ranges * np.sin(angles)], axis=1)


def points_robot(scan: Scan) -> Float:
    """(k, 2) m, end points of the valid beams in the robot frame (not de-skewed)."""
    return se2.transform(scan.spec.T_robot_laser, beam_ends(scan)[scan.valid])


def silent_ends(scan: Scan) -> Float:
    """(k, 2) m in the laser frame: where the marks of beams without a return are."""
    angles = scan.spec.angles[~scan.valid]
    return SILENT_M * np.stack([np.cos(angles), np.sin(angles)], axis=1)


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
        cv2.fillPoly(picture, [_fixed(fan)], (255, 236, 214), cv2.LINE_AA, 4)
        self._rings(picture, wide)
        colors = beam_colors(frame)
        for (x, y), color in zip(
            _fixed(pixels[known]).tolist(), colors[known].tolist(), strict=True
        ):
            cv2.circle(picture, (x, y), round(2.0 * self._unit * 16), color, -1, cv2.LINE_AA, 4)
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
        middle = tuple(_fixed(center[None])[0].tolist())
        shown = [r for r in _RINGS_M if r <= self._reach][-3:]
        for meters in shown:
            radius = round(meters * scale * 16.0)
            cv2.circle(picture, middle, radius, draw.GRID, 1, cv2.LINE_AA, 4)
            at = (round(float(center[0])) + 4, round(float(center[1]) - meters * scale) + 2)
            draw.text(picture, f"{meters:g} m", at, round(11 * self._unit), draw.MUTED)

    def _robot(self, picture: Picture, wide: bool) -> None:
        size = max(0.3, self._reach * 0.03)
        body = size * np.array([[1.0, 0.0], [-0.7, 0.65], [-0.7, -0.65]])
        cv2.fillPoly(picture, [_fixed(self._pixels(body, wide))], draw.INK, cv2.LINE_AA, 4)

    def _landmarks(self, picture: Picture, frame: Frame) -> None:
        """Of a log that holds point features instead of scans."""
        points = np.zeros((0, 2)) if frame.features is None else frame.features.points_robot
        if len(points):
            farthest = float(np.hypot(points[:, 0], points[:, 1]).max())
            self._reach = max(self._reach, min(1.05 * farthest, 80.0))
        self._rings(picture, wide=False)
        for x, y in _fixed(self._pixels(points, wide=False)).tolist():
            cv2.circle(picture, (x, y), round(4.0 * self._unit * 16), draw.BLUE, -1, cv2.LINE_AA, 4)
        self._robot(picture, wide=False)


def _fixed(pixels: Float) -> NDArray[np.int32]:
    return np.round(pixels * 16.0).astype(np.int32)

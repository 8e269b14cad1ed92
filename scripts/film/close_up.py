# SPDX-License-Identifier: Apache-2.0
"""The pane of the last centimetres: estimate, ellipse and truth, where the map shows one arrow."""

from __future__ import annotations

import math

import cv2
import numpy as np

from scripts.film.map_pane import draw_ellipse
from sim.view import draw
from sim.view.draw import Color, Picture, View
from sim.view.moment import SIGMAS
from slam import se2
from slam.frames import Float

_RADII_M = tuple(step * 10.0**k for k in range(-2, 3) for step in (1.0, 2.0, 5.0))


class CloseUp:
    """Paints what lies around the estimate, in the directions of the map pane.

    The circle of sight grows at once where the truth or the ellipse would leave it, and shrinks
    when a much smaller one would do.
    """

    def __init__(self, size: tuple[int, int], unit: float, color: Color) -> None:
        self._size, self._unit, self._color = size, unit, color
        self._radius = _RADII_M[0]

    def paint(self, T_view_robot: Float, T_view_truth: Float | None, covariance: Float) -> Picture:
        """A fresh picture; ``covariance`` (2, 2) m^2 in the frame of the view."""
        width, height = self._size
        reach = 1.15 * SIGMAS * math.sqrt(max(float(np.trace(covariance)), 0.0))
        if T_view_truth is not None:
            reach = max(reach, 1.25 * math.dist(T_view_robot[:2], T_view_truth[:2]))
        self._radius = _grown(self._radius, reach)
        x, y = T_view_robot[:2].tolist()
        view = View.fitting(
            (x - self._radius, y - self._radius, x + self._radius, y + self._radius), width, height
        )
        picture: Picture = np.full((height, width, 3), 255, np.uint8)
        for k in (1, 2, 3):
            x, y = round(width * k / 4), round(height * k / 4)
            cv2.line(picture, (x, 0), (x, height), draw.GRID, 1)
            cv2.line(picture, (0, y), (width, y), draw.GRID, 1)
        draw.scale_bar(picture, view, self._unit)
        if T_view_truth is not None:
            self._arrow(picture, view, T_view_truth, draw.GREEN)
        draw_ellipse(picture, view, T_view_robot, covariance, self._color)
        self._arrow(picture, view, T_view_robot, self._color)
        cv2.rectangle(picture, (0, 0), (width - 1, height - 1), draw.GRID, 1)
        return picture

    def _arrow(self, picture: Picture, view: View, T_view_robot: Float, color: Color) -> None:
        tip = np.array([[0.0, 0.0], [22.0 * self._unit / view.scale, 0.0]])
        ends = view.pixels(se2.transform(T_view_robot, tip))
        if not (np.abs(ends) < 1e4).all():
            return
        draw.polyline(picture, ends, color, max(1, round(2 * self._unit)))
        draw.dots(picture, ends[:1], [color], 4 * self._unit)


def off_by(error: Float, covariance: Float) -> str:
    """How far off, and how many of its own sigmas that is: ``1.7 cm off, 1.2 σ``.

    error (2,) m and covariance (2, 2) m^2 in one frame.
    """
    a, b, c = float(covariance[0, 0]), float(covariance[0, 1]), float(covariance[1, 1])
    determinant = a * c - b * b
    word = f"{draw.measured(math.hypot(error[0], error[1]))} off"
    if determinant <= 0.0:
        return word
    x, y = float(error[0]), float(error[1])
    squared = (c * x * x - 2.0 * b * x * y + a * y * y) / determinant
    return f"{word}, {math.sqrt(max(squared, 0.0)):.1f} σ"


def _grown(radius: float, reach: float) -> float:
    """The radius of sight for ``reach``: at once greater, smaller only by two steps or more."""
    wanted = next((r for r in _RADII_M if r >= reach), _RADII_M[-1])
    now = _RADII_M.index(radius)
    then = _RADII_M.index(wanted)
    return wanted if then > now or then < now - 1 else radius

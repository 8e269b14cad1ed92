# SPDX-License-Identifier: Apache-2.0
"""The pane of the map: what a SLAM believes, where it thinks it is, and where it truly is."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import cv2
import numpy as np
from numpy.typing import NDArray

from sim.view import draw
from sim.view.draw import Color, Picture, View
from sim.view.moment import SIGMAS, Path
from slam import se2
from slam.estimate import Landmarks, Raster
from slam.frames import Float

FOLLOW_M = 9.0  # around the path, in a view that follows it
STEP_M = 4.0  # such a view grows in steps: a sliding picture is hard to watch
STEP_SHARE = 0.1  # of a large view: so that it is drawn again a few dozen times, however large


def _activity_colors() -> Picture:
    """256 RGB colours from paper (nothing) over amber (an impression) to ink (certain)."""
    stops = np.array([0.0, 0.08, 0.35, 0.7, 1.0])
    colors = np.array(
        [draw.PAPER, (244, 226, 196), (226, 150, 60), (120, 52, 62), (24, 22, 34)], dtype=float
    )
    levels = np.linspace(0.0, 1.0, 256)
    table = np.stack([np.interp(levels, stops, colors[:, k]) for k in range(3)], axis=1)
    return table.astype(np.uint8)[:, None]


_COLORS = _activity_colors()


def raster_picture(raster: Raster, view: View, T_view_map: Float) -> Picture:
    """A map raster drawn into ``view``; ``T_view_map`` turns the map for display only."""
    levels = (np.fmax(raster.values, np.float32(0.0)) * np.float32(255.0)).astype(np.uint8)
    T = se2.compose(T_view_map, raster.T_map_origin)
    c, s = math.cos(T[2]), math.sin(T[2])
    k = raster.resolution_m * view.scale
    # a cell's centre lies at (i + 0.5) * resolution; pixels count from the top
    affine = np.array(
        [
            [c * k, -s * k, (T[0] - view.x) * view.scale + 0.5 * k * (c - s) - 0.5],
            [-s * k, -c * k, view.height - (T[1] - view.y) * view.scale - 0.5 * k * (s + c) - 0.5],
        ]
    )
    if k < 1.0:  # warpAffine samples points: widen first so that thin walls do not vanish
        n = math.ceil(1.0 / k)
        levels = cv2.dilate(levels, np.ones((n, n), np.uint8)).astype(np.uint8)
    warped = cv2.warpAffine(
        levels, affine, (view.width, view.height), flags=cv2.INTER_LINEAR, borderValue=0
    )
    picture: Picture = cv2.applyColorMap(warped, _COLORS).astype(np.uint8, copy=False)
    return picture


def draw_points(picture: Picture, view: View, points: Float, color: Color) -> None:
    """Scan end points as dots."""
    x, y = np.round(view.pixels(points)).astype(int).T
    inside = (x >= 0) & (x < view.width - 1) & (y >= 0) & (y < view.height - 1)
    for dx, dy in ((0, 0), (0, 1), (1, 0), (1, 1)):
        picture[y[inside] + dy, x[inside] + dx] = color


def draw_ellipse(
    picture: Picture,
    view: View,
    center_view: Float,
    covariance: NDArray[np.float64],
    color: Color,
    least: float = 3.0,
) -> None:
    """The position ellipse of ``SIGMAS``, its half axes ``least`` px or more so that it is seen."""
    values, vectors = np.linalg.eigh(covariance[:2, :2])
    axes = np.maximum(SIGMAS * np.sqrt(np.maximum(values, 0.0)) * view.scale, least)
    center = view.pixels(center_view[None, :2])[0]
    if not (np.abs(center) < 1e4).all() or axes.max() > 1e4:
        return
    angle = -math.degrees(math.atan2(vectors[1, 1], vectors[0, 1]))
    sizes = (2.0 * float(axes[1]), 2.0 * float(axes[0]))
    cv2.ellipse(picture, (tuple(center.tolist()), sizes, angle), color, 1, cv2.LINE_AA)


@dataclass(eq=False)
class MapPane:
    """Paints the map of one SLAM with trails, scan and ellipse.

    bounds  xmin, ymin, xmax, ymax (m) of the view, None: it follows the path
    """

    width: int
    height: int
    unit: float
    bounds: tuple[float, float, float, float] | None = None
    _under: Picture | None = None
    _view: View = field(default_factory=lambda: View(0.0, 0.0, 1.0, 1, 1))

    def refresh(
        self, raster: Raster | None, landmarks: Landmarks | None, path: Path, T_view_map: Float
    ) -> None:
        """Draw the map anew: a third of the cost of a frame, and it changes slowly."""
        view = self._view = View.fitting(self._bounds(path, T_view_map), self.width, self.height)
        if raster is None:
            under = np.full((self.height, self.width, 3), draw.PAPER, np.uint8)
        else:
            under = raster_picture(raster, view, T_view_map)
        self._under = under
        if landmarks is not None:
            turn = se2.rotation(float(T_view_map[2]))
            centers = se2.transform(T_view_map, landmarks.points_map)
            for center, covariance in zip(centers, landmarks.covariances, strict=True):
                turned, least = turn @ covariance @ turn.T, 3.0 * self.unit
                draw_ellipse(under, view, center, turned, draw.INK, least)
            inside = centers[(np.abs(view.pixels(centers)) < 1e4).all(axis=1)]
            draw.dots(under, view.pixels(inside), [draw.INK] * len(inside), 1.5 * self.unit)
        draw.scale_bar(under, view, self.unit)

    def paint(
        self,
        paths: list[tuple[Path, Color, int]],
        points_map: Float,
        covariance: NDArray[np.float64],
        T_view_map: Float,
    ) -> Picture:
        """A fresh picture. ``paths`` with their colour and width, the SLAM's own the last."""
        assert self._under is not None
        picture, view = self._under.copy(), self._view
        for path, color, width in paths:
            points = se2.transform(T_view_map, path.points())
            pose = se2.compose(T_view_map, path.pose)
            draw.polyline(picture, view.pixels(points), color, max(1, round(width * self.unit)))
            draw.robot(picture, view, pose, color)
        draw_points(picture, view, se2.transform(T_view_map, points_map), draw.BLUE)
        own, color, _ = paths[-1]
        turn = se2.rotation(float(T_view_map[2]))
        turned = turn @ covariance[:2, :2] @ turn.T
        draw_ellipse(picture, view, se2.compose(T_view_map, own.pose), turned, color)
        return picture

    def _bounds(self, path: Path, T_view_map: Float) -> tuple[float, float, float, float]:
        if self.bounds is not None:
            xmin, ymin, xmax, ymax = self.bounds
            return xmin - 0.4, ymin - 0.4, xmax + 0.4, ymax + 0.4
        points = se2.transform(T_view_map, path.points())
        low, high = points.min(axis=0) - FOLLOW_M, points.max(axis=0) + FOLLOW_M
        step = max(STEP_M, draw.round_down(STEP_SHARE * float((high - low).max())))
        low, high = np.floor(low / step) * step, np.ceil(high / step) * step
        return float(low[0]), float(low[1]), float(high[0]), float(high[1])

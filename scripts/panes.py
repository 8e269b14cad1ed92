# SPDX-License-Identifier: Apache-2.0
"""The panes a film is put together from: a map with trails and a running error chart."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from scripts import draw
from scripts.draw import Color, Picture
from slam import se2
from slam.frames import Float
from slam.system import Raster


def _activity_colors() -> Picture:
    """256 RGB colours from paper (nothing) over amber (an impression) to ink (certain)."""
    stops = np.array([0.0, 0.08, 0.35, 0.7, 1.0])
    colors = np.array(
        [draw.PAPER, (244, 226, 196), (226, 150, 60), (120, 52, 62), (24, 22, 34)], dtype=float
    )
    levels = np.linspace(0.0, 1.0, 256)
    table = np.stack([np.interp(levels, stops, colors[:, k]) for k in range(3)], axis=1)
    return table.astype(np.uint8)


_COLORS = _activity_colors()


@dataclass(frozen=True)
class View:
    """The part of the plane a pane shows: lower left corner (m), pixels per metre, size (px)."""

    x: float
    y: float
    scale: float
    width: int
    height: int

    @classmethod
    def fitting(cls, bounds: tuple[float, float, float, float], width: int, height: int) -> View:
        """The largest scale at which ``bounds`` (xmin, ymin, xmax, ymax) fit, centred."""
        xmin, ymin, xmax, ymax = bounds
        scale = min(width / (xmax - xmin), height / (ymax - ymin))
        return cls(
            x=(xmin + xmax) / 2.0 - width / scale / 2.0,
            y=(ymin + ymax) / 2.0 - height / scale / 2.0,
            scale=scale,
            width=width,
            height=height,
        )

    def pixels(self, points: Float) -> Float:
        """(n, 2) m to (n, 2) px, x right and y down."""
        out = np.empty((len(points), 2))
        out[:, 0] = (points[:, 0] - self.x) * self.scale
        out[:, 1] = self.height - (points[:, 1] - self.y) * self.scale
        return out


def raster_picture(raster: Raster, view: View, T_view_map: Float) -> Picture:
    """A map raster drawn into ``view``; ``T_view_map`` turns the map for display only."""
    levels = (np.nan_to_num(raster.values) * 255.0).astype(np.uint8)
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
    if k < 1.0:  # warpAffine samples points: blur first so that thin walls do not vanish
        levels = cv2.dilate(levels, np.ones((2, 2), np.uint8)).astype(np.uint8)
    warped = cv2.warpAffine(
        levels, affine, (view.width, view.height), flags=cv2.INTER_LINEAR, borderValue=0
    )
    picture: Picture = _COLORS[warped]
    return picture


def draw_trail(picture: Picture, view: View, poses: Sequence[Float], color: Color) -> None:
    """The path so far and a triangle for the robot now."""
    if not poses:
        return
    points = np.array([pose[:2] for pose in poses])
    draw.polyline(picture, view.pixels(points), color, 2)
    body = se2.transform(poses[-1], np.array([[0.28, 0.0], [-0.2, 0.19], [-0.2, -0.19]]))
    fixed = np.round(view.pixels(body) * 16.0).astype(np.int32)
    cv2.fillPoly(picture, [fixed], color, cv2.LINE_AA, 4)


def draw_points(picture: Picture, view: View, points: Float, color: Color) -> None:
    """Scan end points as dots."""
    pixels = np.round(view.pixels(points)).astype(int)
    inside = (
        (pixels[:, 0] >= 0)
        & (pixels[:, 0] < view.width - 1)
        & (pixels[:, 1] >= 0)
        & (pixels[:, 1] < view.height - 1)
    )
    for dx in (0, 1):
        for dy in (0, 1):
            picture[pixels[inside, 1] + dy, pixels[inside, 0] + dx] = color


def draw_ellipse(
    picture: Picture, view: View, T_view_robot: Float, covariance: NDArray[np.float64], color: Color
) -> None:
    """The 3-sigma position ellipse, drawn no smaller than 3 px so that it can be seen."""
    values, vectors = np.linalg.eigh(covariance[:2, :2])
    axes = np.maximum(3.0 * np.sqrt(np.maximum(values, 0.0)) * view.scale, 3.0)
    center = view.pixels(T_view_robot[None, :2])[0]
    angle = -math.degrees(math.atan2(vectors[1, 1], vectors[0, 1]))
    cv2.ellipse(
        picture,
        (tuple(center.tolist()), (2.0 * float(axes[1]), 2.0 * float(axes[0])), angle),
        color,
        1,
        cv2.LINE_AA,
    )


def error_chart(
    series: Mapping[str, tuple[Sequence[float], Sequence[float], Color]],
    duration_s: float,
    size: tuple[int, int],
) -> Picture:
    """Position errors (m, log scale) over time; ``series``: name -> (seconds, errors, colour)."""
    width, height = size
    duration_s = max(duration_s, 1.0)
    picture: Picture = np.full((height, width, 3), draw.PAPER, np.uint8)
    left, right, top, bottom = 58, 26, 26, 24
    worst = max((max(errors) for _, errors, _ in series.values() if errors), default=1.0)
    low, high = -3.0, (2.0 if worst > 12.0 else 1.0)  # 1 mm .. 10 or 100 m
    names = ("1 mm", "1 cm", "10 cm", "1 m", "10 m", "100 m")[: round(high - low) + 1]
    box_w, box_h = width - left - right, height - top - bottom
    for decade, label in enumerate(names, -3):
        y = top + round(box_h * (high - decade) / (high - low))
        cv2.line(picture, (left, y), (width - right, y), draw.GRID, 1)
        draw.text(picture, label, (8, y - 7), 11, draw.MUTED)
    step = 10.0 if duration_s <= 130.0 else 10.0 ** math.floor(math.log10(duration_s / 2.0))
    for k in range(int(duration_s / step) + 1):
        x = left + round(box_w * k * step / duration_s)
        cv2.line(picture, (x, top), (x, height - bottom), draw.GRID, 1)
        draw.text(picture, f"{k * step:.0f} s", (x - 8, height - bottom + 6), 11, draw.MUTED)
    x = draw.text(picture, "position error, unaligned", (8, 6), 13, draw.INK, bold=True) + 16
    for name, (seconds, errors, color) in series.items():
        x = draw.text(picture, f"{name} {_length(errors[-1])}" if errors else name, (x, 7), 12,
                      color, bold=True) + 16  # fmt: skip
        if errors:
            level = np.log10(np.maximum(np.asarray(errors), 1e-3))
            level = np.clip(level, low, high)
            pixels = np.stack(
                [
                    left + box_w * np.asarray(seconds) / duration_s,
                    top + box_h * (high - level) / (high - low),
                ],
                axis=1,
            )
            draw.polyline(picture, pixels, color, 2)
    return picture


def _length(meters: float) -> str:
    return f"{meters:.2f} m" if meters >= 1.0 else f"{meters * 100.0:.1f} cm"

# SPDX-License-Identifier: Apache-2.0
"""The pane of the map: what a SLAM believes, where it thinks it is, and where it truly is."""

from __future__ import annotations

import math
from array import array
from dataclasses import dataclass, field

import cv2
import numpy as np
from numpy.typing import NDArray

from scripts.film import draw
from scripts.film.draw import Color, Picture
from scripts.film.map_tiles import LevelMap, levels_of
from slam import se2
from slam.frames import Float
from slam.system import Raster

SIGMAS = 3.0  # of the ellipses
MAX_TRAIL = 1500  # points of a trail as drawn
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


class Trail:
    """Where something has been, (x, y) m in the map frame, and its pose now."""

    def __init__(self) -> None:
        self._xy = array("d")
        self.pose: Float = np.zeros(3)

    def add(self, T_map_robot: Float) -> None:
        """The next pose."""
        self._xy.extend(T_map_robot[:2].tolist())
        self.pose = T_map_robot

    def __len__(self) -> int:
        return len(self._xy) // 2

    def points(self) -> Float:
        """(k, 2) m: all of it in at most ``MAX_TRAIL`` points, the last among them."""
        xy = np.array(self._xy).reshape(-1, 2)
        step = max(1, -(-len(xy) // MAX_TRAIL))
        return np.vstack([xy[:-1:step], xy[-1:]])


def raster_picture(raster: Raster | LevelMap, view: View, T_view_map: Float) -> Picture:
    """A map raster drawn into ``view``; ``T_view_map`` turns the map for display only."""
    raster = levels_of(raster) if isinstance(raster, Raster) else raster
    levels = raster.levels
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


def draw_trail(
    picture: Picture, view: View, points: Float, T_view_robot: Float, color: Color, thickness: int
) -> None:
    """The path so far and a triangle for the robot now, both in the frame of the view."""
    draw.polyline(picture, view.pixels(points), color, thickness)
    size = max(1.0, 9.0 / (0.28 * view.scale))  # never smaller than 9 px
    body = np.array([[0.28, 0.0], [-0.2, 0.19], [-0.2, -0.19]]) * size
    fixed = np.round(view.pixels(se2.transform(T_view_robot, body)) * 16.0).astype(np.int32)
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
    """The position ellipse of ``SIGMAS``, drawn no smaller than 3 px so that it can be seen."""
    values, vectors = np.linalg.eigh(covariance[:2, :2])
    axes = np.maximum(SIGMAS * np.sqrt(np.maximum(values, 0.0)) * view.scale, 3.0)
    center = view.pixels(T_view_robot[None, :2])[0]
    if not (np.abs(center) < 1e4).all() or axes.max() > 1e4:
        return
    angle = -math.degrees(math.atan2(vectors[1, 1], vectors[0, 1]))
    cv2.ellipse(
        picture,
        (tuple(center.tolist()), (2.0 * float(axes[1]), 2.0 * float(axes[0])), angle),
        color,
        1,
        cv2.LINE_AA,
    )


def scale_bar(picture: Picture, view: View, unit: float) -> None:
    """A length of 1, 2 or 5 times a power of ten in a corner: the lower left one, or the first of
    the others in which nothing is drawn."""
    meters = draw.round_down(view.width / view.scale / 4.0)
    word, size, thick = draw.length(meters), round(12 * unit), max(1, round(3 * unit))
    margin, bar, above = round(12 * unit), round(meters * view.scale), round(18 * unit)
    wide = max(bar, draw.text_width(word, size))
    places = [
        (x, y)
        for y in (view.height - margin, margin + above)
        for x in (margin, view.width - margin - wide)
    ]
    free = (
        (x, y)
        for x, y in places
        if (picture[y - above : y + thick, x : x + wide] == draw.PAPER).all()
    )
    x, y = next(free, places[0])
    picture[y : y + thick, x : x + bar] = draw.INK
    draw.text(picture, word, (x, y - above), size, draw.INK)


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
        self,
        raster: Raster | LevelMap | None,
        landmarks: Float | None,
        path: Trail,
        T_view_map: Float,
    ) -> None:
        """Draw the map anew: a third of the cost of a frame, and it changes slowly.

        landmarks  optional (n, 5) x, y, half axes (m), direction (rad) in the map frame
        """
        self._view = self.view(path, T_view_map)
        if raster is None:
            self._under = np.full((self.height, self.width, 3), draw.PAPER, np.uint8)
        else:
            self._under = raster_picture(raster, self._view, T_view_map)
        if landmarks is not None:
            self._draw_landmarks(self._under, landmarks, T_view_map)
        scale_bar(self._under, self._view, self.unit)

    def view(self, path: Trail, T_view_map: Float) -> View:
        """What the pane shows next."""
        return View.fitting(self._bounds(path, T_view_map), self.width, self.height)

    def paint(
        self,
        trails: list[tuple[Trail, Color, int]],
        points_map: Float,
        covariance: NDArray[np.float64],
        T_view_map: Float,
    ) -> Picture:
        """A fresh picture. ``trails`` with their colour and width, the SLAM's own the last."""
        assert self._under is not None
        picture, view = self._under.copy(), self._view
        for trail, color, width in trails:
            points = se2.transform(T_view_map, trail.points())
            pose = se2.compose(T_view_map, trail.pose)
            draw_trail(picture, view, points, pose, color, max(1, round(width * self.unit)))
        draw_points(picture, view, se2.transform(T_view_map, points_map), draw.BLUE)
        own, color, _ = trails[-1]
        turn = se2.rotation(float(T_view_map[2]))
        turned = turn @ covariance[:2, :2] @ turn.T
        draw_ellipse(picture, view, se2.compose(T_view_map, own.pose), turned, color)
        return picture

    def _draw_landmarks(self, picture: Picture, landmarks: Float, T_view_map: Float) -> None:
        """A dot for each, and its ellipse where that is larger."""
        view = self._view
        centers = view.pixels(se2.transform(T_view_map, landmarks[:, :2]))
        turns = -np.degrees(landmarks[:, 4] + T_view_map[2])
        axes = np.clip(2.0 * landmarks[:, 2:4] * view.scale, 6.0 * self.unit, 1e4)
        for center, sizes, turn in zip(
            centers.tolist(), axes.tolist(), turns.tolist(), strict=True
        ):
            if max(map(abs, center)) < 1e4:
                cv2.ellipse(picture, (center, sizes, turn), draw.INK, 1, cv2.LINE_AA)
                at = (round(center[0] * 16.0), round(center[1] * 16.0))
                cv2.circle(picture, at, round(24 * self.unit), draw.INK, -1, cv2.LINE_AA, 4)

    def _bounds(self, path: Trail, T_view_map: Float) -> tuple[float, float, float, float]:
        if self.bounds is not None:
            xmin, ymin, xmax, ymax = self.bounds
            return xmin - 0.4, ymin - 0.4, xmax + 0.4, ymax + 0.4
        points = se2.transform(T_view_map, path.points())
        low, high = points.min(axis=0) - FOLLOW_M, points.max(axis=0) + FOLLOW_M
        step = max(STEP_M, draw.round_down(STEP_SHARE * float((high - low).max())))
        low, high = np.floor(low / step) * step, np.ceil(high / step) * step
        return float(low[0]), float(low[1]), float(high[0]), float(high[1])

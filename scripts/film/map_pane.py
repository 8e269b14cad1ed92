# SPDX-License-Identifier: Apache-2.0
"""The panes of the map, of its last centimetres, and of a log's scan."""

import math
from dataclasses import dataclass, field

import cv2
import numpy as np
from numpy.typing import NDArray

from sim.view import draw
from sim.view.draw import Color, Picture, View
from sim.view.moment import SIGMAS, Path
from sim.view.scans import FAN, beams
from slam import se2
from slam.estimate import Landmarks, Raster
from slam.frames import Float, Frame

FOLLOW_M = 9.0  # around the path, in a view that follows it
STEP_M = 4.0  # such a view grows in steps: a sliding picture is hard to watch
STEP_SHARE = 0.1  # of a large view: so that it is drawn again a few dozen times, however large
_RADII_M = tuple(step * 10.0**k for k in range(-2, 3) for step in (1.0, 2.0, 5.0))
MOST_M = 80.0  # of what is shown
_FRONT_UP = np.array([0.0, 0.0, math.pi / 2.0])


# 256 RGB colours from paper (nothing) over amber (an impression) to ink (certain).
_STOPS = {
    0.0: draw.PAPER, 0.08: (244, 226, 196), 0.35: (226, 150, 60), 0.7: (120, 52, 62),
    1.0: (24, 22, 34),
}  # fmt: skip
COLORS = np.stack(
    [
        np.interp(np.linspace(0.0, 1.0, 256), [*_STOPS], one)
        for one in zip(*_STOPS.values(), strict=True)
    ],
    axis=1,
).astype(np.uint8)[:, None]


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
    picture: Picture = cv2.applyColorMap(warped, COLORS).astype(np.uint8, copy=False)
    return picture


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
        # scan end points as dots
        x, y = np.round(view.pixels(se2.transform(T_view_map, points_map))).astype(int).T
        inside = (x >= 0) & (x < view.width - 1) & (y >= 0) & (y < view.height - 1)
        for dx, dy in ((0, 0), (0, 1), (1, 0), (1, 1)):
            picture[y[inside] + dy, x[inside] + dx] = draw.BLUE
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


def _grown(radius: float, reach: float) -> float:
    """The radius of sight for ``reach``: at once greater, smaller only by two steps or more."""
    wanted = next((r for r in _RADII_M if r >= reach), _RADII_M[-1])
    now = _RADII_M.index(radius)
    then = _RADII_M.index(wanted)
    return wanted if then > now or then < now - 1 else radius


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

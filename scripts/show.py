# SPDX-License-Identifier: Apache-2.0
"""The film of a run: the world, what the SLAM made of it, and how far off it was."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from scripts import draw
from scripts.draw import Color, Picture
from scripts.film import Pane, compose
from scripts.panes import (
    View,
    draw_ellipse,
    draw_points,
    draw_trail,
    error_chart,
    raster_picture,
)
from slam import se2
from slam.frames import Float, Frame, Scan
from slam.replay import Replay, Track
from slam.seen import SeenSpace

SEEN_EVERY_NS = 200_000_000  # the areas of neighbouring scans overlap

Painter = Callable[[Frame, tuple[int, int]], Picture]
"""Paints the true world at a frame into (width, height)."""

_TRACK_COLORS: tuple[Color, ...] = (draw.RED, draw.ORANGE, draw.BLUE, (122, 63, 176))


@dataclass(eq=False)
class Show:
    """Composes film frames of a replay.

    primary   the track whose map is shown; odometry is always drawn orange
    bounds    xmin, ymin, xmax, ymax (m) of what the map pane shows, None: follows the map
    world     paints the world from above, None for logs (nobody saw that world)
    camera    paints the 3D view, None without GL
    """

    replay: Replay
    primary: str
    title: str
    duration_s: float
    bounds: tuple[float, float, float, float] | None = None
    world: Painter | None = None
    camera: Painter | None = None
    truth_name: str = "truth"
    last_points_map: Float = field(default_factory=lambda: np.zeros((0, 2)))
    seen: SeenSpace = field(default_factory=SeenSpace)
    _seen_ns: int = -SEEN_EVERY_NS
    _errors: dict[str, tuple[list[float], list[float]]] = field(default_factory=dict)
    _trails: dict[str, list[Float]] = field(default_factory=dict)
    _first: tuple[int, Float | None] | None = None

    def color(self, name: str) -> Color:
        """The colour a track is drawn in."""
        if name == "odometry":
            return draw.ORANGE
        others = [other for other in self.replay.tracks if other != "odometry"]
        spare = [c for c in _TRACK_COLORS if c != draw.ORANGE]
        return spare[others.index(name) % len(spare)]

    def note(self, frame: Frame) -> None:
        """Remember this frame's poses and errors; call for every frame, painted or not."""
        if self._first is None:
            self._first = (frame.stamp_ns, frame.truth)
        start_ns, first_truth = self._first
        seconds = (frame.stamp_ns - start_ns) / 1e9
        truth_map = None
        if frame.truth is not None and first_truth is not None:
            truth_map = se2.between(first_truth, frame.truth)
            self._trails.setdefault("truth", []).append(truth_map)
        if frame.scan is not None:
            T_map_robot = self._track().estimates[-1].T_map_robot
            self.last_points_map = se2.transform(T_map_robot, points_robot(frame.scan))
            if frame.stamp_ns - self._seen_ns >= SEEN_EVERY_NS:
                self.seen.add(frame.scan, T_map_robot)
                self._seen_ns = frame.stamp_ns
        for name, track in self.replay.tracks.items():
            T_map_robot = track.estimates[-1].T_map_robot
            self._trails.setdefault(name, []).append(T_map_robot)
            times, errors = self._errors.setdefault(name, ([], []))
            if truth_map is not None:
                times.append(seconds)
                gap = T_map_robot - truth_map
                errors.append(math.hypot(gap[0], gap[1]))

    def paint(self, frame: Frame) -> Picture:
        """The film frame at ``frame``: call ``note`` first."""
        seconds = (frame.stamp_ns - self._first[0]) / 1e9 if self._first else 0.0
        parts: list[tuple[Pane, Picture]] = []
        left = self._left(frame, parts)
        pane = Pane(f"map of {self.primary}: activities, scan, trails", left, 66, 1264 - left, 452)
        parts.append((pane, self._map(frame, pane)))
        chart = Pane("", left, 536, 1264 - left, 170)
        parts.append((chart, self._chart(chart)))
        return compose(f"{self.title}    {seconds:5.1f} s", parts)

    def _left(self, frame: Frame, parts: list[tuple[Pane, Picture]]) -> int:
        """The panes that show the truth; returns where the right column starts."""
        boxes = {(True, True): [(66, 300), (394, 312)], (False, True): [(66, 640)],
                 (True, False): [(66, 640)], (False, False): []}  # fmt: skip
        slots = boxes[(self.camera is not None, self.world is not None)]
        painters = [("3D camera", self.camera), ("the world from above (truth)", self.world)]
        for (title, painter), (top, height) in zip(
            [(t, p) for t, p in painters if p is not None], slots, strict=True
        ):
            pane = Pane(title, 16, top, 480, height)
            parts.append((pane, painter(frame, (pane.width, pane.height))))
        return 512 if slots else 16

    def _track(self) -> Track:
        return self.replay.tracks[self.primary]

    def _map(self, frame: Frame, pane: Pane) -> Picture:
        T_view_map = np.zeros(3)
        first_truth = self._first[1] if self._first else None
        if self.bounds is not None and first_truth is not None:
            T_view_map = first_truth  # the map drawn the way the world lies; display only
        raster = self._track().map()
        view = View.fitting(self._bounds(T_view_map), pane.width, pane.height)
        if raster is None:
            picture: Picture = np.full((pane.height, pane.width, 3), draw.PAPER, np.uint8)
        else:
            picture = raster_picture(raster, view, T_view_map)
        for name in [n for n in self._trails if n != self.primary] + [self.primary]:
            trail = [se2.compose(T_view_map, pose) for pose in self._trails[name][::3]]
            trail.append(se2.compose(T_view_map, self._trails[name][-1]))
            draw_trail(picture, view, trail, draw.GREEN if name == "truth" else self.color(name))
        estimate = self._track().estimates[-1]
        T_view_robot = se2.compose(T_view_map, estimate.T_map_robot)
        if frame.scan is not None:
            points = se2.transform(T_view_robot, points_robot(frame.scan))
            draw_points(picture, view, points, draw.BLUE)
        turn = se2.rotation(float(T_view_map[2]))
        covariance = turn @ estimate.covariance[:2, :2] @ turn.T
        draw_ellipse(picture, view, T_view_robot, covariance, self.color(self.primary))
        self._scale_bar(picture, view)
        return picture

    def _bounds(self, T_view_map: Float) -> tuple[float, float, float, float]:
        if self.bounds is not None:
            xmin, ymin, xmax, ymax = self.bounds
            return xmin - 0.4, ymin - 0.4, xmax + 0.4, ymax + 0.4
        trail = np.array([pose[:2] for pose in self._trails[self.primary]])
        low, high = trail.min(axis=0) - 9.0, trail.max(axis=0) + 9.0
        return float(low[0]), float(low[1]), float(high[0]), float(high[1])

    def _chart(self, pane: Pane) -> Picture:
        stride = max(1, len(next(iter(self._errors.values()))[0]) // 1200)
        series = {
            name: (times[::stride], errors[::stride], self.color(name))
            for name, (times, errors) in self._errors.items()
        }
        return error_chart(series, self.duration_s, (pane.width, pane.height))

    @staticmethod
    def _scale_bar(picture: Picture, view: View) -> None:
        meters = 10.0 ** math.floor(math.log10(view.width / view.scale / 4.0))
        y, x = view.height - 14, 12
        picture[y : y + 3, x : x + round(meters * view.scale)] = draw.INK
        draw.text(picture, f"{meters:g} m", (x, y - 18), 12, draw.INK)


def points_robot(scan: Scan) -> Float:
    """(k, 2) m, end points of the valid beams in the robot frame (not de-skewed)."""
    valid = scan.valid
    ranges, angles = scan.ranges[valid].astype(np.float64), scan.spec.angles[valid]
    points = np.stack([ranges * np.cos(angles), ranges * np.sin(angles)], axis=1)
    return se2.transform(scan.spec.T_robot_laser, points)

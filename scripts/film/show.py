# SPDX-License-Identifier: Apache-2.0
"""The film of a run: the world, what a SLAM made of it, and how far off it was.

show = Show(moments=Moments(replay), stage=Stage(labelled=False), title="intel.log", ...)
for frame in replay.run(stream):
    show.note(frame)
    picture = show.paint(frame)        # whenever one is wanted
"""

from dataclasses import dataclass, field
from functools import cached_property

import cv2
import numpy as np

from scripts.film import panes
from scripts.film.chart import UNSURE, ErrorChart, Series
from scripts.film.encode import SIZE, Pace, Size
from scripts.film.map_pane import CloseUp, MapPane
from scripts.film.panes import Box, Layout
from scripts.film.stage import Stage
from sim.events import Event
from sim.view import draw
from sim.view.draw import Picture
from sim.view.moment import DOUBTS, SIGMAS, Moments, Shown, short, verdict_of
from sim.view.scans import LEGEND
from slam import se2
from slam.estimate import Raster
from slam.frames import Float, Frame, Scan
from slam.frontend.seen_space import SeenSpace
from slam.maps import OCCUPIED_THRESHOLD
from slam.replay import Replay, Track
from slam.system import MovingMap

SAME_DOUBT_S = 0.5  # doubts so near each other are one
SEEN_EVERY_S = 0.2  # the areas of neighbouring scans overlap
MOST_MAPS = 60  # big ones, of a log
STRAY = 0.002  # share of what stands, on each side, that a poster may leave out
FRESH_S = 0.1  # of film: so often are the map and the 3D view drawn again


@dataclass(eq=False, kw_only=True)
class Show:
    """Composes film frames of a replay.

    moments     of the replay: its primary track is the one whose map and claims are shown
    stage       what is known of the true world
    title       scene, dynamism and seed, or the log's name
    duration_s  of the run;   pace  of the film, which shows a part of it
    seen        the space that scans have swept;   series  errors by track
    unsure      when the primary track did not trust itself
    shown       the last moment that was noted
    """

    moments: Moments
    stage: Stage
    title: str
    duration_s: float
    pace: Pace = field(default_factory=Pace)
    size: Size = SIZE
    seen: SeenSpace = field(default_factory=SeenSpace)
    series: dict[str, Series] = field(default_factory=dict)
    unsure: list[Event] = field(default_factory=list)
    shown: Shown | None = None
    _seen_s: float = -SEEN_EVERY_S
    _scans: list[tuple[int, Scan]] = field(default_factory=list)  # that were seen, by frame
    _moved: int = 0

    @cached_property
    def panes(self) -> "_Panes":
        """Its painters, made with the first picture."""
        return _Panes(self)

    @property
    def replay(self) -> Replay:
        """What is shown."""
        return self.moments.replay

    @property
    def primary(self) -> str:
        """The filmed system's name."""
        return self.moments.primary

    def track(self) -> Track:
        """What the filmed system has estimated so far."""
        return self.moments.track

    @property
    def last_points_map(self) -> Float:
        """(k, 2) m, what the last scan saw where the primary track believes it was."""
        if self.shown is None or self.shown.frame.scan is None:
            return np.zeros((0, 2))
        return self.shown.scan_map(self.shown.own.T_map_robot)[0]

    def note(self, frame: Frame) -> Shown:
        """Remember this frame's poses and errors; call for every frame, painted or not."""
        self.shown = shown = self.moments.note(frame, self.stage.placed)
        here = shown.own
        if frame.scan is not None and shown.seconds - self._seen_s >= SEEN_EVERY_S - 1e-9:
            self._seen_s = shown.seconds
            self.seen.add(frame.scan, here.T_map_robot)
            if isinstance(self.track().system, MovingMap):
                self._scans.append((shown.number, frame.scan))
        for name in self.replay.tracks:
            self.series.setdefault(name, Series()).add(shown, name)
        if verdict_of(here) in DOUBTS:
            start_s = end_s = shown.seconds
            if self.unsure and end_s - self.unsure[-1].end_s < SAME_DOUBT_S:
                start_s = self.unsure.pop().start_s
            doubt = Event(kind=UNSURE, name="", start_s=start_s, end_s=end_s, seen=True)
            self.unsure.append(doubt)
        if self._moved != self.moments.moved:  # what was seen lies elsewhere on the map now
            self._moved, self.seen = self.moments.moved, SeenSpace()
            for (_, scan), pose in zip(self._scans, self._poses(), strict=True):
                self.seen.add(scan, pose)
        return shown

    def paint(self, frame: Frame) -> Picture:
        """The film frame at ``frame``: call ``note`` first. Pictures share no memory."""
        return self.panes.paint(frame)

    def poster(self, raster: Raster) -> Picture | None:
        """The last frame, its map framed on what stands in ``raster``; None where the whole room
        is in view anyway, or nothing stands."""
        rows, columns = np.nonzero(raster.values > OCCUPIED_THRESHOLD)
        if self.shown is None or self.stage.bounds or not len(rows):
            return None
        step, origin = raster.resolution_m, raster.T_map_origin
        # without what few beams met through windows
        xmin, xmax = np.quantile(columns, (STRAY, 1.0 - STRAY)) * step + origin[0]
        ymin, ymax = np.quantile(rows, (STRAY, 1.0 - STRAY)) * step + origin[1]
        bounds = float(xmin), float(ymin), float(xmax) + step, float(ymax) + step
        return self.panes.framed(self.shown.frame, bounds)

    def vignette(self, frame: Frame) -> Picture:
        """The scan above the map, without words: what a strip is made of."""
        return self.panes.vignette(self.paint(frame))

    def _poses(self) -> list[Float]:
        """Where the scans that were seen lie in the map by now."""
        system = self.track().system
        assert isinstance(system, MovingMap)
        poses = system.poses_in_map()
        return [poses[number] for number, _ in self._scans]


class _Panes:
    """The painters of one layout, and the part of the frame that stays."""

    def __init__(self, show: Show) -> None:
        self._show, stage, pace = show, show.stage, show.pace
        self._more = panes.registered()
        layout = Layout.of(show.size, camera=stage.camera, more=len(self._more))
        self._layout, unit = layout, layout.unit
        stage.open(layout)
        self._map = MapPane(*layout.map.size, unit, stage.bounds)
        self._close = CloseUp(layout.close.size, unit, show.moments.colors[show.primary])
        span = (pace.from_s, max(min(pace.to_s, show.duration_s), pace.from_s + 1.0))
        self._chart = ErrorChart(
            layout.chart.size, unit, span_s=span, primary=show.primary, colors=show.moments.colors,
            lanes=[*stage.lanes, UNSURE],
        )  # fmt: skip
        self._base = self._still()
        self._fresh_at = -np.inf
        self._camera: Picture | None = None

    def paint(self, frame: Frame) -> Picture:
        show, layout, moments = self._show, self._layout, self._show.moments
        shown, T_view_map, colors = show.shown, self._T_view_map(), moments.colors
        assert shown is not None
        fresh = (
            show.pace.fps * FRESH_S <= 1.0  # scans come when they come: some early by a part
            or abs(shown.seconds - self._fresh_at) >= FRESH_S * show.pace.speed - 1e-6
        )
        if fresh:
            self._fresh_at = shown.seconds
            raster, landmarks = moments.look(big_rest_s=show.duration_s / MOST_MAPS)
            self._map.refresh(raster, landmarks, moments.paths[show.primary], T_view_map)
        canvas = self._base.copy()
        self._headline(canvas, shown.seconds)
        drawn = [
            (path, colors[name], 4 if name == "truth" else 2)
            for name, path in sorted(moments.paths.items(), key=lambda one: one[0] == show.primary)
            if name != "truth" or shown.truth_map is not None
        ]
        covariance = shown.own.covariance
        picture = self._map.paint(drawn, show.last_points_map, covariance, T_view_map)
        _put(canvas, layout.map, picture)
        _put(canvas, layout.scan, show.stage.scan(frame))
        if layout.camera is not None:
            if fresh or self._camera is None:
                self._camera = show.stage.view()
            _put(canvas, layout.camera, self._camera)
        events = [*show.stage.events(), *show.unsure]
        _put(canvas, layout.chart, self._chart.paint(show.series, events))
        self._close_up(canvas, shown, covariance)
        for title, box in zip(self._more, layout.more, strict=True):
            _put(canvas, box, panes.painted(title, show, frame, box.size))
        return canvas

    def _T_view_map(self) -> Float:
        """The map drawn the way the world lies, where that is known; for display only."""
        T = self._show.moments.T_world_map
        return T if T is not None and self._show.stage.bounds is not None else np.zeros(3)

    def framed(self, frame: Frame, bounds: tuple[float, float, float, float]) -> Picture:
        """A picture whose map shows that part of the plane, m."""
        self._map.bounds, self._fresh_at = bounds, -np.inf
        return self.paint(frame)

    def vignette(self, whole: Picture) -> Picture:
        """Two panes of a painted frame, one above the other, equally wide."""
        parts = []
        width = self._layout.scan.width
        for box in (self._layout.scan, self._layout.map):
            part = whole[box.y : box.y + box.height, box.x : box.x + box.width]
            height = round(box.height * width / box.width)
            parts.append(cv2.resize(part, (width, height), interpolation=cv2.INTER_AREA))
        return np.vstack(parts)

    def _close_up(self, canvas: Picture, shown: Shown, covariance: Float) -> None:
        """The last centimetres, and how far off in words."""
        T, box, unit = self._T_view_map(), self._layout.close, self._layout.unit
        own, turn = shown.own.T_map_robot, se2.rotation(float(T[2]))
        truth = None if shown.truth_map is None else se2.compose(T, shown.truth_map)
        turned = turn @ covariance[:2, :2] @ turn.T
        _put(canvas, box, self._close.paint(se2.compose(T, own), truth, turned))
        if shown.truth_map is not None:
            at = (box.x, box.y + box.height + round(6 * unit))
            words, color = shown.told()[1]
            draw.text(canvas, words, at, round(13 * unit), color, bold=True)

    def _headline(self, canvas: Picture, seconds: float) -> None:
        show, unit = self._show, self._layout.unit
        at = (self._time_x, round(12 * unit))
        draw.text(canvas, f"{seconds:.1f} s", at, round(17 * unit), draw.INK, bold=True)
        if show.pace.speed != 1.0:
            wide = draw.text_width(f"{show.duration_s:.1f} s", round(17 * unit), bold=True)
            at = (at[0] + wide + round(10 * unit), round(15 * unit))
            draw.text(canvas, f"×{show.pace.speed:.3g}", at, round(13 * unit), draw.MUTED)

    def _still(self) -> Picture:
        """Paper, headline, titles and legends."""
        show, layout = self._show, self._layout
        unit, (width, height) = layout.unit, layout.size
        canvas: Picture = np.full((height, width, 3), draw.PAPER, np.uint8)
        size = round(17 * unit)
        words = f"{show.title} · {short(show.primary)}"
        x = draw.text(canvas, words, (round(16 * unit), round(12 * unit)), size, bold=True)
        self._time_x = x + round(24 * unit)
        self._key(canvas)
        titles = [
            (layout.map, f"map of {short(show.primary)}: {self._holds()}scan, trails"),
            (layout.close, f"close-up, {SIGMAS:g} σ ellipse"),
        ]
        titles += list(zip(layout.more, self._more, strict=True))
        if layout.camera is not None:
            titles.append((layout.camera, "3D camera"))
        labelled = show.stage.labelled
        titles.append((layout.scan, "scan:" if labelled else "scan, the robot's front up"))
        for box, title in titles:
            at = (box.x, box.y - round(20 * unit))
            end = draw.text(canvas, title, at, round(13 * unit), draw.MUTED)
            if box is layout.scan and labelled:
                x = end + round(10 * unit)
                for word, color in LEGEND:
                    radius = max(2, round(4 * unit))
                    middle = [[x + radius, at[1] + round(8 * unit)]]
                    draw.dots(canvas, np.array(middle), [color], radius)
                    x = draw.text(canvas, word, (x + round(13 * unit), at[1]), round(12 * unit))
                    x += round(11 * unit)
        return canvas

    def _holds(self) -> str:
        """What the map of the primary track is made of, where that is known."""
        track = self._show.track()
        if track.landmarks() is not None:
            return f"landmarks ({SIGMAS:g} σ), "
        words = track.cells_hold()
        return f"{words}, " if words else ""

    def _key(self, canvas: Picture) -> None:
        """Which colour is whose, from the right."""
        show, unit = self._show, self._layout.unit
        size, x = round(13 * unit), self._layout.size[0] - round(16 * unit)
        for word, color in reversed(show.moments.named()):
            x -= draw.text_width(word, size, bold=True)
            draw.text(canvas, word, (x, round(14 * unit)), size, color, bold=True)
            bar, y = round(18 * unit), round(21 * unit)
            canvas[y : y + round(3 * unit), x - bar - round(6 * unit) : x - round(6 * unit)] = color
            x -= bar + round(24 * unit)


def _put(canvas: Picture, box: Box, picture: Picture) -> None:
    canvas[box.y : box.y + box.height, box.x : box.x + box.width] = picture

# SPDX-License-Identifier: Apache-2.0
"""The film of a run: the world, what a SLAM made of it, and how far off it was.

show = Show(replay=replay, primary="shunting", stage=LogStage(), title="intel.log", ...)
for frame in replay.run(stream):
    show.note(frame)
    picture = show.paint(frame)        # whenever one is wanted
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import cv2
import numpy as np

from scripts.film import draw, panes
from scripts.film.changed import Changed
from scripts.film.chart import Bar, ErrorChart, Series
from scripts.film.close_up import CloseUp, off_by
from scripts.film.draw import Color, Picture
from scripts.film.encode import SIZE, Pace, Size
from scripts.film.layout import Box, Layout
from scripts.film.map_pane import SIGMAS, MapPane, Trail
from scripts.film.map_tiles import LevelMap, MapTiles
from scripts.film.scan_pane import LEGEND, legend, points_robot
from scripts.film.view import Stage
from slam import se2
from slam.estimate import Raster
from slam.frames import NS_PER_S, Float, Frame, Scan
from slam.frontend.seen_space import SeenSpace
from slam.maps import OCCUPIED_THRESHOLD
from slam.replay import Replay, Track
from slam.system import MapsInParts, MovingMap

SEEN_EVERY_NS = 200_000_000  # the areas of neighbouring scans overlap
MOST_MAPS = 60  # whole ones, of a log
STRAY = 0.002  # share of what stands, on each side, that a poster may leave out
FRESH_S = 0.1  # of film: so often are the map and the 3D view drawn again


@dataclass(eq=False, kw_only=True)
class Show:
    """Composes film frames of a replay.

    primary     the track whose map and claims are shown; odometry is always drawn orange
    stage       what is known of the true world
    title       scene, dynamism and seed, or the log's name
    duration_s  of the run;   pace  of the film, which shows a part of it
    seen        the space that scans have swept; series, trails  errors and paths by track;
                unsure  when the primary track did not trust itself
    changed     where the map may have changed since it was drawn last
    filmed      whether ``paint`` will be called
    """

    replay: Replay
    primary: str
    stage: Stage
    title: str
    duration_s: float
    truth_name: str = "truth"
    pace: Pace = field(default_factory=Pace)
    size: Size = SIZE
    filmed: bool = True
    seen: SeenSpace = field(default_factory=SeenSpace)
    series: dict[str, Series] = field(default_factory=dict)
    trails: dict[str, Trail] = field(default_factory=dict)
    unsure: list[Bar] = field(default_factory=list)
    changed: Changed = field(default_factory=Changed)
    redrawn: int = 0  # times that the SLAM moved its map
    _seen_ns: int = -SEEN_EVERY_NS
    _scans: list[tuple[int, Scan]] = field(default_factory=list)  # that were seen, by frame
    _first: tuple[int, Float | None] | None = None
    _last: Frame | None = None
    _panes: _Panes | None = None

    def color(self, name: str) -> Color:
        """The colour a track is drawn in."""
        return draw.GREEN if name == "truth" else draw.colors_of(list(self.replay.tracks))[name]

    def named(self) -> list[tuple[str, Color]]:
        """Whose colour is which: the tracks, then the truth where there is one."""
        known = (
            [(self.truth_name, draw.GREEN)] if "truth" in self.trails and self.truth_name else []
        )
        return [(name, self.color(name)) for name in self.replay.tracks] + known

    def legend(self) -> list[tuple[str, Color]]:
        """The same for a strip, with what the colours of the beams say."""
        beams = LEGEND if self.stage.labelled else ()
        return self.named() + [(f"scan: {word}", color) for word, color in beams]

    def seconds(self, frame: Frame) -> float:
        """s since the first frame noted."""
        return (frame.stamp_ns - self._first[0]) / NS_PER_S if self._first else 0.0

    @property
    def last_points_map(self) -> Float:
        """(k, 2) m, what the last scan saw where the primary track believes it was."""
        if self._last is None or self._last.scan is None:
            return np.zeros((0, 2))
        here = self.track().estimates[-1].T_map_robot
        return se2.transform(here, points_robot(self._last.scan))

    def note(self, frame: Frame) -> float:
        """Remember this frame's poses and errors; call for every frame, painted or not.

        Returns s since the first frame.
        """
        if self._first is None:
            self._first = (frame.stamp_ns, frame.truth)
        self._last = frame
        truth_map = self._truth_map(frame)
        if truth_map is not None:
            self.trails.setdefault("truth", Trail()).add(truth_map)
        if frame.scan is not None and frame.stamp_ns - self._seen_ns >= SEEN_EVERY_NS:
            self.seen.add(frame.scan, self.track().estimates[-1].T_map_robot)
            self._seen_ns = frame.stamp_ns
            if isinstance(self.track().system, MovingMap):
                self._scans.append((len(self.track().estimates) - 1, frame.scan))
        seconds = self.seconds(frame)
        for name, track in self.replay.tracks.items():
            estimate = track.estimates[-1]
            self.trails.setdefault(name, Trail()).add(estimate.T_map_robot)
            error = None
            if truth_map is not None:
                error = estimate.T_map_robot - truth_map
                error[2] = se2.wrap(float(error[2]))
            self.series.setdefault(name, Series()).add(seconds, error, estimate.covariance)
        self._note_trust(seconds)
        self._follow_map()
        if self.filmed and frame.scan is not None and self.stage.bounds is None:
            self.changed.add(frame.scan, self.track().estimates[-1].T_map_robot)
        return seconds

    def paint(self, frame: Frame) -> Picture:
        """The film frame at ``frame``: call ``note`` first. Pictures share no memory."""
        if self._panes is None:
            self._panes = _Panes(self)
        return self._panes.paint(frame, self.seconds(frame))

    def poster(self, raster: Raster) -> Picture | None:
        """The last frame, its map framed on what stands in ``raster``; None where the whole room
        is in view anyway, or nothing stands."""
        rows, columns = np.nonzero(raster.values > OCCUPIED_THRESHOLD)
        if self._last is None or self._panes is None or self.stage.bounds or not len(rows):
            return None
        step, origin = raster.resolution_m, raster.T_map_origin
        # without what few beams met through windows
        xmin, xmax = np.quantile(columns, (STRAY, 1.0 - STRAY)) * step + origin[0]
        ymin, ymax = np.quantile(rows, (STRAY, 1.0 - STRAY)) * step + origin[1]
        bounds = float(xmin), float(ymin), float(xmax) + step, float(ymax) + step
        return self._panes.framed(self._last, self.seconds(self._last), bounds)

    def vignette(self, frame: Frame) -> Picture:
        """The scan above the map, without words: what a strip is made of."""
        whole = self.paint(frame)
        assert self._panes is not None
        return self._panes.vignette(whole)

    # -- what the panes are told ----------------------------------------------------------

    def track(self) -> Track:
        """What the filmed system has estimated so far."""
        return self.replay.tracks[self.primary]

    def _truth_map(self, frame: Frame) -> Float | None:
        first = self._first[1] if self._first else None
        if frame.truth is None or first is None:
            return None
        return se2.between(first, frame.truth)

    def _follow_map(self) -> None:
        """Lay out again what was seen, where closed loops have moved the map (docs/loops.md)."""
        system = self.track().system
        if not isinstance(system, MovingMap):
            return
        if not any(self.track().estimates[-1].diagnostics["correction"]):
            return
        poses = system.poses_in_map()
        self.seen, self.redrawn = SeenSpace(), self.redrawn + 1
        self.trails[self.primary] = trail = Trail()
        for pose in poses:
            trail.add(pose)
        for k, scan in self._scans:
            self.seen.add(scan, poses[k])
            if self.filmed and self.stage.bounds is None:
                self.changed.add(scan, poses[k])

    def _note_trust(self, seconds: float) -> None:
        if self.track().estimates[-1].converged:
            return
        before = self.unsure[-1] if self.unsure else None
        if before is not None and seconds - before.end_s < 0.5:
            self.unsure[-1] = replace(before, end_s=seconds)
        else:
            self.unsure.append(Bar(lane="unsure", start_s=seconds, end_s=seconds))

    def T_view_map(self) -> Float:
        """The map drawn the way the world lies, where that is known; for display only."""
        first = self._first[1] if self._first else None
        return first if first is not None and self.stage.bounds is not None else np.zeros(3)

    def holds(self) -> str:
        """What the map of the primary track is made of, where that is known."""
        track = self.track()
        if track.landmarks() is not None:
            return f"landmarks ({SIGMAS:g} σ), "
        words = track.cells_hold()
        return f"{words}, " if words else ""

    def names(self) -> list[str]:
        """What has a trail, the primary track last."""
        others = [name for name in self.trails if name != self.primary]
        return [*others, self.primary]


class _Panes:
    """The painters of one layout, and the part of the frame that stays."""

    def __init__(self, show: Show) -> None:
        self._show, stage, pace = show, show.stage, show.pace
        self._more = panes.registered()
        layout = Layout.of(show.size, camera=stage.camera, more=len(self._more))
        self._layout, unit = layout, layout.unit
        stage.open(layout)
        self._map = MapPane(*layout.map.size, unit, stage.bounds)
        self._close = CloseUp(layout.close.size, unit, show.color(show.primary))
        span = (pace.from_s, max(min(pace.to_s, show.duration_s), pace.from_s + 1.0))
        self._chart = ErrorChart(
            layout.chart.size,
            unit,
            span_s=span,
            primary=show.primary,
            colors={name: show.color(name) for name in show.replay.tracks},
            lanes=[*stage.lanes, "unsure"],
        )
        # of a log, nobody knows how large its world is
        self._tiles = MapTiles() if stage.bounds is None else None
        self._redrawn = show.redrawn
        self._base = self._still()
        self._fresh_at = self._mapped_at = -np.inf
        self._camera: Picture | None = None

    def paint(self, frame: Frame, seconds: float) -> Picture:
        show, layout = self._show, self._layout
        fresh = (
            show.pace.fps * FRESH_S <= 1.0  # scans come when they come: some early by a part
            or abs(seconds - self._fresh_at) >= FRESH_S * show.pace.speed - 1e-6
        )
        track, trails = show.track(), show.trails
        T_view_map = show.T_view_map()
        if fresh:
            self._fresh_at = seconds
            landmarks = track.landmarks()
            known = None if landmarks is None else landmarks.ellipses(SIGMAS)
            self._map.refresh(self._raster(seconds), known, trails[show.primary], T_view_map)
        canvas = self._base.copy()
        self._headline(canvas, seconds)
        drawn = [(trails[n], show.color(n), 4 if n == "truth" else 2) for n in show.names()]
        covariance = track.estimates[-1].covariance
        picture = self._map.paint(drawn, show.last_points_map, covariance, T_view_map)
        _put(canvas, layout.map, picture)
        _put(canvas, layout.scan, show.stage.scan(frame))
        if layout.camera is not None:
            if fresh or self._camera is None:
                self._camera = show.stage.view()
            _put(canvas, layout.camera, self._camera)
        bars = [*show.stage.bars(), *show.unsure]
        _put(canvas, layout.chart, self._chart.paint(show.series, bars, show.stage.kidnaps()))
        _put(canvas, layout.close, self._close_up(T_view_map, covariance))
        self._say_off(canvas, covariance)
        for pane, box in zip(self._more, layout.more, strict=True):
            _put(canvas, box, pane(show, frame, box.size))
        return canvas

    def framed(
        self, frame: Frame, seconds: float, bounds: tuple[float, float, float, float]
    ) -> Picture:
        """A picture whose map shows that part of the plane, m."""
        self._map.bounds, self._fresh_at = bounds, -np.inf
        return self.paint(frame, seconds)

    def _raster(self, seconds: float) -> Raster | LevelMap | None:
        """The map now; of a log, what its view has pixels for.

        A map that is not to be had in parts is asked for some dozens of times.
        """
        show, tiles = self._show, self._tiles
        track = show.track()
        if tiles is None:
            return track.map()
        if self._redrawn != show.redrawn:
            self._redrawn, self._tiles = show.redrawn, (tiles := MapTiles())
        tiles.fit(self._map.view(show.trails[show.primary], show.T_view_map()).scale)
        rest_s = 0.0 if isinstance(track.system, MapsInParts) else show.duration_s / MOST_MAPS
        if abs(seconds - self._mapped_at) >= rest_s:
            self._mapped_at = seconds
            for bounds in show.changed.taken(in_parts=rest_s == 0.0, empty=tiles.empty):
                part = track.map_part(tiles.aligned(bounds))
                if part is not None:
                    tiles.put(part)
        return tiles.whole()

    def vignette(self, whole: Picture) -> Picture:
        """Two panes of a painted frame, one above the other, equally wide."""
        parts = []
        width = self._layout.scan.width
        for box in (self._layout.scan, self._layout.map):
            part = whole[box.y : box.y + box.height, box.x : box.x + box.width]
            height = round(box.height * width / box.width)
            parts.append(cv2.resize(part, (width, height), interpolation=cv2.INTER_AREA))
        return np.vstack(parts)

    def _close_up(self, T_view_map: Float, covariance: Float) -> Picture:
        trails = self._show.trails
        here = se2.compose(T_view_map, trails[self._show.primary].pose)
        truth = se2.compose(T_view_map, trails["truth"].pose) if "truth" in trails else None
        turn = se2.rotation(float(T_view_map[2]))
        return self._close.paint(here, truth, turn @ covariance[:2, :2] @ turn.T)

    def _say_off(self, canvas: Picture, covariance: Float) -> None:
        """Under the close-up, how far off."""
        trails, box, unit = self._show.trails, self._layout.close, self._layout.unit
        if "truth" not in trails:
            return
        error: Float = (trails[self._show.primary].pose - trails["truth"].pose)[:2]
        at = (box.x, box.y + box.height + round(6 * unit))
        draw.text(canvas, off_by(error, covariance[:2, :2]), at, round(13 * unit), bold=True)

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
        words = f"{show.title} · {show.primary}"
        x = draw.text(canvas, words, (round(16 * unit), round(12 * unit)), size, bold=True)
        self._time_x = x + round(24 * unit)
        self._key(canvas)
        titles = [
            (layout.map, f"map of {show.primary}: {show.holds()}scan, trails"),
            (layout.close, f"close-up, {SIGMAS:g} σ ellipse"),
        ]
        titles += [(box, p.title) for p, box in zip(self._more, layout.more, strict=True)]
        if layout.camera is not None:
            titles.append((layout.camera, "3D camera"))
        labelled = show.stage.labelled
        titles.append((layout.scan, "scan:" if labelled else "scan, the robot's front up"))
        for box, title in titles:
            at = (box.x, box.y - round(20 * unit))
            end = draw.text(canvas, title, at, round(13 * unit), draw.MUTED)
            if box is layout.scan and labelled:
                legend(canvas, (end + round(10 * unit), at[1]), unit)
        return canvas

    def _key(self, canvas: Picture) -> None:
        """Which colour is whose, from the right."""
        show, unit = self._show, self._layout.unit
        size, x = round(13 * unit), self._layout.size[0] - round(16 * unit)
        for word, color in reversed(show.named()):
            x -= draw.text_width(word, size, bold=True)
            draw.text(canvas, word, (x, round(14 * unit)), size, color, bold=True)
            bar, y = round(18 * unit), round(21 * unit)
            canvas[y : y + round(3 * unit), x - bar - round(6 * unit) : x - round(6 * unit)] = color
            x -= bar + round(24 * unit)


def _put(canvas: Picture, box: Box, picture: Picture) -> None:
    canvas[box.y : box.y + box.height, box.x : box.x + box.width] = picture

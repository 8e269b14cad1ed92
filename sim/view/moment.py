# SPDX-License-Identifier: Apache-2.0
"""One moment of a run as it is shown, whatever draws it: the room, the scan, what SLAMs say."""

import math
from array import array
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from sim.view import draw
from sim.view.draw import Color, colors_of
from sim.view.parts import Placed
from sim.view.scans import LEGEND, beams
from slam import se2
from slam.estimate import Estimate, Landmarks, Raster
from slam.evaluation.lost import LOST_M, LOST_RAD
from slam.frames import NS_PER_S, Float, Frame
from slam.rasters import joined, trimmed
from slam.replay import Replay, Track, primary_of
from slam.system import MovingMap

MAP_S = 1.0  # of a run: so often the map is drawn anew
BIG_MAP_CELLS, BIG_MAP_S = 500_000, 5.0  # one of so many cells less often
MOST_CELLS = 1024  # of the map as drawn, along an edge
MOST_POINTS = 1500  # of a path as drawn
SIGMAS = 3.0  # of the ellipses
CLAIM = 2.0  # sigmas of what a track claims of its error
RING = 36  # corners of an ellipse
DOUBTS: dict[str, Color] = {"unsure": draw.AMBER, "lost": draw.RED}


@dataclass(frozen=True, kw_only=True, eq=False)
class Shown:
    """Everything that is shown of one scan; later scans do not change it.

    primary      the track whose map is shown
    number       of the frame, from 0;   seconds  since the first frame
    T_world_map  (3,) pose of the first frame; zeros where nobody knows the truth
    truth_map    (3,) true pose in the map frame, None where nobody knows it
    estimates    of every track
    placed       where the room's parts are at the scan's start, None for a log
    raster, landmarks  the map of the primary track, as it was looked at last
    said         what happened since the frame before
    """

    primary: str
    number: int
    seconds: float
    frame: Frame
    T_world_map: Float
    truth_map: Float | None
    estimates: Mapping[str, Estimate]
    placed: Placed | None
    raster: Raster | None
    landmarks: Landmarks | None
    said: tuple[str, ...]

    @property
    def own(self) -> Estimate:
        """Of the primary track."""
        return self.estimates[self.primary]

    def told(self) -> list[tuple[str, Color]]:
        """What the primary track says of itself and, where the truth is known, how far off it is.

        Green is a pose that claims not to be lost, unless the truth lies beyond its ellipse.
        """
        own, word = self.own, verdict_of(self.own)
        sigma_m = claims(own.covariance)[0] / CLAIM
        color = DOUBTS.get(word, draw.GREEN if sigma_m else draw.AMBER)
        claim = f"± {draw.measured(sigma_m)} (1 σ)" if sigma_m else "no covariance"
        if self.truth_map is None:
            return [(f"{word}, {claim}", color)]
        off, sigmas = off_by((own.T_map_robot - self.truth_map)[:2], own.covariance[:2, :2])
        refuted = sigmas > SIGMAS
        return [
            (f"{word}, {claim}", draw.RED if refuted else color),
            (off, draw.RED if refuted else draw.INK),
        ]

    def error(self, name: str) -> tuple[float, float]:
        """(m, rad wrapped) that a track is off, NaN without truth."""
        if self.truth_map is None:
            return math.nan, math.nan
        x, y, turned = (self.estimates[name].T_map_robot - self.truth_map).tolist()
        return math.hypot(x, y), se2.wrap(turned)

    def claimed(self, name: str) -> tuple[float, float]:
        """``CLAIM`` sigma that a track claims: m along the longest axis of its ellipse, rad."""
        return claims(self.estimates[name].covariance)

    def robots(self) -> dict[str, tuple[Float, Float | None]]:
        """Pose (3,) in the map and covariance (3, 3) by track, and those of the truth last."""
        found: dict[str, tuple[Float, Float | None]] = {
            name: (one.T_map_robot, one.covariance) for name, one in self.estimates.items()
        }
        return found if self.truth_map is None else {**found, "truth": (self.truth_map, None)}

    def scan_map(self, T_map_robot: Float) -> tuple[Float, NDArray[np.uint8]]:
        """(k, 2) m in the map and (k, 3) RGB, where beams ended for a robot there."""
        mounted, ends, colors = beams(self.frame)
        return se2.transform(se2.compose(T_map_robot, mounted), ends), colors


class Path:
    """Where something was at each frame, (x, y) m; NaN where nobody knows.

    pose  the last
    """

    def __init__(self) -> None:
        self._xy = array("d")
        self.pose: Float = np.full(3, np.nan)

    def add(self, pose: Float) -> None:
        """At the next frame."""
        self._xy.extend(pose[:2].tolist())
        self.pose = pose

    def move(self, T_new_old: Float) -> None:
        """Into another frame."""
        xy = np.array(self._xy).reshape(-1, 2)
        self._xy = array("d", se2.transform(T_new_old, xy).ravel())

    def __len__(self) -> int:
        return len(self._xy) // 2

    def points(self, most: int = MOST_POINTS, number: int | None = None) -> Float:
        """(k, 2) m up to the frame of that ``number``, None: to the last; of them at most ``most``
        and the last."""
        end = len(self) - 1 if number is None else number
        xy = np.array(self._xy).reshape(-1, 2)
        xy = np.concatenate([xy[0 : end : max(1, -(-(end + 1) // most))], xy[end : end + 1]])
        known: Float = xy[~np.isnan(xy[:, 0])]
        return known


class Moments:
    """Makes moments of a replay, frame by frame.

    primary    the track whose map is shown
    paths      in the map frame, by track and "truth"
    colors     by track and "truth"
    T_world_map  of the map frame; None: the first frame's truth
    truth_name  what the truth is called
    seconds    of the last moment
    moved      how often the primary track has moved its map
    labelled   whether beams say what they hit
    """

    def __init__(
        self, replay: Replay, T_world_map: Float | None = None, truth_name: str = "truth"
    ) -> None:
        self.T_world_map, self.truth_name = T_world_map, truth_name
        self.replay, self.primary = replay, primary_of(replay)
        self.paths: dict[str, Path] = {name: Path() for name in ("truth", *replay.tracks)}
        self.colors = colors_of(list(replay.tracks))
        self._first_ns: int | None = None
        self._known = T_world_map is not None
        self._T_map_first = np.zeros(3)
        self._number, self.seconds, self.moved = -1, 0.0, 0
        self.labelled = False
        self._looked_s = -math.inf
        self._map: tuple[Raster | None, Landmarks | None] = None, None

    @property
    def track(self) -> Track:
        """The primary one."""
        return self.replay.tracks[self.primary]

    def named(self) -> list[tuple[str, Color]]:
        """Whose colour is which: the tracks, then the truth where it is known."""
        names = {name: name for name in self.replay.tracks}
        if self.truth_name and not np.isnan(self.paths["truth"].pose[0]):
            names["truth"] = self.truth_name
        return [(short(word), self.colors[name]) for name, word in names.items()]

    def legend(self) -> list[tuple[str, Color]]:
        """The same, and what the colours of the beams say."""
        beams = LEGEND if self.labelled else ()
        return self.named() + [(f"scan: {word}", color) for word, color in beams]

    def note(self, frame: Frame, placed: Placed | None = None, said: Sequence[str] = ()) -> Shown:
        """The moment of a frame that every track has just taken; call it for each."""
        if self._first_ns is None:
            self._first_ns = frame.stamp_ns
            self.T_world_map = frame.truth if self.T_world_map is None else self.T_world_map
        self._follow_start()
        self._number += 1
        self.labelled = self.labelled or frame.labels is not None
        self.seconds = (frame.stamp_ns - self._first_ns) / NS_PER_S
        truth_map = None
        if self.T_world_map is not None and frame.truth is not None:
            truth_map = se2.between(self.T_world_map, frame.truth)
        estimates = {name: track.estimates[-1] for name, track in self.replay.tracks.items()}
        for name in estimates.keys() - {self.primary} if any(self._T_map_first) else ():
            pose = se2.compose(self._T_map_first, estimates[name].T_map_robot)
            estimates[name] = replace(estimates[name], T_map_robot=pose)
        for name, estimate in estimates.items():
            self.paths[name].add(estimate.T_map_robot)
        self.paths["truth"].add(np.full(3, np.nan) if truth_map is None else truth_map)
        self._follow_map()
        return Shown(
            primary=self.primary,
            number=self._number,
            seconds=self.seconds,
            frame=frame,
            T_world_map=np.zeros(3) if self.T_world_map is None else self.T_world_map,
            truth_map=truth_map,
            estimates=estimates,
            placed=placed,
            raster=self._map[0],
            landmarks=self._map[1],
            said=tuple(said),
        )

    def look(
        self, rest_s: float = 0.0, big_rest_s: float = BIG_MAP_S
    ) -> tuple[Raster | None, Landmarks | None]:
        """The map of the primary track in at most ``MOST_CELLS`` along an edge; as it was seen
        last where that is less than ``rest_s`` of the run ago, of a big one ``big_rest_s``."""
        raster = self._map[0]
        if raster is not None and raster.values.size > BIG_MAP_CELLS:
            rest_s = max(rest_s, big_rest_s)
        if self.seconds - self._looked_s >= rest_s - 1e-6:
            self._looked_s = self.seconds
            self._map = small_map(self.track), self.track.landmarks()
        return self._map

    def _follow_start(self) -> None:
        """Once a session has found where its first frame is in the map, so is all else."""
        T_map_first = getattr(self.track.system, "T_map_first", self._T_map_first)
        if self._known or not any(T_map_first - self._T_map_first):
            return
        self._T_map_first = T_map_first
        if self.T_world_map is not None:
            self.T_world_map = se2.compose(self.T_world_map, se2.inverse(T_map_first))
        for name in self.paths.keys() - {self.primary}:
            self.paths[name].move(T_map_first)

    def _follow_map(self) -> None:
        """Lay out the path again where closed loops have moved the map (docs/loops.md)."""
        system = self.track.system
        if not isinstance(system, MovingMap):
            return
        if not any(self.track.estimates[-1].diagnostics["correction"]):
            return
        self.moved += 1
        self._looked_s = -math.inf
        self.paths[self.primary] = path = Path()
        for pose in system.poses_in_map():
            path.add(pose)


def short(word: str) -> str:
    """Of a long command, its two ends."""
    return word if len(word) <= 28 else f"{word[:10]}…{word[-12:]}"


def small_map(track: Track) -> Raster | None:
    """What is known of a map, each cell the largest of several where it has too many for a
    picture: a thin wall stays."""
    raster = track.map()
    known = None if raster is None else trimmed(raster)
    if known is None:
        return None
    return joined(known, max(-(-max(known.values.shape) // MOST_CELLS), 1))


def verdict_of(estimate: Estimate) -> str:
    """What a SLAM says of itself: tracking (relocated, map outdated here), unsure or lost.

    Unsure is what does not trust its pose, or claims ``CLAIM`` sigma at which a run is lost.
    """
    state, claim = str(estimate.diagnostics.get("state", "tracking")), claims(estimate.covariance)
    if state in DOUBTS:
        return state
    sure = estimate.converged and claim[0] <= LOST_M and claim[1] <= LOST_RAD
    return state if sure else "unsure"


def off_by(error: Float, covariance: Float) -> tuple[str, float]:
    """How far off, and how many of its own sigmas that is: ``1.7 cm off, 1.2 σ``; NaN of these
    where none are claimed.

    error (2,) m and covariance (2, 2) m^2 in one frame.
    """
    word = f"{draw.measured(math.hypot(*error.tolist()))} off"
    if not np.linalg.det(covariance) > 0.0:
        return word, math.nan
    sigmas = math.sqrt(max(float(error @ np.linalg.solve(covariance, error)), 0.0))
    return f"{word}, {sigmas:.1f} σ", sigmas


def claims(covariance: Float) -> tuple[float, float]:
    """``CLAIM`` sigma of position along the longest axis, m, and of heading, rad."""
    a, b, c = covariance[0, 0], covariance[0, 1], covariance[1, 1]
    longest = 0.5 * (a + c) + math.sqrt(0.25 * (a - c) * (a - c) + b * b)
    return CLAIM * math.sqrt(max(float(longest), 0.0)), CLAIM * math.sqrt(float(covariance[2, 2]))


def ellipse(covariance: Float) -> Float:
    """(RING, 2) m around zero, of ``SIGMAS``."""
    values, vectors = np.linalg.eigh(np.asarray(covariance)[:2, :2])
    turns = np.linspace(0.0, math.tau, RING, endpoint=False)
    circle = np.stack([np.cos(turns), np.sin(turns)], axis=1)
    ring: Float = SIGMAS * (circle * np.sqrt(np.maximum(values, 0.0))) @ vectors.T
    return ring

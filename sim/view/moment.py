# SPDX-License-Identifier: Apache-2.0
"""One moment of a run as it is shown, whatever draws it: the room, the scan, what SLAMs say."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim.view.parts import Placed
from slam import se2
from slam.estimate import Estimate, Landmarks, Raster
from slam.frames import NS_PER_S, Float, Frame
from slam.replay import Replay, primary_of

MAP_NS = NS_PER_S  # so often the map is drawn anew
BIG_MAP_CELLS, BIG_MAP_NS = 500_000, 5 * NS_PER_S  # one of so many cells less often
CLAIM = 2.0  # sigmas of what a track claims of its error
RING = 36  # corners of an ellipse


@dataclass(frozen=True, kw_only=True, eq=False)
class Said:
    """One line for the log of events; ``level`` "info" or "warning"."""

    text: str
    level: str = "info"


@dataclass(frozen=True, kw_only=True, eq=False)
class Shown:
    """Everything that is shown of one scan; later scans do not change it.

    number       of the frame, from 0;   seconds  since the first frame
    T_world_map  (3,) pose of the first frame; zeros where nobody knows the truth
    truth_map    (3,) true pose in the map frame, None where nobody knows it
    estimates    of every track
    placed       where the room's parts are at the scan's start, None for a log
    raster, landmarks  the map of the first track, as of at most ``BIG_MAP_NS`` ago
    said         what happened since the frame before
    """

    number: int
    seconds: float
    frame: Frame
    T_world_map: Float
    truth_map: Float | None
    estimates: Mapping[str, Estimate]
    placed: Placed | None
    raster: Raster | None
    landmarks: Landmarks | None
    said: tuple[Said, ...]

    def error(self, name: str) -> Float | None:
        """(x m, y m, theta rad wrapped) of a track, None without truth."""
        if self.truth_map is None:
            return None
        error: Float = self.estimates[name].T_map_robot - self.truth_map
        error[2] = se2.wrap(float(error[2]))
        return error

    def claimed(self, name: str) -> tuple[float, float]:
        """``CLAIM`` sigma that a track claims: m along the longest axis of its ellipse, rad."""
        return claims(self.estimates[name].covariance)

    def verdict(self, name: str) -> str:
        """What a track says of itself."""
        return verdict_of(self.estimates[name])


class Path:
    """Where something was at each frame."""

    def __init__(self) -> None:
        self._xy: NDArray[np.float64] = np.zeros((1024, 2))
        self._n = 0

    def add(self, pose: Float) -> None:
        """At the next frame."""
        if self._n == len(self._xy):
            self._xy = np.concatenate([self._xy, np.zeros_like(self._xy)])
        self._xy[self._n] = pose[:2]
        self._n += 1

    def until(self, number: int, most: int) -> Float:
        """(k, 2) m up to the frame of that number, evenly thinned to about ``most``."""
        step = max(1, number // most)
        xy = np.concatenate([self._xy[0:number:step], self._xy[number : number + 1]])
        known: Float = xy[~np.isnan(xy[:, 0])]
        return known


class Moments:
    """Makes moments of a replay, frame by frame.

    primary    the track whose map is shown
    paths      (n, 2) m in the map frame, by track and "truth": where it was at each frame
    every      factor on the time between two looks at the map
    T_world_map  of the map frame; None: the first frame's truth
    seconds    of the last moment
    """

    def __init__(
        self, replay: Replay, every: float = 1.0, T_world_map: Float | None = None
    ) -> None:
        self._T_world_map = T_world_map
        self.replay, self.primary, self.every = replay, primary_of(replay), every
        self.paths: dict[str, Path] = {name: Path() for name in (*replay.tracks, "truth")}
        self._first: Frame | None = None
        self._number, self._map_ns, self.seconds = -1, 0, 0.0
        self._raster: Raster | None = None
        self._landmarks: Landmarks | None = None

    def note(self, frame: Frame, placed: Placed | None = None, said: Sequence[Said] = ()) -> Shown:
        """The moment of a frame that every track has just taken; call it for each."""
        if self._first is None:
            self._first = frame
            self._T_world_map = frame.truth if self._T_world_map is None else self._T_world_map
        self._number += 1
        truth_map = None
        if self._T_world_map is not None and frame.truth is not None:
            truth_map = se2.between(self._T_world_map, frame.truth)
        estimates = {name: track.estimates[-1] for name, track in self.replay.tracks.items()}
        for name, estimate in estimates.items():
            self.paths[name].add(estimate.T_map_robot)
        self.paths["truth"].add(np.full(3, np.nan) if truth_map is None else truth_map)
        self._map(frame.stamp_ns)
        self.seconds = (frame.stamp_ns - self._first.stamp_ns) / NS_PER_S
        return Shown(
            number=self._number,
            seconds=self.seconds,
            frame=frame,
            T_world_map=np.zeros(3) if self._T_world_map is None else self._T_world_map,
            truth_map=truth_map,
            estimates=estimates,
            placed=placed,
            raster=self._raster,
            landmarks=self._landmarks,
            said=tuple(said),
        )

    def _map(self, stamp_ns: int) -> None:
        cells = 0 if self._raster is None else self._raster.values.size
        period_ns = MAP_NS if cells <= BIG_MAP_CELLS else BIG_MAP_NS
        if self._number > 0 and stamp_ns - self._map_ns < period_ns * max(1.0, self.every):
            return
        track, self._map_ns = self.replay.tracks[self.primary], stamp_ns
        self._raster, self._landmarks = track.map(), track.landmarks()


def verdict_of(estimate: Estimate) -> str:
    """What a SLAM says of itself: tracking, map outdated here, lost; or not sure."""
    usual = "tracking" if estimate.converged else "not sure"
    return str(estimate.diagnostics.get("verdict", usual))


def claims(covariance: Float) -> tuple[float, float]:
    """``CLAIM`` sigma of position along the longest axis, m, and of heading, rad."""
    a, b, c = covariance[0, 0], covariance[0, 1], covariance[1, 1]
    longest = 0.5 * (a + c) + math.sqrt(0.25 * (a - c) * (a - c) + b * b)
    return CLAIM * math.sqrt(max(float(longest), 0.0)), CLAIM * math.sqrt(float(covariance[2, 2]))


def ellipse(covariance: Float, sigmas: float) -> Float:
    """(RING, 2) m around zero."""
    values, vectors = np.linalg.eigh(np.asarray(covariance)[:2, :2])
    turns = np.linspace(0.0, math.tau, RING, endpoint=False)
    circle = np.stack([np.cos(turns), np.sin(turns)], axis=1)
    ring: Float = sigmas * (circle * np.sqrt(np.maximum(values, 0.0))) @ vectors.T
    return ring

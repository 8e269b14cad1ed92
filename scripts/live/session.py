# SPDX-License-Identifier: Apache-2.0
"""A run as it is shown: each scan with the room at its start, and what every SLAM made of it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scripts.film.chart import Series
from scripts.live.hands import Hands
from scripts.live.things import Placed
from sim.events import KIDNAP, Event, EventWatch
from sim.moments import Moment
from slam import se2
from slam.errors import InvalidValueError
from slam.estimate import Estimate, Landmarks, Raster
from slam.frames import NS_PER_S, Float, Frame, Stream
from slam.replay import Replay, primary_of

EPOCH_NS = 1_000_000_000 * NS_PER_S  # added to stamps that count from a start: 0 reads as "unset"
REAL_NS = EPOCH_NS // 10  # a stamp from here on is a real one (1973)
MAP_NS = NS_PER_S  # so often the map is drawn anew
BIG_MAP_CELLS, BIG_MAP_NS = 500_000, 5 * NS_PER_S  # one of so many cells less often
EVENTS_NS = NS_PER_S // 5
_SAYS = {
    "door": "moves", "person": "comes near the robot", "change": "stands elsewhere, unseen",
}  # fmt: skip


@dataclass(frozen=True, kw_only=True, eq=False)
class Said:
    """One line for the log of events; ``level`` "info" or "warning"."""

    text: str
    level: str = "info"


@dataclass(frozen=True, kw_only=True, eq=False)
class Shown:
    """Everything that is shown of one scan; later scans do not change it.

    number       of the frame, from 0
    stamp_ns     as shown, see ``EPOCH_NS``;   seconds  since the first frame
    T_world_map  (3,) pose of the first frame; zeros where nobody knows the truth
    truth_map    (3,) true pose in the map frame, None where nobody knows it
    estimates    of every track
    placed       where the room's parts are at the scan's start, None for a log
    raster, landmarks  the map of the first track, as of at most ``BIG_MAP_NS`` ago
    said         what happened since the frame before
    """

    number: int
    stamp_ns: int
    seconds: float
    frame: Frame
    T_world_map: Float
    truth_map: Float | None
    estimates: Mapping[str, Estimate]
    placed: Placed | None
    raster: Raster | None
    landmarks: Landmarks | None
    said: tuple[Said, ...]

    def errors(self, name: str) -> dict[str, float | None]:
        """Errors of a track and twice the sigmas that it claims; None where nobody knows."""
        estimate, error = self.estimates[name], None
        if self.truth_map is not None:
            error = estimate.T_map_robot - self.truth_map
            error[2] = se2.wrap(float(error[2]))
        series = Series()
        series.add(self.seconds, error, estimate.covariance)
        values = {
            "position_m": series.position[0],
            "heading_deg": math.degrees(series.heading[0]),
            "position_2_sigma_m": series.claimed[0],
            "heading_2_sigma_deg": math.degrees(series.claimed_rad[0]),
        }
        return {key: value if math.isfinite(value) else None for key, value in values.items()}


class Room:
    """What is noted of a simulated room scan by scan, besides the frame."""

    def __init__(self, hands: Hands) -> None:
        self.hands = hands
        self.placed: Placed | None = None
        self._world = hands.simulation.world
        self._watch = EventWatch(self._world)
        self._known: set[tuple[str, str, float]] = set()

    def frames(self, seconds: float) -> Iterator[Frame]:
        """Frames of a tour; ``placed`` is of the one given last."""
        before = Placed.of(self._world)
        for moment in self.hands.moments(seconds):
            self.placed, before = before, Placed.of(self._world)
            self._note(moment)
            yield moment.frame

    def _note(self, moment: Moment) -> None:
        self._watch.note(moment)
        if self.hands.T_world_map is None:
            self.hands.T_world_map = moment.frame.truth

    def said(self) -> list[Said]:
        """Events that have begun since it was last asked."""
        found = []
        for event in self._watch.events():
            key = (event.kind, event.name, event.start_s)
            if key not in self._known:
                self._known.add(key)
                found.append(Said(text=_told(event)))
        return found


def _told(event: Event) -> str:
    if event.kind == KIDNAP:
        return f"{event.start_s:.1f} s: the robot is carried elsewhere"
    return f"{event.start_s:.1f} s: {event.name} {_SAYS.get(event.kind, 'is moved')}"


class Session:
    """Runs SLAMs on a stream and gives what is shown, scan by scan.

    room       of a simulation, None for a log
    primary    the track whose map is shown
    paths      (n, 2) m in the map frame, by track and "truth": where it was at each frame
    pending    what is to be said with the next frame
    speed      of the view: a faster one gets fewer maps in a second of the run
    """

    def __init__(self, stream: Stream, replay: Replay, room: Room | None = None) -> None:
        self.replay, self.room, self.primary = replay, room, primary_of(replay)
        self.paths: dict[str, Path] = {name: Path() for name in (*replay.tracks, "truth")}
        self._stream = stream
        self._map_ns = self._events_ns = -EPOCH_NS
        self._raster: Raster | None = None
        self._landmarks: Landmarks | None = None
        self._sure = True
        self.pending: list[Said] = []
        self.speed = 1.0

    def run(self) -> Iterator[Shown]:
        """All frames of the stream."""
        first: Frame | None = None
        for number, frame in enumerate(self.replay.run(self._stream)):
            first = first or frame
            yield self._shown(number, frame, first)

    def _shown(self, number: int, frame: Frame, first: Frame) -> Shown:
        truth_map = None
        if first.truth is not None and frame.truth is not None:
            truth_map = se2.between(first.truth, frame.truth)
        estimates = {name: track.estimates[-1] for name, track in self.replay.tracks.items()}
        for name, estimate in estimates.items():
            self.paths[name].add(estimate.T_map_robot)
        self.paths["truth"].add(np.full(3, np.nan) if truth_map is None else truth_map)
        self._map(frame.stamp_ns)
        shift = 0 if first.stamp_ns >= REAL_NS else EPOCH_NS
        return Shown(
            number=number,
            stamp_ns=frame.stamp_ns + shift,
            seconds=(frame.stamp_ns - first.stamp_ns) / NS_PER_S,
            frame=frame,
            T_world_map=np.zeros(3) if first.truth is None else first.truth,
            truth_map=truth_map,
            estimates=estimates,
            placed=None if self.room is None else self.room.placed,
            raster=self._raster,
            landmarks=self._landmarks,
            said=tuple(self._said(frame.stamp_ns, estimates[self.primary])),
        )

    def _map(self, stamp_ns: int) -> None:
        cells = 0 if self._raster is None else self._raster.values.size
        period_ns = MAP_NS if cells <= BIG_MAP_CELLS else BIG_MAP_NS
        if stamp_ns - self._map_ns < period_ns * max(1.0, self.speed):
            return
        track, self._map_ns = self.replay.tracks[self.primary], stamp_ns
        self._raster, self._landmarks = track.map(), track.landmarks()

    def _said(self, stamp_ns: int, estimate: Estimate) -> list[Said]:
        said, self.pending = self.pending, []
        if self.room is not None and stamp_ns - self._events_ns >= EVENTS_NS:
            self._events_ns = stamp_ns
            said = said + self.room.said()
        if estimate.converged != self._sure:
            self._sure = estimate.converged
            word = "trusts its estimate again" if self._sure else "does not trust its estimate"
            said = [*said, Said(text=f"{self.primary} {word}", level="warning")]
        return said


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


def stamps_of(first_ns: int, seconds: float) -> tuple[int, int]:
    """First and last stamp as shown, ns, of a run that begins at ``first_ns``."""
    if not (math.isfinite(seconds) and seconds >= 0.0):
        raise InvalidValueError(f"a run must have a finite length, got {seconds} s")
    start = first_ns if first_ns >= REAL_NS else first_ns + EPOCH_NS
    return start, start + round(seconds * NS_PER_S)

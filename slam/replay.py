# SPDX-License-Identifier: Apache-2.0
"""Feed one stream to several SLAMs, frame by frame, and keep what each of them said."""

import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from slam.answers import (
    asked,
    asked_at_end,
    asked_changes,
    asked_landmarks,
    asked_map,
    asked_trajectory,
)
from slam.constant_velocity import ConstantVelocity
from slam.errors import InvalidValueError, MobiliaError, SlamFailedError
from slam.estimate import Changes, Estimate, Landmarks, Raster
from slam.frames import Float, Frame, Stream
from slam.interface import (
    CanSave,
    HasChanges,
    HasLandmarks,
    RunsAtTheEnd,
    SaysCells,
    SlamSystem,
    told,
)
from slam.one_scanner import for_several
from slam.oracle import shown
from slam.system import create
from slam.trajectory import Trajectory

__all__ = ["Replay", "Track", "primary_of", "systems_named"]


@dataclass(eq=False)
class Track:
    """One SLAM's run: every online estimate and what it cost.

    durations_s  processor time of each ``update`` (all threads), s; a figure about the machine,
                 never part of a result that must repeat. A system in a process of its own says its
                 processor time by a method ``processor_s()``
    """

    name: str
    system: SlamSystem
    estimates: list[Estimate] = field(default_factory=list)
    durations_s: list[float] = field(default_factory=list)
    _finished: int = 0  # estimates of which ``estimates_at_end`` was asked
    _failed: bool = False  # a program over files; it is not asked again
    _forgotten: int = 0  # scans whose estimates are not kept

    def online(self) -> Trajectory:
        """The poses as they were reported at the time; of a program over files, its own.

        Raises ``SlamFailedError`` when ``finish`` does, and not a second time. A program over files
        that failed has none.
        """
        self.finish()
        return Trajectory(
            stamps_ns=self._stamps(),
            poses=np.array([e.T_map_robot for e in self.estimates]).reshape(-1, 3),
        )

    def _stamps(self) -> NDArray[np.int64]:
        return np.array([e.stamp_ns for e in self.estimates], dtype=np.int64)

    def finish(self) -> None:
        """Let a system that ``RunsAtTheEnd`` run over the frames so far, once; nothing for others.

        Its estimates take the place of those it gave at the time. Raises ``SlamFailedError``.
        """
        system = self.system
        if not isinstance(system, RunsAtTheEnd) or self._failed:
            return
        if self._finished == len(self.estimates):
            return
        with self._named("estimates_at_end()"), self._none_if_it_fails():
            estimates, spent_s = asked_at_end(system, self._stamps())
        self._finished = len(estimates)
        self.estimates[:] = estimates
        self.durations_s[:] = [a + b for a, b in zip(self.durations_s, spent_s, strict=True)]

    @contextmanager
    def _none_if_it_fails(self) -> Iterator[None]:
        """What a program over files said before its end was odometry: no result of its own."""
        try:
            yield
        except SlamFailedError:
            if isinstance(self.system, RunsAtTheEnd):
                self._failed = True
                self.estimates.clear()
                self.durations_s.clear()
            raise

    def final(self) -> Trajectory | None:
        """The poses as the system sees them now, None where they are the online ones."""
        online = self.online()
        with self._named("trajectory()"):
            final = asked_trajectory(self.system, online.stamps_ns)
        same = np.array_equal(final.stamps_ns, online.stamps_ns) and np.array_equal(
            final.poses, online.poses
        )
        return None if same else final

    def map(self) -> Raster | None:
        """The map now; raises ``SlamFailedError`` for what no map can be."""
        with self._named("map()"):
            return asked_map(self.system)

    def landmarks(self) -> Landmarks | None:
        """Its landmarks, None for a system without; raises ``SlamFailedError`` as ``map`` does."""
        if not isinstance(self.system, HasLandmarks):
            return None
        with self._named("landmarks()"):
            return asked_landmarks(self.system)

    def changes(self) -> Changes | None:
        """What moved lately, None where it cannot say; raises ``SlamFailedError`` as ``map``."""
        if not isinstance(self.system, HasChanges):
            return None
        with self._named("changes()"):
            return asked_changes(self.system)

    def save(self, path: Path) -> bool:
        """Let it write its map; whether it can. Raises ``OutputError``, ``SlamFailedError``."""
        if not isinstance(self.system, CanSave):
            return False
        with self._named("save()"):
            try:
                self.system.save(path)
            except MobiliaError:
                raise
            except Exception as error:  # somebody else's code raises whatever it likes
                raise SlamFailedError(f"raised {told(error)}") from error
        return True

    def cells_hold(self) -> str:
        """What the cells of its map hold, "" where it does not say."""
        system = self.system
        return str(system.cells_hold) if isinstance(system, SaysCells) else ""

    def covariances(self) -> Float:
        """(n, 3, 3) online covariances in the map frame."""
        return np.array([e.covariance for e in self.estimates]).reshape(-1, 3, 3)

    @contextmanager
    def _named(self, what: str) -> Iterator[None]:
        try:
            yield
        except SlamFailedError as error:
            raise error.at(f"SLAM '{self.name}', {what}") from error

    def take(self, frame: Frame) -> Estimate:
        """One update, timed; raises ``SlamFailedError`` when the system does."""
        clock = getattr(self.system, "processor_s", time.process_time)
        start = clock()
        number = self._forgotten + len(self.estimates)
        with self._named(f"scan {number},"), self._none_if_it_fails():
            estimate = asked(self.system, frame)
        self.durations_s.append(clock() - start)
        self.estimates.append(estimate)
        return estimate

    def forget(self, kept: int) -> None:
        """Keep the last estimates only."""
        self._forgotten += max(len(self.estimates) - kept, 0)
        del self.estimates[:-kept], self.durations_s[:-kept]

    def survive(self, frames: Iterable[Frame]) -> SlamFailedError | None:
        """Take every frame, stripped of truth; what ended it, None when it came through.

        For comparisons: a system that fails has lost this run, the others go on.
        """
        for frame in frames:
            try:
                self.take(shown(self.system, frame))
            except SlamFailedError as error:
                return error
        try:
            self.finish()
        except SlamFailedError as error:
            return error
        return None


@dataclass(eq=False)
class Replay:
    """Several SLAMs on one stream. ``truth()`` is None until a frame carried one."""

    tracks: dict[str, Track]
    _stamps: list[int] = field(default_factory=list)
    _poses: list[Float] = field(default_factory=list)

    @classmethod
    def of(cls, systems: Mapping[str, SlamSystem]) -> "Replay":
        """A replay with one track per named system."""
        return cls({name: Track(name, system) for name, system in systems.items()})

    def run(self, frames: Iterable[Frame]) -> Iterator[Frame]:
        """Give each frame, stripped of truth, to every system; yield it back with its truth.

        In a stream without odometry, each gets that of its own last motion; in one of several
        scanners, who cannot take them the scans of the first.
        """
        if isinstance(frames, Stream) and frames.metadata.others:
            for track in self.tracks.values():
                track.system = for_several(track.system)
        measured = not isinstance(frames, Stream) or frames.metadata.odometry
        priors = {} if measured else {name: ConstantVelocity() for name in self.tracks}
        for frame in frames:
            for name, track in self.tracks.items():
                given = priors[name].frame(frame, track.estimates) if priors else frame
                track.take(shown(track.system, given))
            if frame.truth is not None:
                self._stamps.append(frame.stamp_ns)
                self._poses.append(frame.truth)
            yield frame

    def forget(self, kept: int) -> None:
        """Keep the last estimates and true poses only: of a run that has no end."""
        for track in self.tracks.values():
            track.forget(kept)
        del self._stamps[:-kept], self._poses[:-kept]

    def truth(self) -> Trajectory | None:
        """The true poses seen so far, in the world frame."""
        if not self._stamps:
            return None
        return Trajectory(
            stamps_ns=np.array(self._stamps, dtype=np.int64), poses=np.array(self._poses)
        )


def systems_named(names: Sequence[str]) -> dict[str, SlamSystem]:
    """Fresh systems by name, odometry among them as the null system."""
    if not names:
        raise InvalidValueError("name at least one SLAM")
    wanted = dict.fromkeys([*names, "odometry"])
    return {name: create(name) for name in wanted}


def primary_of(replay: Replay) -> str:
    """The system a run is about: the first that is not odometry."""
    return next((n for n in replay.tracks if n != "odometry"), "odometry")

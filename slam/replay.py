# SPDX-License-Identifier: Apache-2.0
"""Feed one stream to several SLAMs, frame by frame, and keep what each of them said."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np

from slam.errors import SlamFailedError
from slam.frames import Float, Frame
from slam.system import Estimate, Raster, SlamSystem, told
from slam.trajectory import Trajectory


@dataclass(eq=False)
class Track:
    """One SLAM's run: every online estimate and what it cost.

    durations_s  processor time of each ``update`` (all threads), s; a figure about the machine,
                 never part of a result that must repeat
    """

    name: str
    system: SlamSystem
    estimates: list[Estimate] = field(default_factory=list)
    durations_s: list[float] = field(default_factory=list)

    def online(self) -> Trajectory:
        """The poses as they were believed at the time."""
        return Trajectory(
            stamps_ns=np.array([e.stamp_ns for e in self.estimates], dtype=np.int64),
            poses=np.array([e.T_map_robot for e in self.estimates]).reshape(-1, 3),
        )

    def final(self) -> Trajectory | None:
        """The poses as the system sees them now, None where they are the online ones."""
        online = self.online()
        try:
            final: object = self.system.trajectory()
        except Exception as error:
            raise SlamFailedError(
                f"SLAM '{self.name}': trajectory() raised {told(error)}"
            ) from error
        if not isinstance(final, Trajectory):
            raise SlamFailedError(
                f"SLAM '{self.name}': trajectory() returned no Trajectory but {final!r:.80}"
            )
        if not np.isin(online.stamps_ns, final.stamps_ns).all():
            raise SlamFailedError(
                f"SLAM '{self.name}': trajectory() has {len(final)} poses and leaves out frames; "
                f"it must have one for each of the {len(online)} updates"
            )
        same = np.array_equal(final.stamps_ns, online.stamps_ns) and np.array_equal(
            final.poses, online.poses
        )
        return None if same else final

    def map(self) -> Raster | None:
        """The map now; raises ``SlamFailedError`` for what no map can be."""
        try:
            raster: object = self.system.map()
        except Exception as error:
            raise SlamFailedError(f"SLAM '{self.name}': map() raised {told(error)}") from error
        if raster is None:
            return None
        if not isinstance(raster, Raster):
            raise SlamFailedError(
                f"SLAM '{self.name}': map() returned no Raster or None but {raster!r:.80}"
            )
        if raster.values.size == 0:
            return None
        if raster.T_map_origin[2] != 0.0:
            raise SlamFailedError(
                f"SLAM '{self.name}': map() must lie along the map's axes, its origin is turned by "
                f"{raster.T_map_origin[2]} rad"
            )
        return raster

    def covariances(self) -> Float:
        """(n, 3, 3) online covariances in the map frame."""
        return np.array([e.covariance for e in self.estimates]).reshape(-1, 3, 3)

    def _where(self) -> str:
        return f"SLAM '{self.name}', scan {len(self.estimates)},"

    def take(self, frame: Frame) -> Estimate:
        """One update, timed; raises ``SlamFailedError`` when the system does."""
        start = time.process_time()
        try:
            estimate: object = self.system.update(frame)
        except Exception as error:
            raise SlamFailedError(f"{self._where()} raised {told(error)}") from error
        self.durations_s.append(time.process_time() - start)
        if not isinstance(estimate, Estimate):
            raise SlamFailedError(f"{self._where()} returned no Estimate but {estimate!r:.80}")
        if estimate.stamp_ns != frame.stamp_ns:
            raise SlamFailedError(
                f"{self._where()} returned an estimate for {estimate.stamp_ns} ns instead of "
                f"{frame.stamp_ns} ns"
            )
        self.estimates.append(estimate)
        return estimate

    def survive(self, frames: Iterable[Frame]) -> SlamFailedError | None:
        """Take every frame, stripped of truth; what ended it, None when it came through.

        For comparisons: a system that fails has lost this run, the others go on.
        """
        for frame in frames:
            try:
                self.take(frame.without_truth())
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
    def of(cls, systems: Mapping[str, SlamSystem]) -> Replay:
        """A replay with one track per named system."""
        return cls({name: Track(name, system) for name, system in systems.items()})

    def run(self, frames: Iterable[Frame]) -> Iterator[Frame]:
        """Give each frame, stripped of truth, to every system; yield it back with its truth."""
        for frame in frames:
            blind = frame.without_truth()
            for track in self.tracks.values():
                track.take(blind)
            if frame.truth is not None:
                self._stamps.append(frame.stamp_ns)
                self._poses.append(frame.truth)
            yield frame

    def truth(self) -> Trajectory | None:
        """The true poses seen so far, in the world frame."""
        if not self._stamps:
            return None
        return Trajectory(
            stamps_ns=np.array(self._stamps, dtype=np.int64), poses=np.array(self._poses)
        )

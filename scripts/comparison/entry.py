# SPDX-License-Identifier: Apache-2.0
"""One SLAM on one recorded run: what it believed, its memory, and the row that scores it."""

import ctypes
import gc
import json
import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from scripts.comparison.maps import MapJudge
from scripts.comparison.recording import Recording, load
from scripts.metrics import table
from scripts.metrics.judged import Judged
from slam.errors import SlamFailedError
from slam.frames import NS_PER_S, Float, Frame
from slam.guests import Limits, limited
from slam.oracle import shown
from slam.oracle_map import MapOracle
from slam.replay import Track
from slam.system import Raster, create
from slam.trajectory import Trajectory
from slam.variants import MAP_ORACLE

_STATUS, _CLEAR = Path("/proc/self/status"), Path("/proc/self/clear_refs")


class PeakMemory:
    """Growth of the process's resident memory over what it was at the start, at its highest.

    Between ``begin`` and ``end`` the high-water mark counts, elsewhere nothing: what a comparison
    itself holds for a moment is left out, what it keeps is not. NaN where the kernel does not say.
    """

    def __init__(self) -> None:
        gc.collect()
        with suppress(OSError, AttributeError):  # of another C library
            ctypes.CDLL(None).malloc_trim(0)  # what is freed goes back: the next one's growth shows
        self._base_kb = reading_kb("VmRSS")
        self._peak_kb = self._base_kb

    def begin(self) -> None:
        """Forget the peak so far."""
        try:
            _CLEAR.write_text("5")  # proc(5)
        except OSError:
            self._peak_kb = math.nan

    def end(self) -> None:
        """Note the peak since ``begin``."""
        self._peak_kb = max(self._peak_kb, reading_kb("VmHWM"))  # NaN stays: it compares False

    def growth_bytes(self) -> float:
        """So much more than at the start."""
        return (self._peak_kb - self._base_kb) * 1024.0


def reading_kb(name: str) -> float:
    """A line of this process's status file, "VmRSS" or "VmHWM", kB; NaN without one."""
    with suppress(OSError):
        for line in _STATUS.read_text().splitlines():
            if line.startswith(name + ":"):
                return float(line.split()[1])
    return math.nan


WARM_SCANS = 12  # of a throw-away instance, so that no figure holds the loading of code
UNKNOWN = 255  # of a map on file; else 0 (free) to 254 (occupied)
_warm: set[str] = set()


def enter(
    path: Path,
    *,
    recording: str,
    slam: str,
    scan_limit_s: float = Limits.scan_s,
    judge_maps: bool = True,
) -> None:
    """A job: run ``slam`` over the file ``recording`` (beside ``path``'s folder), write ``path``.

    Without ``judge_maps`` the last map is kept, but none is held against the truth.

    A SLAM that fails, even at its start, is scored as such. Whatever is not ours runs in a process
    of its own, which it may crash or hang for ``scan_limit_s`` at a scan.
    """
    out = path.parent.parent
    drive = load(out / recording)
    limits = Limits(scan_s=scan_limit_s)
    _warm_up(slam, drive.frames, limits)
    run = Entry(slam, drive, limits, judge_maps=judge_maps)
    run.over(drive.frames)
    np.savez_compressed(path, **run.arrays())


def _warm_up(slam: str, frames: Sequence[Frame], limits: Limits) -> None:
    if slam in (*_warm, MAP_ORACLE) or ":" in slam:  # the latter begin again with each run
        return
    with suppress(SlamFailedError):  # the run itself will tell
        track = Track(name=slam, system=limited(slam, limits))
        for frame in frames[:WARM_SCANS]:
            track.take(shown(track.system, frame))
        track.map()
    _warm.add(slam)


class Entry:
    """A SLAM's run, scan by scan, with its maps judged on the way."""

    def __init__(
        self, slam: str, drive: Recording, limits: Limits, *, judge_maps: bool = True
    ) -> None:
        self.drive = drive
        self.judge = MapJudge(drive) if judge_maps else None
        self.memory = PeakMemory()
        self.failure: SlamFailedError | None = None
        self.track = Track(name=slam, system=create("odometry"))  # if it cannot be made
        try:
            self.track.system = system = limited(slam, limits)
            if isinstance(system, MapOracle):
                system.know(drive.static_map, drive.truth().poses[0])
        except SlamFailedError as error:
            self.failure = error
        self.raster: Raster | None = None
        self.final: Any = None

    def over(self, frames: Sequence[Frame]) -> None:
        """All scans, or those up to its failure."""
        if self.failure is not None:
            return
        frames = [shown(self.track.system, frame) for frame in frames]
        try:
            for k, frame in enumerate(frames):
                self.memory.begin()
                self.track.take(frame)
                self.memory.end()
                if self.judge is not None and self.judge.wants_map(k):
                    self.raster = self.track.map()
                    self.judge.judge(k, self.raster)
            self.raster = self.track.map()
            self.final = self.track.final()
        except SlamFailedError as error:
            self.failure = error

    def arrays(self) -> dict[str, Any]:
        """What the file holds: arrays, and the row of ``runs.csv`` as JSON."""
        track, raster = self.track, self.raster
        online = track.online()
        row = scored(track, self.final, self.failure, self.drive.truth())
        grown = getattr(track.system, "memory_growth_bytes", self.memory.growth_bytes)()
        row["peak_memory_mb"] = None if grown is None else grown / 1e6
        row |= {} if self.judge is None else self.judge.scores()
        arrays: dict[str, Any] = {
            "stamps_ns": online.stamps_ns,
            "poses": online.poses,
            "covariances": track.covariances(),
            "converged": np.array([e.converged for e in track.estimates], dtype=np.bool_),
            "milliseconds": np.array(track.durations_s) * 1e3,
            "row": json.dumps(row),
        }
        if raster is not None:
            arrays |= {
                "map": _bytes(raster.values),
                "map_resolution_m": raster.resolution_m,
                "T_map_origin": raster.T_map_origin,
            }
        return arrays


def _bytes(values: Float | Any) -> Any:
    """A raster's values in 0..254, ``UNKNOWN`` for NaN."""
    known = np.nan_to_num(values) * 254.0
    return np.where(np.isnan(values), UNKNOWN, np.round(known)).astype(np.uint8)


STEADY_SCANS = 5  # timings count after this


def scored(
    track: Track, final: Trajectory | None, failure: SlamFailedError | None, truth: Trajectory
) -> dict[str, Any]:
    """The row of one SLAM, its maps and identity aside; None where there is no number."""
    steady_s = np.array(track.durations_s[STEADY_SCANS:])
    judged = replace(Judged.of(track, None, final), steady_s=steady_s)
    row: dict[str, Any] = {"scans": len(track.estimates), **_computed(judged), "failure": None}
    online = track.online()
    lost_at_s = replace(judged, truth=truth).lost_s if len(online) else None
    outcome = "finished" if lost_at_s is None else "lost"
    if failure is None:
        row |= _computed(replace(judged, truth=truth))
    else:
        outcome, row["failure"] = failure.outcome, str(failure)
        if lost_at_s is None:  # at the scan that it did not answer
            k = min(len(track.estimates), len(truth) - 1)
            lost_at_s = float(truth.stamps_ns[k] - truth.stamps_ns[0]) / NS_PER_S
    return row | {"outcome": outcome, "lost": int(lost_at_s is not None), "lost_at_s": lost_at_s}


def _computed(judged: Judged) -> dict[str, Any]:
    """The columns that the table of metrics computes, those without a value left out."""
    values = {key: table.METRICS[key].of(judged) for key in table.COLUMNS}
    return {key: value for key, value in values.items() if value is not None}

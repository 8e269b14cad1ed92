# SPDX-License-Identifier: Apache-2.0
"""What each part of the SLAM is worth on the tracks of the benchmark: one taken out at a time.

``python -m scripts.experiments.ablation out/benchmark --jobs 2`` after ``mobilia benchmark``, whose
recordings it runs over.

A cell: drift (RPE per metre, cm/m, geometric mean over levels and seeds), and the runs lost. The
last column is the geometric mean over the tracks, but for those on which the robot is carried off:
there, drift is the way that it was carried. "oracle" sees no returns from what can move.
"""

from __future__ import annotations

import argparse
import logging
import math
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from scripts import workers
from scripts.benchmark.board import markdown_table
from scripts.benchmark.scores import LEAST_DRIFT
from scripts.benchmark.tracks import LEVELS, TEST, TRACKS, TRAIN, chosen
from scripts.comparison.plan import RECORDINGS
from scripts.comparison.recording import load
from scripts.metrics.judged import Judged, lost_s
from slam.errors import InvalidValueError
from slam.oracle import shown
from slam.replay import Track
from slam.system import create
from slam.variants import named

CM = 100.0
PARTS: Mapping[str, Mapping[str, float]] = {
    "whole": {},
    "no short-term memory (`short_term_weight` 0)": {"short_term_weight": 0.0},
    "no long-term trace (`trace_s` 0)": {"trace_s": 0.0},
    "all returns vote (`standing.settled_s` 0)": {"standing.settled_s": 0.0},
    "what left is not looked for (`standing.left_s` 0)": {"standing.left_s": 0.0},
    "what came is not looked for (`standing.came_s` 0)": {"standing.came_s": 0.0},
    "odometry over seconds not asked (`standing.disagreed` 0)": {"standing.disagreed": 0.0},
    "never in doubt (`carried_per_h` 0)": {"carried_per_h": 0.0},
    "slips not looked for (`relocalise.least_near` 1e6)": {"tracking.relocalise.least_near": 1e6},
}


@dataclass(frozen=True, kw_only=True)
class Run:
    """One SLAM over one recording of a track."""

    track: str
    slam: str
    recording: Path


@dataclass(frozen=True, kw_only=True)
class Result:
    """What came out: drift in m/m, and whether it got lost."""

    run: Run
    drift: float
    lost: bool


def judged(run: Run) -> Result:
    """The run made, and held against the truth."""
    logging.disable(logging.WARNING)
    drive = load(run.recording)
    track = Track(name=run.slam, system=create(run.slam))
    for frame in drive.frames:
        track.take(shown(track.system, frame))
    held = Judged.of(track, drive.truth())
    drift = held.rpe("m", 0)
    if drift is None:
        raise InvalidValueError(f"{run.recording} is shorter than a metre")
    return Result(run=run, drift=drift, lost=lost_s(held.pairs, held.known) is not None)


def runs(folder: Path, tracks: Sequence[str], levels: Sequence[float], seeds: int) -> list[Run]:
    """Of every part on the recordings that the benchmark left in ``folder``."""
    found = []
    for track in chosen(tracks):
        out = folder / track.name
        for own in (track.test, track.train):
            plan = track.plan(("odometry",), own[:seeds], levels=tuple(levels))
            there = [
                path
                for run in plan.runs()
                for path in sorted((out / RECORDINGS).glob(f"{run.name}-*.npz"))[:1]
            ]
            names = [named("shunting", changes) for changes in PARTS.values()]
            found += [
                Run(track=track.name, slam=slam, recording=path)
                for path in there
                for slam in (*names, track.oracle)
            ]
    if not found:
        raise InvalidValueError(f"{folder} holds no recordings of these tracks and levels")
    return found


def table(results: Sequence[Result]) -> str:
    """Markdown: a row for each part, a column for each track."""
    tracks = list(dict.fromkeys(one.run.track for one in results))
    lines = []
    rows = {title: named("shunting", changes) for title, changes in PARTS.items()}
    for title, slam in {**rows, "oracle": ""}.items():
        cells, means = [], []
        for track in tracks:
            wanted = slam or TRACKS[track].oracle
            own = [r for r in results if (r.run.track, r.run.slam) == (track, wanted)]
            logs = [math.log(max(one.drift, LEAST_DRIFT)) for one in own]
            mean = math.exp(sum(logs) / len(logs))
            if not any(sets.get("kidnap_every_s") for sets in TRACKS[track].sets):
                means.append(math.log(mean))
            cells.append(f"{CM * mean:.2f}, {sum(one.lost for one in own)} of {len(own)}")
        lines.append([title, *cells, f"{CM * math.exp(sum(means) / len(means)):.2f}"])
    return markdown_table(["taken out", *tracks, "all"], lines, left=1)


def main(arguments: list[str] | None = None) -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path, help="of mobilia benchmark")
    parser.add_argument("--tracks", nargs="+", default=list(TRACKS))
    parser.add_argument("--levels", type=float, nargs="+", default=list(LEVELS[-2:]))
    parser.add_argument("--seeds", type=int, default=len(TEST), help="at most")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    wanted = parser.parse_args(arguments)
    todo = runs(wanted.folder, wanted.tracks, wanted.levels, min(wanted.seeds, len(TRAIN)))
    print(table(list(workers.each(judged, todo, jobs=wanted.jobs))))
    return 0


if __name__ == "__main__":
    sys.exit(main())

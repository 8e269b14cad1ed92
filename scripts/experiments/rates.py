# SPDX-License-Identifier: Apache-2.0
"""Does the SLAM work at any scan rate? ``python -m scripts.experiments.rates``.

Each stream is simulated once at 37.5 scans a second, and replayed with one scan in so many. Between
the scans that are kept, odometry sums up. Every number of the SLAM stays the same. The error is
unaligned and online, up to a loss, and without the 10 s after the robot was carried elsewhere
(``scripts.metrics.judged``).

Streams are drives on training seeds: a scene at a dynamism, or a track at a level. Scanners
err by noise only. Recordings stay in ``--folder``. Writes ``docs/results/rates.json`` and the
tables of ``docs/rates.md``.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from fractions import Fraction
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import scenes
from scripts import workers
from scripts.benchmark.tracks import chosen
from scripts.checked import whole
from scripts.comparison.recording import load
from scripts.experiments.measured import add_options, head, seeds_of, table
from scripts.experiments.recorded import RecordedStream, make_missing
from scripts.marks import fill_page
from scripts.metrics.judged import Judged, world_truth
from scripts.result_files import write
from sim.core.versions import WORLD
from sim.recording.recipe import Recipe
from slam import create
from slam.errors import MobiliaError
from slam.evaluation import lost
from slam.frames import NS_PER_S, Frame
from slam.frontend.odometry_sum import MotionSum
from slam.oracle import shown
from slam.replay import Track

PAGE, MARK = Path("docs/rates.md"), "rates"
STREAMS = (
    "office",
    "arena",
    "rush-hour",
    "slow-scans",
    "kidnapped-in-a-crowd",
)  # scenes, and tracks by their names
SLAMS = ("shunting", "oracle(shunting)")
LEVEL = 0.5  # of each
EVERY = (38, 19, 8, 4, 2, 1)  # one scan in so many: about 1, 2, 5, 10, 19 and 37.5 a second
FULL_HZ = Fraction(75, 2)  # scans a second of the LMS-221
CM, PERCENT = 100.0, 100.0
Row = dict[str, Any]


@dataclass(frozen=True, kw_only=True)
class Drive(RecordedStream):
    """One stream at the full rate."""

    stream: str
    level: float
    recipe: Recipe

    @property
    def name(self) -> str:
        """Of its recording, without the ending."""
        return f"{self.stream}_{self.level:g}_s{self.recipe.seed}_{self.recipe.seconds:g}s"

    def simulated(self) -> dict[str, Any]:
        """Its recipe, with every scan."""
        return {"every": 1, **asdict(self.recipe)}


def drive(name: str, level: float, seed: int, seconds: float) -> Drive:
    """A scene at that dynamism, or that level of a track, which lasts as the track does.

    Raises ``UnknownNameError`` for neither, ``InvalidValueError`` for a level that a track has not.
    """
    if name in scenes.names():
        recipe = Recipe(
            scene=name, seed=seed, dynamism=level, seconds=seconds, scanner="noise"
        )  # fmt: skip
    else:
        plan = chosen([name])[0].plan((), (seed,), levels=(level,))
        recipe = plan.recipe(plan.runs()[0])
    return Drive(stream=name, level=level, recipe=recipe)


def kept(frames: Sequence[Frame], every: int) -> list[Frame]:
    """The first frame of each ``every``, with the covariance of all the motion in between."""
    out, motion = [], MotionSum()
    for k, frame in enumerate(frames):
        motion.add(frame.odometry)
        if k % every == 0:
            out.append(motion.passed_on(frame))
    return out


def spared(frames: Sequence[Frame]) -> NDArray[np.bool_]:
    """(n,) those that do not count for a loss, for the robot was carried (at the full rate)."""
    truth = world_truth(frames)
    seconds = (truth.stamps_ns - truth.stamps_ns[0]) / NS_PER_S
    return lost.excused(seconds, truth.poses[:, :2])


def loss(run: Judged, excused: NDArray[np.bool_]) -> tuple[float | None, float]:
    """When it was lost, s, None for never; root mean square error, m, of what counts before."""
    seconds = (run.pairs.stamps_ns - run.pairs.stamps_ns[0]) / NS_PER_S
    off, turned = run.pairs.distances, run.pairs.errors[:, 2]
    at = lost.lost_at(seconds, np.where(excused, 0.0, off), np.where(excused, 0.0, turned))
    counts = ~excused & (seconds < (math.inf if at is None else at))
    return at, math.sqrt(float((off[counts] ** 2).mean()))


def judged(job: tuple[Drive, str, int], folder: Path) -> Row:
    """One run of a SLAM at one rate."""
    one, slam, every = job
    whole = load(one.path(folder)).frames
    frames, system = kept(whole, every), create(slam)
    track = Track(one.name, system)
    for frame in frames:
        track.take(shown(system, frame))
    run = Judged.of(track, world_truth(frames))
    off, converged, due = run.is_off(), run.converged(), run.is_due()
    lost_s, error_m = loss(run, spared(whole)[::every])
    return {
        "slam": slam,
        "stream": one.stream,
        "seed": one.recipe.seed,
        "every": every,
        "scans": len(frames),
        "ate_m": run.ate(),
        "error_m": error_m,
        "lost_s": lost_s,
        "silent": run.silent_share(),
        "due": int(due.sum()),
        "told": int((due & run.is_told()).sum()),
        "good": int((~off).sum()),
        "false": int((~off & ~converged).sum()),
        "nees_over_3": run.nees_over_3(),
    }


def hz(every: int) -> str:
    """Scans a second, as printed."""
    return f"{float(FULL_HZ / every):.3g}"


def summary(rows: Sequence[Row]) -> list[str]:
    """Of the runs of one cell: error, losses, silence, admissions, false alarms, NEES."""
    errors = np.array([row["error_m"] for row in rows])
    gone, due = sum(row["lost_s"] is not None for row in rows), sum(row["due"] for row in rows)
    good = sum(row["good"] for row in rows)
    silent = np.array([row["silent"] or 0.0 for row in rows])
    nees = [math.nan if row["nees_over_3"] is None else row["nees_over_3"] for row in rows]
    told = f"{PERCENT * sum(row['told'] for row in rows) / due:.0f} %" if due else "–"
    return [
        f"{CM * math.exp(float(np.log(errors).mean())):.2f}",
        f"{CM * errors.max():.1f}",
        f"{gone} of {len(rows)}",
        f"{PERCENT * silent.mean():.1f} %",
        told,
        f"{PERCENT * sum(row['false'] for row in rows) / max(good, 1):.1f} %",
        f"{float(np.median(nees)):.2f}",
    ]


HEADS = (
    "stream", "scans/s", "error, cm", "worst, cm", "lost", "silent", "admitted", "false alarms",
    "NEES / 3",
)  # fmt: skip


def markdown(rows: Sequence[Row], slams: Sequence[str], told: str) -> str:
    """A table for each SLAM, stream by stream, and all of them."""
    parts = [told]
    for slam in slams:
        own = [row for row in rows if row["slam"] == slam]
        streams = dict.fromkeys(row["stream"] for row in own)
        cells = []
        for stream in (*streams, "all"):
            for every in dict.fromkeys(row["every"] for row in own):
                of = [r for r in own if r["every"] == every and stream in (r["stream"], "all")]
                cells.append([stream, hz(every), *summary(of)])
        parts += [f"`{slam}`:", table(HEADS, cells)]
    return "\n\n".join(parts)


def add_drive_options(
    parser: argparse.ArgumentParser, streams: Sequence[str], out: str, page: Path
) -> None:
    """``--streams``, ``--level``, ``--slams``, ``--folder``, and those of every experiment."""
    parser.add_argument("--streams", nargs="+", default=list(streams), help="scenes and tracks")
    parser.add_argument("--level", type=float, default=LEVEL, help="of dynamism, or of the track")
    parser.add_argument("--slams", nargs="+", default=list(SLAMS))
    parser.add_argument("--folder", type=Path, default=Path("out/rates"), help="of recordings")
    add_options(parser, out, page)
    parser.set_defaults(seeds=3, first_seed=0)


def drives(wanted: argparse.Namespace) -> list[Drive]:
    """All that these options ask for, recorded in the folder; raises as ``drive``."""
    found = [
        drive(name, wanted.level, seed, wanted.seconds)
        for name, seed in product(wanted.streams, seeds_of(wanted))
    ]
    make_missing(found, wanted.folder, wanted.jobs)
    return found


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description=__doc__)
    add_drive_options(parser, STREAMS, "rates.json", PAGE)
    parser.add_argument("--every", type=int, nargs="+", default=list(EVERY), help="scans")
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Record what is missing, print the tables, write the results and the page."""
    wanted = _parser().parse_args(arguments)
    told = (
        f"World {WORLD}, {wanted.seeds} drives of a stream, level {wanted.level:g}, training seeds "
        f"from {wanted.first_seed}; scenes for {wanted.seconds:g} s, tracks as long as they are. "
        f"Lost: {lost.LOST_RULE}."
    )
    try:
        for every in wanted.every:
            whole("--every", every, 1)
        first = head(wanted, MARK, arguments, "streams", "level", "slams", "every")
        jobs = list(product(drives(wanted), wanted.slams, wanted.every))
        call = partial(judged, folder=wanted.folder)
        rows = list(workers.each(call, jobs, jobs=wanted.jobs))
        order = {(d.stream, d.recipe.seed, s, e): k for k, (d, s, e) in enumerate(jobs)}
        rows.sort(key=lambda r: order[r["stream"], r["seed"], r["slam"], r["every"]])
        text = markdown(rows, wanted.slams, told)
        write(wanted.results, first, {"runs": {_key(row): row for row in rows}})
        if not wanted.no_page:
            fill_page(wanted.page, MARK, text)
    except (MobiliaError, OSError) as error:
        print(error, file=sys.stderr)
        return 1
    print(text)
    return 0


def _key(row: Row) -> str:
    return f"{row['stream']} {row['seed']} {row['slam']} {row['every']}"


if __name__ == "__main__":
    sys.exit(main())

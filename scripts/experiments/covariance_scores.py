# SPDX-License-Identifier: Apache-2.0
"""What smfeval says of the covariances: ``python -m scripts.experiments.covariance_scores``.

Needs the package smfeval (https://pypi.org/project/smfeval, tried with 0.4.0) in this interpreter.
Its commands ``score`` and ``nees`` read what ``mobilia export --to smfeval`` writes. Streams are
those of ``scripts.experiments.rates``, one scan in eight; recordings stay in ``--folder``, the
files that are scored beside them. Writes ``docs/results/covariance_scores.json`` and a table of
``docs/uncertainty.md``.

smfeval scores positions of three dimensions. A robot on a floor has two: z is known and exact. So
where a covariance is right, the median NEES is not 2.37 but 1.39, and the share within the 90 %
ellipsoid not 0.9 but 0.956.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from collections.abc import Sequence
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from scripts import workers
from scripts.comparison.recording import load
from scripts.experiments.measured import head, table
from scripts.experiments.rates import Drive, add_drive_options, drives, kept
from scripts.marks import fill_page
from scripts.names import file_name
from scripts.result_files import write
from sim.core.versions import WORLD
from slam import create, se2
from slam.errors import MissingDependencyError, MobiliaError
from slam.evaluation.wide_tum import write_wide_tum
from slam.oracle import shown
from slam.replay import Track
from slam.trajectory import Trajectory, write_tum

PAGE, MARK = Path("docs/uncertainty.md"), "covariance_scores"
STREAMS = ("office", "arena", "rush-hour")
EVERY = 8  # one scan in so many: 4.7 a second
LIMIT_S = 600.0  # that smfeval may take for a run
CM = 100.0
Row = dict[str, Any]


def exported(one: Drive, slam: str, folder: Path) -> tuple[Path, Path]:
    """The files of a run: online poses with covariances, and the true poses in the same map."""
    frames, system = kept(load(one.path(folder)).frames, EVERY), create(slam)
    track = Track(slam, system)
    for frame in frames:
        track.take(shown(system, frame))
    base = f"{one.name}_{file_name(slam)}"
    paths = folder / f"{base}.tum", folder / f"{base}_truth.tum"
    online = track.online()
    write_wide_tum(paths[0], online, track.covariances(), algorithm=slam)
    truth = [se2.between(frames[0].truth, frame.truth) for frame in frames]  # type: ignore[arg-type]
    write_tum(paths[1], Trajectory(stamps_ns=online.stamps_ns, poses=np.array(truth)))
    return paths


def asked(verb: str, estimate: Path, truth: Path) -> dict[str, Any]:
    """The report of ``smfeval VERB``.

    Raises ``MissingDependencyError`` where it does not run, ``MobiliaError`` after ``LIMIT_S``.
    """
    command = [sys.executable, "-m", "smfeval.cli.main", verb, "--json"]
    command += ["--ref-body-frame", "robot", "--ref-pose-frame", "map", str(estimate), str(truth)]
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=LIMIT_S)
    except subprocess.TimeoutExpired as error:
        raise MobiliaError(
            f"smfeval {verb} must end within {LIMIT_S:g} s, {estimate} takes it longer"
        ) from error
    if done.returncode != 0:
        raise MissingDependencyError(
            f"smfeval must run (pip install smfeval): {done.stderr.strip()[-300:]}"
        )
    report: dict[str, Any] = json.loads(done.stdout)
    return report


def scored(job: tuple[Drive, str], folder: Path) -> Row:
    """One run."""
    one, slam = job
    files = exported(one, slam, folder)
    scores, nees = asked("score", *files)["scores"], asked("nees", *files)
    return {
        "slam": slam,
        "stream": one.stream,
        "seed": one.recipe.seed,
        "scans": scores["translation_crps"]["n"],
        "crps_m": scores["translation_crps"]["mean"],
        "energy_m": scores["energy_score"]["mean"],
        "interval_m": scores["interval_score"]["mean"],
        "log_score": scores["log_score_translation"]["median"],
        "coverage": nees["coverage"],
        "nees_mean": nees["anees"]["anees"],
        "nees_median": nees["median_nees"],
    }


HEADS = (
    "stream", "SLAM", "CRPS, cm", "energy score, cm", "interval score, cm", "log score",
    "in the 90 % ellipsoid", "median NEES", "mean NEES",
)  # fmt: skip
CALIBRATED = ("a right covariance", "", "", "", "", "", "95.6 %", "1.39", "2")


def markdown(rows: Sequence[Row], told: str) -> str:
    """A line for each stream and SLAM, means over the drives; of the NEES medians."""
    cells: list[Sequence[str]] = []
    for stream, slam in dict.fromkeys((row["stream"], row["slam"]) for row in rows):
        of = [row for row in rows if (row["stream"], row["slam"]) == (stream, slam)]

        def mean(key: str, of: Sequence[Row] = of) -> float:
            return float(np.mean([row[key] for row in of]))

        cells.append(
            [
                stream, f"`{slam}`", f"{CM * mean('crps_m'):.2f}", f"{CM * mean('energy_m'):.2f}",
                f"{CM * mean('interval_m'):.1f}", f"{mean('log_score'):.1f}",
                f"{100.0 * mean('coverage'):.1f} %",
                f"{float(np.median([row['nees_median'] for row in of])):.2f}",
                f"{float(np.median([row['nees_mean'] for row in of])):.2f}",
            ]
        )  # fmt: skip
    return f"{told}\n\n{table(HEADS, [*cells, CALIBRATED])}"


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description=__doc__)
    add_drive_options(parser, STREAMS, "covariance_scores.json", PAGE)
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Export and score every run, print the table, write the results and the page."""
    wanted = _parser().parse_args(arguments)
    told = (
        f"World {WORLD}, {wanted.seeds} drives of a stream, level {wanted.level:g}, training seeds "
        f"from {wanted.first_seed}, 4.7 scans a second; scenes for {wanted.seconds:g} s, tracks as "
        "long as they are. Means over the drives, of the NEES the median drive."
    )
    try:
        first = head(wanted, MARK, arguments, "streams", "level", "slams")
        jobs = list(product(drives(wanted), wanted.slams))
        rows = list(workers.each(partial(scored, folder=wanted.folder), jobs, jobs=wanted.jobs))
        rows.sort(key=lambda row: (row["stream"], wanted.slams.index(row["slam"]), row["seed"]))
        text = markdown(rows, told)
        keyed = {f"{row['stream']} {row['seed']} {row['slam']}": row for row in rows}
        write(wanted.results, first, {"runs": keyed})
        if not wanted.no_page:
            fill_page(wanted.page, MARK, text)
    except (MobiliaError, OSError) as error:
        print(error, file=sys.stderr)
        return 1
    print(text)
    return 0


if __name__ == "__main__":
    sys.exit(main())

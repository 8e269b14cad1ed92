# SPDX-License-Identifier: Apache-2.0
"""The leaderboard's section over days: the SLAMs in buildings that go on over sessions.

``python -m scripts.benchmark.days out/days --slam shunting kiss-icp --jobs 2`` makes it alone.
"""

import argparse
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from scripts import workers
from scripts.benchmark.tracks import TEST, TRAIN
from scripts.comparison.tables import write_csv
from scripts.console import ended
from scripts.days import buildings as lives
from scripts.days import scores
from scripts.days.buildings import Buildings
from scripts.days.scores import Row
from scripts.jobs import try_names
from scripts.machine import machine, versions
from scripts.options import whole
from scripts.output import result_folder
from scripts.report import score_tables
from scripts.report.answer import ODOMETRY
from scripts.result_files import SCHEMA, load
from scripts.result_files import write as write_results
from sim.core.versions import WORLD
from sim.recording.recipe import Recipe
from slam.errors import LogFormatError

COMMAND = "days"
NAMES = ("days.csv", "days.json")
HEADING = "## Over days"
SCENE, CHANGES, SESSIONS, SECONDS = "random-rooms", (0.3, 0.6), 11, 60.0
QUICK_CHANGES, QUICK_SESSIONS, QUICK_SEEDS = CHANGES[:1], 4, 1
SEEDS = 6  # with fewer no median has an interval (``scripts.report.study.LEAST_RUNS``)
_WORDS = ("scene", "slam", "map", "failure")


def buildings(
    slams: Sequence[str], seeds: Sequence[int], *, quick: bool = False, seconds: float | None = None
) -> Buildings:
    """Those of the section: what moves stands still in a session, and elsewhere in the next.

    The rest is as ``mobilia lifelong --scene random-rooms --motion 0`` has it. A quick one is the
    beginning of the full ones: one share of change, fewer sessions.
    """
    return Buildings(
        slams=tuple(dict.fromkeys((*slams, ODOMETRY))),
        recipes=tuple(
            Recipe(
                scene=SCENE, seed=seed, dynamism=0.0, change=change,
                seconds=SECONDS if seconds is None else seconds,
            )
            for change in (QUICK_CHANGES if quick else CHANGES)
            for seed in seeds
        ),
        sessions=QUICK_SESSIONS if quick else SESSIONS,
    )  # fmt: skip


def head(of: Buildings) -> dict[str, Any]:
    """How it was made, for ``days.json``."""
    one = of.recipes[0]
    return {
        "schema": SCHEMA, "slams": list(of.slams), "scene": one.scene, "motion": one.dynamism,
        "changes": sorted({recipe.share_changed for recipe in of.recipes}),
        "seeds": sorted({recipe.seed for recipe in of.recipes}), "sessions": of.sessions,
        "seconds": one.seconds, "every": of.every, "scanner": one.scanner,
        "odometry": one.odometry, "world": WORLD, "versions": versions(), "machine": machine(),
    }  # fmt: skip


def write(folder: Path, told: Mapping[str, Any], rows: Sequence[Row]) -> None:
    """``days.csv`` and ``days.json``: a row for each building and SLAM."""
    write_csv(folder / NAMES[0], rows, scores.COLUMNS)
    named = {f"{row['change']:g} {row['seed']} {row['slam']}": row for row in rows}
    write_results(folder / NAMES[1], told, {"rows": named})


def read(path: Path) -> list[Row]:
    """The rows of a ``days.json``; ``LogFormatError`` for anything else."""
    rows = load(path).get("rows")
    if not isinstance(rows, dict) or not rows:
        raise LogFormatError(path, "no scores over days: it has no rows")
    try:
        return [
            {k: v if (v := row[k]) is None or k in _WORDS else float(v) for k in scores.COLUMNS}
            for row in rows.values()
        ]
    except (KeyError, TypeError, ValueError) as error:
        raise LogFormatError(path, f"no scores over days: {error!s:.80}") from error


def section(rows: Sequence[Row], *, tables: bool = True) -> str:
    """Markdown: what each share of change shows, and its table unless ``tables`` is off."""
    parts = [HEADING, _ABOUT.format(n=int(rows[0]["sessions"]))]
    for group, own in score_tables.groups(rows).items():
        parts.append(f"### {score_tables.where(group)}: {score_tables.size(own)}")
        parts.append("\n".join(f"- {line}" for line in score_tables.sentences(own)))
        if tables:
            parts.append(score_tables.table(own).markdown())
    return "\n\n".join(parts)


_ABOUT = (
    "Each SLAM lives in buildings of {n} sessions. Session 0 maps a building and lasts three times "
    "as long. From each session to the next the share *change* of things and doors is put "
    "elsewhere, and a session begins at an unknown start in the map of those before. A SLAM that "
    "cannot load a map starts anew in each, in a frame of its own. Early: sessions 1 to 5, late: "
    "the last five, a day each. Shares are of all sessions; the rest are medians over buildings, "
    "with 95 % intervals where there are six or more."
)


def summary(rows: Sequence[Row]) -> dict[str, dict[str, Any]]:
    """For ``leaderboard.json``: by change and SLAM, of each score value, interval and count."""
    found: dict[str, dict[str, Any]] = {}
    for row in scores.levels(rows):
        own = found.setdefault(f"{row['change']:g} {row['slam']}", {})
        own[row["metric"]] = {key: row[key] for key in ("value", "low", "high", "n")}
    return found


def carry_out(
    of: Buildings, out: Path, *, jobs: int = 1, cluster: str | None = None
) -> list[dict[str, Any]]:
    """The section alone, into a folder of its own; its rows."""
    try_names(of.slams, ())
    out, settings = out.absolute(), head(of)
    with result_folder(out, COMMAND, settings) as written:
        rows = lives.carry_out(of, out / lives.DAYS, jobs=jobs, cluster=cluster)
        with written() as staged:
            write(staged, settings, rows)
    return rows


@ended
def main(arguments: Sequence[str] | None = None) -> None:
    """Make it, and print it as Markdown."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("--slam", nargs="+", default=["shunting", "occupancy", "kiss-icp"])
    parser.add_argument("--seeds", type=int, help=f"default {SEEDS}, {QUICK_SEEDS} if --quick")
    parser.add_argument("--seconds", type=float)
    parser.add_argument("--train", action="store_true")
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--jobs", type=int, default=1)
    wanted = parser.parse_args(arguments)
    workers.check_jobs(wanted.jobs)
    known = TRAIN if wanted.train else TEST
    count = (QUICK_SEEDS if wanted.quick else SEEDS) if wanted.seeds is None else wanted.seeds
    whole("--seeds", count, 1, len(known))
    of = buildings(wanted.slam, known[:count], quick=wanted.quick, seconds=wanted.seconds)
    print(section(carry_out(of, wanted.out, jobs=wanted.jobs)))


if __name__ == "__main__":
    sys.exit(main())

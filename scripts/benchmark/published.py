# SPDX-License-Identifier: Apache-2.0
"""The runs that ship with the package: what every SLAM did on the public seeds, run by run.

A reader's SLAM gets a row between the others on the same recordings, without running the others.

    python -m scripts.benchmark.published out/quick out/top --commit HASH   # writes published.json
    python -m scripts.benchmark.published out/top --run shunting --levels 1 --seeds 20

Each row says which commit made it: rows that are not in the folders, or not of ``--only SLAM``,
stay as they are.
"""

import argparse
import sys
from collections.abc import Iterator, Sequence
from itertools import product
from pathlib import Path
from typing import Any

from scripts.benchmark.runs_file import CELLS, FILE, At, Commit, Results, Row, read, write
from scripts.benchmark.tracks import FRESH, LEVELS, TRACKS, Track, chosen
from scripts.comparison.folder import read as compared
from scripts.comparison.make import carry_out as compare
from scripts.comparison.plan import RECORDINGS, Plan
from scripts.comparison.recording import digest
from scripts.console import ended, note
from scripts.machine import machine, versions
from scripts.result_files import finite
from slam.errors import InvalidValueError
from slam.shaped import shaped


def digests(plan: Plan, folder: Path) -> dict[At, str]:
    """Of the recording of each level and seed of a comparison in ``folder``."""
    jobs = plan.recordings()
    files = {run: folder / RECORDINGS / jobs[run.name].file_name() for run in plan.runs()}
    return {(run.dynamism, run.seed): digest(file) for run, file in files.items()}


def write_from(
    folders: Sequence[Path], path: Path, commit: str, only: Sequence[str] | None = None
) -> Results:
    """Of folders of ``mobilia benchmark``, all tracks that are whole in them, beside what is there.

    commit  of the code that made their rows
    only    SLAMs whose rows are taken; None: all

    Raises ``InvalidValueError`` for two folders whose recordings differ, for what is no commit, and
    for SLAMs of ``only`` that have no row in the folders.
    """
    shaped("--commit", commit, Commit)
    made: Row = {"versions": versions(), "machine": machine()}
    before = read(path) if path.exists() else Results(runs={}, made_with=made)
    runs = {track: dict(own) for track, own in before.runs.items()}
    made_here: set[str] = set()
    for folder, track in product(folders, TRACKS.values()):
        if not (folder / track.name / "recipe.json").exists():
            continue
        there = runs.setdefault(track.name, {})
        for at, scans, own in _made(folder / track.name, track):
            rows = {slam: row | {"commit": commit} for slam, row in own.items()
                    if only is None or slam in only}  # fmt: skip
            known, others = there.get(at, (scans, {}))
            if known != scans:
                key = f"{track.name} {at[0]:g} {at[1]}"
                raise InvalidValueError(f"{folder}: {key}: other scans than in another folder")
            there[at] = (scans, {**others, **rows})
            made_here |= set(rows)
    if missing := sorted(set(only or ()) - made_here):
        raise InvalidValueError(
            f"--only {' '.join(missing)}: no row in {', '.join(map(str, folders))}"
        )
    earlier = before.made_with
    made["versions"] = {k: _each(earlier["versions"].get(k, v), v) for k, v in versions().items()}
    processors = (of["machine"]["processor"] for of in (earlier, made))
    made["machine"] = made["machine"] | {"processor": _each(*processors)}
    write(path, Results(runs=runs, made_with=made))
    return read(path)


def _made(folder: Path, track: Track) -> Iterator[tuple[At, str, dict[str, Row]]]:
    """Of each level and seed of a comparison: the digest of its scans, and a row of each SLAM."""
    done = compared(folder)
    asked = done.settings
    plan = track.plan(asked["slams"], tuple(asked["seeds"]), levels=tuple(asked["levels"]))
    for at, scans in digests(plan, folder).items():
        rows = (row for row in done.runs if (row["dynamism"], row["seed"]) == at)
        yield at, scans, {row["slam"]: {k: _short(row.get(k)) for k in CELLS} for row in rows}


def _each(*told: str) -> str:
    """Of lists with commas, each entry once."""
    return ", ".join(dict.fromkeys(", ".join(told).split(", ")))


def _short(value: Any) -> Any:
    """Six digits: nobody reads more, and all of this is in the package."""
    return float(f"{value:.6g}") if isinstance(value, float) and finite(value) else finite(value)


@ended
def main(arguments: Sequence[str] | None = None) -> None:
    """Run what is to be published, or write the file."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folders", type=Path, nargs="+", help="of mobilia benchmark, or --run")
    parser.add_argument("--out", type=Path, default=FILE)
    parser.add_argument("--commit", help="of the code that ran")
    parser.add_argument("--only", nargs="+", metavar="SLAM", help="take only their rows")
    parser.add_argument("--run", nargs="+", metavar="SLAM", help="only run these into the folder")
    parser.add_argument("--tracks", nargs="+", help="default the newest of all")
    parser.add_argument("--levels", type=float, nargs="+", default=list(LEVELS))
    parser.add_argument("--first", type=int, default=0, help="of the test seeds")
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--fresh", action="store_true", help=f"seeds from {FRESH[0]} on, instead")
    wanted = parser.parse_args(arguments)
    if wanted.run:
        for track in chosen(wanted.tracks):
            of = FRESH if wanted.fresh else track.test
            seeds = of[wanted.first : wanted.first + wanted.seeds]
            plan = track.plan(wanted.run, seeds, levels=tuple(wanted.levels))
            note(f"{track.name}: {track.about}")
            compare(plan, wanted.folders[0] / track.name)
        return
    if not wanted.commit:
        raise InvalidValueError("--commit must say of which code the runs are")
    made = write_from(wanted.folders, wanted.out, wanted.commit, wanted.only)
    print(f"{wanted.out}: {sum(map(len, made.runs.values()))} recordings")


if __name__ == "__main__":
    sys.exit(main())

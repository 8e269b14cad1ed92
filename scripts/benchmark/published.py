# SPDX-License-Identifier: Apache-2.0
"""The runs that ship with the package: what every SLAM did on the public seeds, run by run.

A reader's SLAM gets a row between the others on the same recordings, without running the others.

    python -m scripts.benchmark.published out/top --levels 1 --seeds 10 --run shunting karto
    python -m scripts.benchmark.published out/low --levels 0 0.25 0.5 0.75 --seeds 3 --run shunting
    python -m scripts.benchmark.published out/low out/top --commit HASH   # writes published.json
    python -m scripts.benchmark.published scripts/benchmark/published.json out/more --commit HASH

The first two go on where they were stopped. The last adds to a file of that commit: all rows are
of one.
"""

import argparse
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from scripts.benchmark.runs_file import COLUMNS, FILE, At, Commit, Made, Results, Row, read, write
from scripts.benchmark.tracks import LEVELS, TRACKS, Track, chosen
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


def write_from(folders: Sequence[Path], path: Path, commit: str) -> Results:
    """Of folders of ``mobilia benchmark`` or ``--run``, all tracks that are whole in them.

    folders  or files of this kind
    commit   of the code that made their rows

    Raises ``InvalidValueError`` for what is no commit, for folders without a track, a file of
    another commit and for two whose recordings differ.
    """
    shaped("--commit", commit, Commit)
    runs: dict[str, Made] = {}
    for folder in folders:
        for name, at, scans, rows in _made(folder, commit):
            there = runs.setdefault(name, {})
            known, others = there.get(at, (scans, {}))
            if known != scans:
                key = f"{name} {at[0]:g} {at[1]}"
                raise InvalidValueError(f"{folder}: {key}: other scans than in another folder")
            there[at] = (scans, {**others, **rows})
    if not runs:
        raise InvalidValueError(f"no track in {', '.join(map(str, folders))}")
    runs = {name: dict(sorted(runs[name].items())) for name in TRACKS if name in runs}
    made_with = {"commit": commit, "versions": versions(), "machine": machine()}
    write(path, Results(runs=runs, made_with=made_with))
    return read(path)


def _made(folder: Path, commit: str) -> Iterator[tuple[str, At, str, dict[str, Row]]]:
    """Of each track, level and seed: the digest of its scans, and a row of each SLAM."""
    if not folder.is_file():
        for track in TRACKS.values():
            if (folder / track.name / "recipe.json").exists():
                yield from _compared(folder / track.name, track)
        return
    known = read(folder)
    if known.made_with.get("commit") != commit:
        raise InvalidValueError(f"{folder}: of commit {known.made_with.get('commit')}")
    for name, made in known.runs.items():
        yield from ((name, at, *both) for at, both in made.items())


def _compared(folder: Path, track: Track) -> Iterator[tuple[str, At, str, dict[str, Row]]]:
    done = compared(folder)
    asked = done.settings
    plan = track.plan(asked["slams"], tuple(asked["seeds"]), levels=tuple(asked["levels"]))
    for at, scans in digests(plan, folder).items():
        rows = (row for row in done.runs if (row["dynamism"], row["seed"]) == at)
        cells = {row["slam"]: {k: _short(row.get(k)) for k in COLUMNS} for row in rows}
        yield track.name, at, scans, cells


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
    parser.add_argument("--run", nargs="+", metavar="SLAM", help="only run these into the folder")
    parser.add_argument("--tracks", nargs="+", help="default the newest of all")
    parser.add_argument("--levels", type=float, nargs="+", default=list(LEVELS))
    parser.add_argument("--seeds", type=int, default=1, help="the first so many that count")
    wanted = parser.parse_args(arguments)
    if wanted.run:
        for track in chosen(wanted.tracks):
            seeds = track.test[: wanted.seeds]
            plan = track.plan(wanted.run, seeds, levels=tuple(wanted.levels))
            note(f"{track.name}: {track.about}")
            compare(plan, wanted.folders[0] / track.name)
        return
    if not wanted.commit:
        raise InvalidValueError("--commit must say of which code the runs are")
    made = write_from(wanted.folders, wanted.out, wanted.commit)
    print(f"{wanted.out}: {sum(map(len, made.runs.values()))} recordings")


if __name__ == "__main__":
    sys.exit(main())

# SPDX-License-Identifier: Apache-2.0
"""The runs that ship with the package: what every SLAM did on the public seeds, run by run.

A reader's SLAM gets a row between the others on the same recordings, without running the others.
Each recording is named by its digest, so that nothing is compared on other scans.

    python -m scripts.benchmark.published out/quick out/top --commit HASH   # writes published.json
    python -m scripts.benchmark.published out/top --run shunting --levels 1 --seeds 20

Each row says which commit made it: rows that are not in the folders, or not of ``--only SLAM``,
stay as they are.
"""

import argparse
import sys
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Annotated, Any, Literal

from msgspec import Meta

from scripts.benchmark.submission import RUN
from scripts.benchmark.tracks import (
    FRESH,
    LEVELS,
    QUICK_LEVELS,
    TRACKS,
    Track,
    check_known,
    chosen,
)
from scripts.comparison.folder import read as compared
from scripts.comparison.make import carry_out as compare
from scripts.comparison.plan import RECORDINGS, Plan
from scripts.comparison.recording import digest
from scripts.comparison.rules import Columns, check_keys
from scripts.console import ended, note
from scripts.machine import machine, versions
from scripts.report.answer import ODOMETRY
from scripts.result_files import finite, load, write
from sim.core.versions import WORLD, world_of
from slam.errors import InvalidValueError, LogFormatError
from slam.shaped import shaped

FILE = Path(__file__).with_name("published.json")
SCHEMA, WHAT = 2, "published runs of the benchmark of mobilia"
CELLS = (
    "outcome", "lost", "lost_at_s", "error_tracking_m", "ate_unaligned_m", "rpe_m_per_m",
    "silent_share",
)  # fmt: skip
COLUMNS = (*CELLS, "commit")
MAX_SLAMS = 100
Row = dict[str, Any]
Digests = Mapping[tuple[float, int], str]  # of recordings, by level and seed


@dataclass(frozen=True, kw_only=True, eq=False)
class Published:
    """Runs by track, then by level and seed: the digest of the recording, and a row of each SLAM.

    made_with  versions and machine; where there were several, a list with commas
    """

    runs: Mapping[str, Mapping[tuple[float, int], tuple[str, Mapping[str, Row]]]]
    made_with: Mapping[str, Any]

    def has(self, track: str, digests: Digests | Sequence[tuple[float, int]], slam: str) -> bool:
        """Whether that SLAM made all these runs."""
        own = self.runs.get(track, {})
        return all(run in own and slam in own[run][1] for run in digests)

    def quick(self, tracks: Iterable[Track]) -> tuple[Track, ...]:
        """Those that count, and whose first seed is here at the levels of a quick benchmark."""
        return tuple(
            track for track in tracks
            if track.counts is not False
            and self.has(track.name, [(at, track.test[0]) for at in QUICK_LEVELS], ODOMETRY)
        )  # fmt: skip

    def rows(self, track: str, digests: Digests, without: Sequence[str]) -> list[Row]:
        """Rows as of ``runs.csv`` of the runs on these very recordings, but for some SLAMs."""
        own = self.runs.get(track, {})
        there = [run for run, digest in digests.items() if run in own and own[run][0] == digest]
        return [
            {
                "slam": slam, "dynamism": run[0], "seed": run[1], "failure": None,
                **{name: row[name] for name in CELLS},
            }
            for run in there
            for slam, row in own[run][1].items()
            if slam not in without
        ]  # fmt: skip

    def commits(self, slam: str, tracks: Iterable[Track]) -> list[str]:
        """Those that made its rows of these tracks, whichever made the most first."""
        made = Counter(
            slams[slam]["commit"]
            for track in tracks for _, slams in self.runs[track.name].values() if slam in slams
        )  # fmt: skip
        return [commit for commit, _ in made.most_common()]

    def others(self, track: str, digests: Digests) -> int:
        """How many of these recordings have another digest here."""
        own = self.runs.get(track, {})
        return sum(run in own and own[run][0] != digest for run, digest in digests.items())


def read(path: Path = FILE) -> Published:
    """Inverse of ``write_from``; ``LogFormatError`` for a file that is something else."""
    data = load(path, WHAT, SCHEMA)
    if data.get("what") != WHAT:
        raise LogFormatError(path, f"no {WHAT}")
    try:
        check_known(path, world_of(path, data), data["tracks"])
        check_keys(path, "", data, _HEAD)
        if data["columns"] != list(COLUMNS):
            raise LogFormatError(path, f"columns must be {', '.join(COLUMNS)}")
        runs: dict[str, dict[tuple[float, int], tuple[str, dict[str, Row]]]] = {}
        for key, told in data["runs"].items():
            track, level, seed = key.split(" ")
            at = (float(level), int(seed))
            check_keys(path, f"{key}: ", {"level": at[0], "seed": at[1], **told}, _RUN)
            if at[0] not in LEVELS:
                raise LogFormatError(path, f"{key}: level must be of {LEVELS}")
            if track not in data["tracks"]:
                raise LogFormatError(path, f"{key}: a track without its hash")
            rows = {slam: _row(path, f"{key}, {slam}: ", of) for slam, of in told["slams"].items()}
            runs.setdefault(track, {})[at] = (told["recording"], rows)
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise LogFormatError(path, f"no {WHAT}: {type(error).__name__}: {error}") from error
    return Published(runs=runs, made_with=data["made_with"])


def is_one(path: Path) -> bool:
    """Whether it says that it holds published runs; False for whatever cannot be read."""
    try:
        return bool(load(path, WHAT, SCHEMA).get("what") == WHAT)
    except LogFormatError:
        return False


def _row(path: Path, where: str, cells: Sequence[Any]) -> Row:
    row: Row = dict(zip(COLUMNS, cells, strict=True))
    check_keys(path, where, row, {name: _CELLS[name] for name in COLUMNS})
    return row


def digests(plan: Plan, folder: Path) -> dict[tuple[float, int], str]:
    """Of the recording of each level and seed of a comparison in ``folder``."""
    jobs = plan.recordings()
    files = {run: folder / RECORDINGS / jobs[run.name].file_name() for run in plan.runs()}
    return {(run.dynamism, run.seed): digest(file) for run, file in files.items()}


def write_from(
    folders: Sequence[Path], path: Path, commit: str, only: Sequence[str] | None = None
) -> Published:
    """Of folders of ``mobilia benchmark``, all tracks that are whole in them, beside what is there.

    commit  of the code that made their rows
    only    SLAMs whose rows are taken; None: all

    Raises ``InvalidValueError`` for two folders whose recordings differ, for what is no commit, and
    for SLAMs of ``only`` that have no row in the folders.
    """
    shaped("--commit", commit, _Commit)
    made_here: set[str] = set()
    before: dict[str, Any] = load(path, WHAT, SCHEMA) if path.exists() else {}
    runs, hashes = dict[str, Row](before.get("runs", {})), dict[str, str](before.get("tracks", {}))
    for folder, track in product(folders, TRACKS.values()):
        if not (folder / track.name / "recipe.json").exists():
            continue
        done = compared(folder / track.name)
        rows, asked = done.runs, done.settings
        hashes[track.name] = track.sha256
        plan = track.plan(asked["slams"], tuple(asked["seeds"]), levels=tuple(asked["levels"]))
        for at, scans in digests(plan, folder / track.name).items():
            own = {r["slam"]: [*(_short(r.get(k)) for k in CELLS), commit]
                   for r in rows if (r["dynamism"], r["seed"]) == at
                   and (only is None or r["slam"] in only)}  # fmt: skip
            key = f"{track.name} {at[0]:g} {at[1]}"
            there = runs.setdefault(key, {"recording": scans, "slams": {}})
            if there["recording"] != scans:
                raise InvalidValueError(f"{folder}: {key}: other scans than in another folder")
            there["slams"] |= own
            made_here |= set(own)
    if missing := sorted(set(only or ()) - made_here):
        raise InvalidValueError(
            f"--only {' '.join(missing)}: no row in {', '.join(map(str, folders))}"
        )
    made: Row = {"versions": versions(), "machine": machine()}
    earlier = before.get("made_with", made)
    made["versions"] = {k: _each(earlier["versions"].get(k, v), v) for k, v in versions().items()}
    processor = (of["machine"]["processor"] for of in (earlier, made))
    made["machine"]["processor"] = _each(*processor)
    head = {"schema": SCHEMA, "what": WHAT, "world": WORLD, "made_with": made, "columns": COLUMNS}
    write(path, head, {"tracks": hashes, "runs": runs})
    return read(path)


def _each(*told: str) -> str:
    """Of lists with commas, each entry once."""
    return ", ".join(dict.fromkeys(", ".join(told).split(", ")))


def _short(value: Any) -> Any:
    """Six digits: nobody reads more, and all of this is in the package."""
    return float(f"{value:.6g}") if isinstance(value, float) and finite(value) else finite(value)


_Commit = Annotated[
    str, Meta(pattern=r"\A[0-9a-f]{7,40}\Z", description="the hash of a commit, 7 to 40 digits")
]
_HEAD: Columns = {"columns": list[str], "made_with": dict[str, Any]}
_CELLS: Columns = {**RUN, "lost": Literal[0, 1], "commit": _Commit}
_RUN: Columns = {
    **{key: RUN[key] for key in ("level", "seed", "recording")},
    "slams": Annotated[dict[str, Any], Meta(max_length=MAX_SLAMS)],
}


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

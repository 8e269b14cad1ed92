# SPDX-License-Identifier: Apache-2.0
"""The file of results, run by run, without the recordings: what ships, and what anyone submits.

It names each recording by its digest. So whoever adds it to a leaderboard sees that its SLAMs ran
on the very scans of the others. Nothing in it is ever run: a SLAM's name is a word.
"""

import hashlib
import json
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Annotated, Any, Literal

from msgspec import Meta

from scripts.benchmark.tracks import LEVELS, QUICK_LEVELS, TRACKS, Track, check_known
from scripts.comparison.rules import (
    MAX_DEPTH,
    MOST,
    Columns,
    check_keys,
    is_shallow,
    number,
    word,
)
from scripts.metrics.table import METRICS
from scripts.report.answer import ODOMETRY
from scripts.result_files import load
from sim.core.versions import WORLD, world_of
from sim.recording.recipe import Seconds
from sim.recording.sums import check_vouched
from slam.errors import FAILURES, InvalidValueError, LogFormatError
from slam.files import write_text
from slam.shaped import Share
from slam.system import names as registered
from slam.variants import ORACLE

SCHEMA, WHAT = 3, "results of the benchmark of mobilia"
FILE = Path(__file__).with_name("published.json")  # the runs that ship
CELLS = (
    "outcome", "lost", "lost_at_s", "error_tracking_m", "ate_unaligned_m", "rpe_m_per_m",
    "silent_share",
)  # fmt: skip
MS = "ms_per_scan_p50"
COLUMNS = (*CELLS, MS)  # of the runs that ship
_SECTIONS = ("errors", "honesty", "costs")
# Metrics of which less is better, but for "lost", which is a word of every run.
_METRICS = {
    key: metric
    for key, metric in METRICS.items()
    if metric.column and metric.better == "less" and metric.section in _SECTIONS and key != "lost"
}
_ALSO = ("scans", "lost_at_s", "not_trusted_share", "moving_share_of_returns")
NUMBERS = (*_METRICS, *_ALSO)  # none of them is below 0
SUBMITTED = ("poses", "failure", "outcome", "lost", *NUMBERS)  # columns of a submission
_SHARES = ("_share", "_share_of_returns")  # at most 1
MAX_SLAMS, MAX_WORDS, MAX_SEED = 100, 2000, 2**32 - 1
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,39}")
Row = dict[str, Any]
At = tuple[float, int]  # level and seed
Digests = Mapping[At, str]  # of recordings
Made = dict[At, tuple[str, dict[str, Row]]]  # digest of the recording, and a row of each SLAM


@dataclass(frozen=True, kw_only=True, eq=False)
class Results:
    """Runs by track, then by level and seed: the digest of the recording, and a row of each SLAM.

    made_with  versions and machine; of runs that ship, the commit of their code, too
    name       what tables call the SLAM of a submission: letters, digits, "_", "-", "."; ""
               where these are runs that ship, of many SLAMs
    slam       the name that it ran by, with the numbers that were set: a word, never run
    seconds    of each run of a submission; None: as long as the track says
    """

    runs: Mapping[str, Made]
    made_with: Mapping[str, Any]
    name: str = ""
    slam: str = ""
    seconds: float | None = None

    def __post_init__(self) -> None:
        if self.name:
            checked_name(self.name, self.slam)
            if not self.runs:
                raise InvalidValueError("a submission of no runs")
            for track, runs in self.runs.items():
                _check_whole(track, runs, self.name)

    def rows(
        self, track: str, digests: Digests | None = None, without: Iterable[str] = ()
    ) -> list[Row]:
        """Rows as of ``runs.csv`` of the runs on these very recordings, but for some SLAMs.

        Without costs: they are of another machine.

        digests  None: of all runs, whatever their recordings
        """
        own = self.runs.get(track, {})
        there = own if digests is None else [at for at in digests if self.same(track, digests, at)]
        return [
            {"slam": slam, "dynamism": at[0], "seed": at[1], "failure": row.get("failure")}
            | {name: row[name] for name in CELLS}
            for at in there
            for slam, row in own[at][1].items()
            if slam not in without
        ]

    def same(self, track: str, digests: Digests, at: At) -> bool:
        """Whether that run is here, and on the recording of that digest."""
        own = self.runs.get(track, {})
        return at in own and own[at][0] == digests[at]

    def others(self, track: str, digests: Digests) -> list[At]:
        """Those of the runs that have a recording of another digest here."""
        own = self.runs.get(track, {})
        return [at for at in digests if at in own and not self.same(track, digests, at)]

    def has(self, track: str, runs: Iterable[At], slam: str) -> bool:
        """Whether that SLAM made all these runs."""
        own = self.runs.get(track, {})
        return all(at in own and slam in own[at][1] for at in runs)

    def quick(self, tracks: Iterable[Track]) -> tuple[Track, ...]:
        """Those that count, and whose first seed is here at the levels of a quick benchmark."""
        return tuple(
            track for track in tracks
            if track.counts is not False
            and self.has(track.name, [(at, track.test[0]) for at in QUICK_LEVELS], ODOMETRY)
        )  # fmt: skip

    def origin(self) -> Row:
        """What a leaderboard says of where a submission comes from: words, in one line each."""
        return {"slam": self.slam, "made_with": one_line(str(dict(self.made_with)))}


def checked_name(name: str, slam: str) -> str:
    """``name`` for the results of ``slam``.

    ``InvalidValueError`` where no table could hold it, where it is another SLAM's, or ``slam`` is
    an oracle: that is a control, which is shown labels.
    """
    if slam.startswith(ORACLE):
        raise InvalidValueError(f"an oracle is a control and cannot be submitted: {slam!r:.80}")
    if name in registered() and name != slam:
        raise InvalidValueError(f"'{name}' is the name of another SLAM than {slam!r:.80}")
    if not _NAME.fullmatch(name):
        raise InvalidValueError(
            f"the name must be up to 40 letters, digits, '_', '-' and '.', got {name!r:.80}"
        )
    return name


def _check_whole(track: str, runs: Made, name: str) -> None:
    """``InvalidValueError`` unless one SLAM made each level and seed, of the track's own seeds."""
    levels, seeds = ({at[k] for at in runs} for k in (0, 1))
    if not runs or runs.keys() != set(product(levels, seeds)):
        raise InvalidValueError(f"{track}: its runs are not each level and seed once")
    if not seeds <= {*TRACKS[track].train, *TRACKS[track].test}:
        raise InvalidValueError(f"{track}: seeds that are not its own")
    if any(slams.keys() != {name} for _, slams in runs.values()):
        raise InvalidValueError(f"{track}: a run of another SLAM than {name}")


def one_line(words: Any) -> str | None:
    """One printable line of it; None of nothing."""
    line = " ".join("".join(c if c.isprintable() else " " for c in str(words or "")).split())
    return line[:MAX_WORDS] or None


def write(path: Path, results: Results) -> None:
    """The file, with the digest of all that is in it, and a line for each recording."""
    columns = SUBMITTED if results.name else COLUMNS
    data: Row = {
        "schema": SCHEMA, "what": WHAT, "world": WORLD, "made_with": dict(results.made_with),
        "columns": columns, "tracks": {name: TRACKS[name].sha256 for name in results.runs},
    }  # fmt: skip
    if results.name:
        told = {"name": results.name, "slam": one_line(results.slam), "seconds": results.seconds}
        data["submitted"] = told
    data["runs"] = {
        _key(track, at): {
            "recording": recording,
            "slams": {slam: [row[name] for name in columns] for slam, row in slams.items()},
        }
        for track, runs in results.runs.items()
        for at, (recording, slams) in runs.items()
    }
    data["sha256"] = _sha256(data)
    lines = [
        f"  {json.dumps(k)}: {json.dumps(v, allow_nan=False)}" for k, v in data.pop("runs").items()
    ]
    head = [f" {json.dumps(k)}: {json.dumps(v, allow_nan=False)}" for k, v in data.items()]
    runs = ' "runs": {\n' + ",\n".join(lines) + "\n }"
    write_text(path, "{\n" + ",\n".join([*head, runs]) + "\n}\n")


def _key(track: str, at: At) -> str:
    return f"{track} {at[0]:g} {at[1]}"


def _sha256(data: Mapping[str, Any]) -> str:
    return hashlib.sha256(json.dumps(data, sort_keys=True).encode()).hexdigest()


def read(path: Path = FILE) -> Results:
    """Inverse of ``write``.

    Raises ``LogFormatError`` for a file that is damaged, something else, of an older version of
    mobilia or of other tracks, ``WorldVersionError`` for one of a newer version of the world.
    """
    data = load(path, WHAT, None, strict=True)
    check_vouched(path)
    if str(data.get("what")).endswith("the benchmark of mobilia") and data.get("schema") != SCHEMA:
        raise LogFormatError(
            path, f"no {WHAT} of schema {SCHEMA}: another version of mobilia made it; make it again"
        )
    if data.get("what") != WHAT:
        raise LogFormatError(path, f"no {WHAT}")
    try:
        if data.pop("sha256", None) != _sha256(data):
            raise LogFormatError(path, "damaged: sha256 is not that of what it holds")
        return _results(path, data)
    except (KeyError, TypeError, ValueError, AttributeError, RecursionError) as error:
        raise LogFormatError(path, f"no {WHAT}: {type(error).__name__}: {error}") from error


def _results(path: Path, data: Row) -> Results:
    check_keys(path, "", data, _HEAD)
    submitted = data.get("submitted", {})
    columns = SUBMITTED if submitted else COLUMNS
    check_keys(path, "", submitted, _SUBMITTED if submitted else {})
    if data["columns"] != list(columns):
        raise LogFormatError(path, f"columns must be {', '.join(columns)}")
    if not is_shallow(data["made_with"]):
        raise LogFormatError(path, f"made_with must be at most {MAX_DEPTH} deep")
    check_known(path, world_of(path, data), data["tracks"])
    runs: dict[str, Made] = {name: {} for name in data["tracks"]}
    for key, told in data["runs"].items():
        track, level, seed = key.split(" ")
        at = (float(level), int(seed))
        check_keys(path, f"{key:.80}: ", {**told, "level": at[0], "seed": at[1]}, _RUN)
        if at[0] not in LEVELS:
            raise LogFormatError(path, f"{key:.80}: level must be of {LEVELS}")
        if track not in runs or key != _key(track, at):
            raise LogFormatError(path, f"{key:.80}: a track without its hash, level and seed")
        rows = {s: _row(path, f"{key}, {s:.80}: ", columns, of) for s, of in told["slams"].items()}
        runs[track][at] = (told["recording"], rows)
    return Results(runs=runs, made_with=data["made_with"], **submitted)


def _row(path: Path, where: str, columns: Sequence[str], cells: Sequence[Any]) -> Row:
    row: Row = dict(zip(columns, cells, strict=True))
    check_keys(path, where, row, {name: _CELLS[name] for name in columns})
    check_keys(path, where, row, _FINISHED if row["outcome"] == "finished" else _LOST)
    return row


_POSITIVE = number(most=MOST)
_SHA256 = Annotated[str, Meta(pattern=r"\A[0-9a-f]{64}\Z", description="a SHA-256")]
Commit = Annotated[
    str, Meta(pattern=r"\A[0-9a-f]{7,40}\Z", description="the hash of a commit, 7 to 40 digits")
]
_HEAD: Columns = {
    "made_with": dict[str, Any], "tracks": dict[str, Any], "runs": dict[str, Any],
    "columns": list[str],
}  # fmt: skip
_SUBMITTED: Columns = {
    "name": Annotated[str, Meta(min_length=1)], "slam": word(most=MAX_WORDS),
    "seconds": Seconds | None,
}  # fmt: skip
_RUN: Columns = {
    "level": Share, "seed": number(most=MAX_SEED, whole=True), "recording": _SHA256,
    "slams": Annotated[dict[str, Any], Meta(max_length=MAX_SLAMS)],
}  # fmt: skip
_CELLS: Columns = {
    "poses": _SHA256, "outcome": word(among=("finished", "lost", *FAILURES)),
    "failure": word(most=MAX_WORDS, optional=True), "lost": Literal[0, 1],
    **{key: number(most=1.0 if key.endswith(_SHARES) else MOST, optional=True) for key in NUMBERS},
}  # fmt: skip
_FINISHED: Columns = {
    "lost": Literal[0], "lost_at_s": None, "ate_unaligned_m": _POSITIVE,
    "error_tracking_m": _POSITIVE,
}  # fmt: skip
_LOST: Columns = {"lost": Literal[1], "lost_at_s": _POSITIVE}

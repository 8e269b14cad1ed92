# SPDX-License-Identifier: Apache-2.0
"""A result file that anyone can make: one SLAM on the tracks, run by run, without the recordings.

It names the recordings by their digests. So whoever merges it sees that the SLAM ran on the very
scans of the others. Nothing in it is ever run: the SLAM's name is a word.
"""

from __future__ import annotations

import hashlib
import json
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scripts.benchmark.tracks import LEVELS, TRACKS
from scripts.machine import machine, versions
from scripts.metrics.table import METRICS
from scripts.output import configs_of
from sim.core.versions import WORLD, check_world, world_of
from sim.recording.sums import check_vouched
from slam.bounded import text_of
from slam.errors import FAILURES, InvalidValueError, LogFormatError
from slam.files import write_text
from slam.frames import Float
from slam.system import names as registered
from slam.variants import ORACLE

SCHEMA, WHAT = 2, "submission to the benchmark of mobilia"
MAX_BYTES = 1 << 25
MAX_SEEDS, MAX_WORDS = 1000, 2000  # of a file; characters of a name or failure
MAX_SEED, MAX_SECONDS = 2**32 - 1, 86_400.0  # s of a run
MAX_DEPTH = 16  # objects and lists within each other, in what it was made with
MAX_NUMBER = 1e300  # of any metric; JSON has whole numbers that no double holds
SEALED = "sealed"  # seeds that were published as a hash first (``scripts.benchmark.sealed``)
SETS = ("test", "train", SEALED)
OUTCOMES = ("finished", "lost", *FAILURES)
_SECTIONS = ("errors", "honesty", "costs")
# Metrics of which less is better, but for "lost", which is a word of every run.
_METRICS = {
    key: metric
    for key, metric in METRICS.items()
    if metric.column and metric.better == "less" and metric.section in _SECTIONS and key != "lost"
}
_COSTS = tuple(key for key in _METRICS if METRICS[key].section == "costs")
_FINISHED = ("ate_unaligned_m", "error_tracking_m")  # what every run that finished has
_ALSO = ("scans", "lost_at_s", "not_trusted_share", "moving_share_of_returns")
NUMBERS = (*_METRICS, *_ALSO)  # none of them is below 0
OF_POSES = ("outcome", "lost", *(key for key in NUMBERS if key not in _COSTS))  # not of a machine
_SHARES = ("_share", "_share_of_returns")  # at most 1
_WORDS = {"level", "seed", "recording", "poses", "outcome", "failure", "lost", *NUMBERS}
_NAME, _DIGEST = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,39}"), re.compile(r"[0-9a-f]{64}")
Row = dict[str, Any]


@dataclass(frozen=True, kw_only=True, eq=False)
class Submission:
    """The results of one SLAM.

    name       what tables call it: letters, digits, "_", "-", "."
    slam       the name that it ran by, with the numbers that were set: a word, never run
    seeds_of, seeds, levels, seconds  what was run; seconds None: as long as the track says
    runs       by track: rows as of ``runs.csv``, "recording", the digest of the scans, and "poses",
               that of the poses at them
    made_with  versions, machine, numbers of the SLAM
    """

    name: str
    slam: str
    seeds_of: str
    seeds: tuple[int, ...]
    levels: tuple[float, ...]
    seconds: float | None
    runs: Mapping[str, Sequence[Row]]
    made_with: Mapping[str, Any]

    def __post_init__(self) -> None:
        checked_name(self.name, self.slam)

    def rows(self, track: str) -> list[Row]:
        """Its runs on a track as rows of ``runs.csv`` have it; [] where it was not there.

        Without costs: they are of another machine.
        """
        return [
            {"slam": self.name, "dynamism": run["level"]}
            | {k: None if k in _COSTS else run[k] for k in _WORDS - {"level"}}
            for run in self.runs.get(track, ())
        ]

    def origin(self) -> Row:
        """What a leaderboard says of where its rows come from: words, in one line each."""
        return {"slam": self.slam, "made_with": _line(str(dict(self.made_with)))}


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


def file_of(name: str) -> str:
    """What the file of a submission is called."""
    return f"submission_{name}.json"


def digest_of(stamps_ns: NDArray[np.int64], poses: Float) -> str:
    """SHA-256 of (k,) stamps and (k, 3) poses of a SLAM: all bits, so it is of one machine."""
    whole = hashlib.sha256(np.ascontiguousarray(stamps_ns, dtype="<i8").tobytes())
    whole.update(np.ascontiguousarray(poses, dtype="<f8").tobytes())
    return whole.hexdigest()


def run_of(row: Mapping[str, Any], recording: str, poses: str) -> Row:
    """What a submission keeps of a row of ``runs.csv``."""
    numbers = {key: plain(row.get(key)) for key in NUMBERS}
    return {
        "level": float(row["dynamism"]), "seed": int(row["seed"]), "recording": recording,
        "poses": poses,
        "outcome": row["outcome"], "failure": _line(row.get("failure")), "lost": int(row["lost"]),
        **numbers,
    }  # fmt: skip


def _line(words: Any) -> str | None:
    """One printable line of it; None of nothing."""
    line = " ".join("".join(c if c.isprintable() else " " for c in str(words or "")).split())
    return line[:MAX_WORDS] or None


def plain(value: Any) -> Any:
    """As JSON has it: None where it is no finite number."""
    return None if isinstance(value, float) and not math.isfinite(value) else value


def made_with(slam: str) -> Row:
    """What can change a number."""
    return {"versions": versions(), "machine": machine(), "configs": configs_of([slam])}


def write(path: Path, submission: Submission) -> None:
    """The file, with the digest of all that is in it."""
    tracks = {
        name: {"sha256": TRACKS[name].sha256, "runs": list(runs)}
        for name, runs in submission.runs.items()
    }
    data: Row = {
        "schema": SCHEMA, "what": WHAT, "name": submission.name, "slam": _line(submission.slam),
        "world": WORLD, "seeds_of": submission.seeds_of, "seeds": list(submission.seeds),
        "levels": list(submission.levels), "seconds": submission.seconds,
        "made_with": dict(submission.made_with), "tracks": tracks,
    }  # fmt: skip
    whole = {**data, "sha256": _sha256(data)}
    write_text(path, json.dumps(whole, indent=1, allow_nan=False) + "\n")


def _sha256(data: Mapping[str, Any]) -> str:
    return hashlib.sha256(json.dumps(data, sort_keys=True).encode()).hexdigest()


def read(path: Path) -> Submission:
    """Inverse of ``write``.

    Raises ``LogFormatError`` for a file that is damaged, something else or of other tracks,
    ``WorldVersionError`` for one of another version of the world.
    """
    text = text_of(path, MAX_BYTES)
    check_vouched(path)
    try:
        data = json.loads(text, parse_constant=_refuse)
    except (ValueError, RecursionError) as error:
        raise LogFormatError(path, f"no submission: {error}") from error
    if not isinstance(data, dict) or (data.get("schema"), data.get("what")) != (SCHEMA, WHAT):
        raise LogFormatError(path, f"no {WHAT} of schema {SCHEMA}")
    check_world(path, world_of(path, data))
    said = data.pop("sha256", None)
    try:
        if said != _sha256(data):
            raise LogFormatError(path, "damaged: sha256 is not that of what it holds")
        return _submission(path, data)
    except (KeyError, TypeError, AttributeError, RecursionError, InvalidValueError) as error:
        raise LogFormatError(path, f"no submission: {type(error).__name__}: {error}") from error


def _refuse(constant: str) -> float:
    raise ValueError(f"{constant} is no JSON number")


def _submission(path: Path, data: Row) -> Submission:
    _expect(path, "slam", data["slam"], _is_words(data["slam"]), "a name")
    _expect(path, "name", data["name"], isinstance(data["name"], str), "a name")
    _expect(path, "seeds_of", data["seeds_of"], data["seeds_of"] in SETS, " or ".join(SETS))
    seeds, levels, seconds = data["seeds"], data["levels"], data["seconds"]
    several = isinstance(seeds, list) and 0 < len(seeds) <= MAX_SEEDS
    whole = several and all(_is_seed(seed) for seed in seeds)
    _expect(
        path,
        "seeds",
        seeds,
        whole and len(set(seeds)) == len(seeds),
        f"whole numbers, 0 to {MAX_SEED}",
    )
    known = isinstance(levels, list) and bool(levels) and all(_in(one, LEVELS) for one in levels)
    _expect(path, "levels", levels, known and levels == sorted(set(levels)), f"of {LEVELS}, rising")
    timed = seconds is None or (_is_number(seconds) and 0 < seconds <= MAX_SECONDS)
    _expect(path, "seconds", seconds, timed, f"null, or up to {MAX_SECONDS:g}")
    tracks, made = data["tracks"], data["made_with"]
    _expect(path, "tracks", tracks, isinstance(tracks, dict) and bool(tracks), "one or more")
    shallow = isinstance(made, dict) and _is_shallow(made, MAX_DEPTH)
    _expect(path, "made_with", made, shallow, f"an object, at most {MAX_DEPTH} deep")
    runs = {}
    for name, own in tracks.items():
        if name not in TRACKS or own["sha256"] != TRACKS[name].sha256:
            raise LogFormatError(path, f"track {name!r:.80} is none of this version's")
        runs[name] = _runs(path, name, own["runs"], {(a, b) for a in levels for b in seeds})
    return Submission(
        name=data["name"], slam=data["slam"], seeds_of=data["seeds_of"], seeds=tuple(seeds),
        levels=tuple(levels), seconds=seconds, runs=runs, made_with=made,
    )  # fmt: skip


def _runs(path: Path, track: str, runs: Any, wanted: set[tuple[float, int]]) -> list[Row]:
    if not isinstance(runs, list) or len(runs) != len(wanted):
        raise LogFormatError(path, f"{track}: expected {len(wanted)} runs, one a level and seed")
    for run in runs:
        _check_run(path, track, run)
    if {(run["level"], run["seed"]) for run in runs} != wanted:
        raise LogFormatError(path, f"{track}: its runs are not each level and seed once")
    return runs


def _check_run(path: Path, track: str, run: Any) -> None:
    if not isinstance(run, dict) or set(run) != _WORDS:
        raise LogFormatError(path, f"{track}: a run must have {', '.join(sorted(_WORDS))}")
    where = f"{track}, level {run['level']!r:.20}, seed {run['seed']!r:.20}: "
    _expect(path, f"{where}level", run["level"], _in(run["level"], LEVELS), f"of {LEVELS}")
    _expect(path, f"{where}seed", run["seed"], _is_seed(run["seed"]), "a whole number")
    told = run["failure"] is None or _is_words(run["failure"])
    lost, outcome = run["lost"], run["outcome"]
    for key in ("recording", "poses"):
        value = run[key]
        digest = isinstance(value, str) and _DIGEST.fullmatch(value) is not None
        _expect(path, where + key, value, digest, "a SHA-256")
    _expect(path, f"{where}outcome", outcome, _in(outcome, OUTCOMES), ", ".join(OUTCOMES))
    _expect(path, f"{where}failure", run["failure"], told, "null or words")
    fits = type(lost) is int and lost == int(outcome != "finished")
    _expect(path, f"{where}lost", lost, fits, "0 where it finished, else 1")
    fits = (run["lost_at_s"] is None) == (outcome == "finished")
    _expect(
        path, f"{where}lost_at_s", run["lost_at_s"], fits, "null where it finished, and else not"
    )
    for key in NUMBERS:
        value = run[key]
        most = 1.0 if key.endswith(_SHARES) else math.inf
        must = key in _FINISHED and outcome == "finished"
        fits = not must if value is None else _is_number(value) and 0.0 <= value <= most
        unit = METRICS[key].unit if key in METRICS else ""
        null = "" if must else "null or "
        _expect(path, where + key, value, fits, f"{null}a number >= 0 {unit}".strip())


def _is_number(value: Any) -> bool:
    known = isinstance(value, int | float) and not isinstance(value, bool)
    return known and -MAX_NUMBER <= value <= MAX_NUMBER


def _is_seed(value: Any) -> bool:
    return type(value) is int and 0 <= value <= MAX_SEED


def _is_shallow(value: Any, most: int) -> bool:
    inner = value.values() if isinstance(value, dict) else value if isinstance(value, list) else ()
    return not inner or (most > 0 and all(_is_shallow(one, most - 1) for one in inner))


def _is_words(value: Any) -> bool:
    return isinstance(value, str) and 0 < len(value) <= MAX_WORDS and value.isprintable()


def _in(value: Any, known: Sequence[Any]) -> bool:
    return isinstance(value, str | int | float) and type(value) is not bool and value in known


def _shown(value: Any) -> str:
    try:
        return f"{value!r:.80}"
    except RecursionError:
        return "what is too deep to show"


def _expect(path: Path, field: str, value: Any, fits: bool, wanted: str) -> None:
    if not fits:
        raise LogFormatError(path, f"{field} must be {wanted}, got {_shown(value)}")

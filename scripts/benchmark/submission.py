# SPDX-License-Identifier: Apache-2.0
"""A result file that anyone can make: one SLAM on the tracks, run by run, without the recordings.

It names the recordings by their digests. So whoever merges it sees that the SLAM ran on the very
scans of the others. Nothing in it is ever run: the SLAM's name is a word.
"""

import hashlib
import json
import re
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from scripts.benchmark.tracks import LEVELS, TRACKS, check_known
from scripts.comparison import recording
from scripts.comparison.entry import Entry
from scripts.comparison.rules import (
    MAX_DEPTH,
    MOST,
    Columns,
    check_keys,
    is_shallow,
    many,
    number,
    word,
)
from scripts.machine import machine, versions
from scripts.metrics.table import METRICS
from scripts.output import configs_of
from scripts.report.answer import ODOMETRY
from scripts.result_files import finite, load
from sim.core.versions import WORLD, world_of
from sim.recording.recipe import Seconds
from sim.recording.sums import check_vouched
from sim.recording.verify import Finding
from slam.errors import FAILURES, InvalidValueError, LogFormatError
from slam.files import write_text
from slam.frames import BeamClass, Float
from slam.guests import Limits, limited
from slam.shaped import Share
from slam.system import names as registered
from slam.variants import ORACLE

SCHEMA, WHAT = 2, "submission to the benchmark of mobilia"
MAX_SEEDS, MAX_WORDS = 1000, 2000  # of a file; characters of a name or failure
MAX_SEED = 2**32 - 1
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
_ALSO = ("scans", "lost_at_s", "not_trusted_share", "moving_share_of_returns")
NUMBERS = (*_METRICS, *_ALSO)  # none of them is below 0
OF_POSES = ("outcome", "lost", *(key for key in NUMBERS if key not in _COSTS))  # not of a machine
_SHARES = ("_share", "_share_of_returns")  # at most 1
_WORDS = {"level", "seed", "recording", "poses", "outcome", "failure", "lost", *NUMBERS}
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,39}")
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
    numbers = {key: finite(row.get(key)) for key in NUMBERS}
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
    ``WorldVersionError`` for one of a newer version of the world.
    """
    data = load(path, WHAT, SCHEMA, strict=True)
    check_vouched(path)
    if data.get("what") != WHAT:
        raise LogFormatError(path, f"no {WHAT}")
    said = data.pop("sha256", None)
    try:
        if said != _sha256(data):
            raise LogFormatError(path, "damaged: sha256 is not that of what it holds")
        return _submission(path, data)
    except (KeyError, TypeError, AttributeError, RecursionError, InvalidValueError) as error:
        raise LogFormatError(path, f"no submission: {type(error).__name__}: {error}") from error


def _submission(path: Path, data: Row) -> Submission:
    check_keys(path, "", data, _HEAD)
    levels, seeds, tracks = data["levels"], data["seeds"], data["tracks"]
    if levels != sorted({*levels} & {*LEVELS}):
        raise LogFormatError(path, f"levels must be of {LEVELS}, rising, got {levels!r:.80}")
    if len({*seeds}) < len(seeds):
        raise LogFormatError(path, f"seeds must be each once, got {seeds!r:.80}")
    if not is_shallow(data["made_with"]):
        raise LogFormatError(path, f"made_with must be at most {MAX_DEPTH} deep")
    check_known(path, world_of(path, data), {name: own["sha256"] for name, own in tracks.items()})
    runs = {}
    for name, own in tracks.items():
        public = (*TRACKS[name].train, *TRACKS[name].test)  # a track may have seeds of its own
        of = seeds if data["seeds_of"] == SEALED else [b for b in seeds if b in public]
        if not of:
            raise LogFormatError(path, f"{name}: none of its seeds")
        runs[name] = _runs(path, name, own["runs"], {(a, b) for a in levels for b in of})
    return Submission(
        name=data["name"], slam=data["slam"], seeds_of=data["seeds_of"], seeds=tuple(seeds),
        levels=tuple(levels), seconds=data["seconds"], runs=runs, made_with=data["made_with"],
    )  # fmt: skip


def _runs(path: Path, track: str, runs: Any, wanted: set[tuple[float, int]]) -> list[Row]:
    if not isinstance(runs, list) or len(runs) != len(wanted):
        raise LogFormatError(path, f"{track}: expected {len(wanted)} runs, one a level and seed")
    for run in runs:
        if not isinstance(run, dict) or set(run) != _WORDS:
            raise LogFormatError(path, f"{track}: a run must have {', '.join(sorted(_WORDS))}")
        where = f"{track}, level {run['level']!r:.20}, seed {run['seed']!r:.20}: "
        check_keys(path, where, run, RUN)
        check_keys(path, where, run, _FINISHED if run["outcome"] == "finished" else _LOST)
    if {(run["level"], run["seed"]) for run in runs} != wanted:
        raise LogFormatError(path, f"{track}: its runs are not each level and seed once")
    return runs


_POSITIVE = number(most=MOST)
_Seed = Annotated[int, Meta(ge=0, le=MAX_SEED)]
_SHA256 = Annotated[str, Meta(pattern=r"\A[0-9a-f]{64}\Z", description="a SHA-256")]
SEEDS = Annotated[list[_Seed], Meta(min_length=1, max_length=MAX_SEEDS)]
_HEAD: Columns = {
    "slam": word(most=MAX_WORDS), "name": str, "seeds_of": word(among=SETS), "seeds": SEEDS,
    "levels": many(Share), "seconds": Seconds | None,
    "tracks": Annotated[dict[str, Any], Meta(min_length=1)], "made_with": dict[str, Any],
}  # fmt: skip
RUN: Columns = {
    "level": Share, "seed": _Seed, "recording": _SHA256, "poses": _SHA256,
    "outcome": word(among=OUTCOMES), "failure": word(most=MAX_WORDS, optional=True),
    **{
        key: number(most=1.0 if key.endswith(_SHARES) else MOST, optional=True) for key in NUMBERS
    },
}  # fmt: skip
_FINISHED: Columns = {
    "lost": Literal[0], "lost_at_s": None, "ate_unaligned_m": _POSITIVE,
    "error_tracking_m": _POSITIVE,
}  # fmt: skip
_LOST: Columns = {"lost": Literal[1], "lost_at_s": _POSITIVE}


_TOLD = ("outcome", "ate_unaligned_m", "error_tracking_m")  # of a run with other poses


def made_again(path: Path, count: int, seed: int = 0, slam: str | None = None) -> Iterator[Finding]:
    """One finding for each of ``count`` runs, drawn by ``seed``; raises as ``submission.read``.

    slam  runs on them too, by this name; None: only recordings are checked, no SLAM runs

    A difference is no proof of anything with other versions or on another processor: then the
    verdict is "cannot be checked here".
    """
    given = read(path)
    if slam is not None:
        limited(slam, Limits())  # what cannot start here is told before anything is simulated
    runs = [(track, run) for track, own in given.runs.items() for run in own]
    chosen = np.random.default_rng(seed).choice(len(runs), min(count, len(runs)), replace=False)
    for track, run in (runs[k] for k in sorted(chosen.tolist())):
        name = f"{path.name}: {track}, level {run['level']:g}, seed {run['seed']}"
        with tempfile.TemporaryDirectory() as folder:
            wrong, proven = _wrong(given, track, run, slam, Path(folder))
        there = _elsewhere(given.made_with)
        if not wrong:
            yield Finding(episode=name, verdict="same bytes")
        elif there and not proven:
            why = f"{wrong}, and it was made with {there}"
            yield Finding(episode=name, verdict="cannot be checked here", why=why)
        else:
            here = "" if there else ", on the same processor and versions"
            why = f"{wrong}{here}"
            yield Finding(episode=name, verdict="differs", why=why)


def _wrong(
    given: Submission, track: str, run: Mapping[str, Any], slam: str | None, folder: Path
) -> tuple[str, bool]:
    """What is others here, "" where nothing is, and whether no other machine can explain it."""
    file = folder / "again.npz"
    plan = TRACKS[track].plan(
        (ODOMETRY,), (run["seed"],), levels=(float(run["level"]),), seconds=given.seconds
    )
    (one,) = plan.runs()
    recording.record(file, every=plan.every, **asdict(plan.recipe(one)))
    if recording.digest(file) != run["recording"]:
        return "its scans are others here", False
    if slam is None:
        return "", False
    drive = recording.load(file)
    entry = Entry(slam, drive, Limits(hidden=(folder,)), judge_maps=False)
    entry.over(drive.frames)
    arrays = entry.arrays()
    row = json.loads(arrays["row"])
    if digest_of(arrays["stamps_ns"], arrays["poses"]) == run["poses"]:
        row |= {"moving_share_of_returns": drive.share_of_returns(BeamClass.MOVING)}
        wrong = [k for k in OF_POSES if finite(row.get(k)) != run[k]]
        return (f"its {', '.join(wrong)} are not those of its poses" if wrong else ""), True
    return f"its poses are others here ({_told(_TOLD, run)}; here {_told(_TOLD, row)})", False


def _told(keys: Sequence[str], row: Mapping[str, Any]) -> str:
    return ", ".join(f"{key} {row.get(key)!s:.12}" for key in keys)


def _elsewhere(made_with: Mapping[str, Any]) -> str:
    """Processor and versions that it was made with; "" where they are those of here."""
    here = {"versions": versions(), "processor": machine()["processor"]}
    told = made_with.get("machine")
    there = {
        "versions": made_with.get("versions"),
        "processor": told.get("processor") if isinstance(told, Mapping) else None,
    }
    return "" if here == there else f"{there!s:.300}"

# SPDX-License-Identifier: Apache-2.0
"""A submission: a ``runs_file`` of one SLAM, and how anyone makes its runs again."""

import hashlib
import json
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scripts.benchmark import runs_file
from scripts.benchmark.runs_file import NUMBERS, At, Results, Row, one_line
from scripts.benchmark.tracks import TRACKS
from scripts.comparison import recording
from scripts.comparison.entry import Entry
from scripts.comparison.plan import Plan
from scripts.comparison.recording import Recording
from scripts.machine import machine, versions
from scripts.metrics.table import METRICS
from scripts.output import configs_of
from scripts.report.answer import ODOMETRY
from scripts.result_files import finite
from sim.recording.verify import Finding
from slam.errors import LogFormatError
from slam.frames import BeamClass, Float
from slam.guests import Limits, limited

_COSTS = tuple(key for key in NUMBERS if key in METRICS and METRICS[key].section == "costs")
OF_POSES = ("outcome", "lost", *(key for key in NUMBERS if key not in _COSTS))  # not of a machine
_TOLD = ("outcome", "ate_unaligned_m", "error_tracking_m")  # of a run with other poses


def read(path: Path) -> Results:
    """``runs_file.read`` of a submission; ``LogFormatError`` for runs that ship, too."""
    found = runs_file.read(path)
    if not found.name:
        raise LogFormatError(path, "no submission: it holds runs of many SLAMs")
    return found


def file_of(name: str) -> str:
    """What the file of a submission is called."""
    return f"submission_{name}.json"


def digest_of(stamps_ns: NDArray[np.int64], poses: Float) -> str:
    """SHA-256 of (k,) stamps and (k, 3) poses of a SLAM: all bits, so it is of one machine."""
    whole = hashlib.sha256(np.ascontiguousarray(stamps_ns, dtype="<i8").tobytes())
    whole.update(np.ascontiguousarray(poses, dtype="<f8").tobytes())
    return whole.hexdigest()


def run_of(row: Mapping[str, Any], poses: str) -> Row:
    """What a submission keeps of a row of ``runs.csv``; ``poses`` as of ``digest_of``."""
    numbers = {key: finite(row.get(key)) for key in NUMBERS}
    about = {"outcome": row["outcome"], "failure": one_line(row.get("failure"))}
    return {"poses": poses, **about, "lost": int(row["lost"]), **numbers}


def made_with(slam: str) -> Row:
    """What can change a number."""
    return {"versions": versions(), "machine": machine(), "configs": configs_of([slam])}


def made_again(path: Path, count: int, seed: int = 0, slam: str | None = None) -> Iterator[Finding]:
    """One finding for each of ``count`` runs, drawn by ``seed``; raises as ``read``.

    slam  runs on them too, by this name; None: only recordings are checked, no SLAM runs

    A difference is no proof of anything with other versions or on another processor: then the
    verdict is "cannot be checked here".
    """
    given = read(path)
    if slam is not None:
        limited(slam, Limits())  # what cannot start here is told before anything is simulated
    runs = [(track, at) for track, own in given.runs.items() for at in own]
    chosen = np.random.default_rng(seed).choice(len(runs), min(count, len(runs)), replace=False)
    there = _elsewhere(given.made_with)
    for track, at in (runs[k] for k in sorted(chosen.tolist())):
        name = f"{path.name}: {track}, level {at[0]:g}, seed {at[1]}"
        wrong, proven = _wrong(given, track, at, slam)
        if not wrong:
            yield Finding(episode=name, verdict="same bytes")
        elif there and not proven:
            why = f"{wrong}, and it was made with {there}"
            yield Finding(episode=name, verdict="cannot be checked here", why=why)
        else:
            here = "" if there else ", on the same processor and versions"
            yield Finding(episode=name, verdict="differs", why=f"{wrong}{here}")


def _wrong(given: Results, track: str, at: At, slam: str | None) -> tuple[str, bool]:
    """What is others here, "" where nothing is, and whether no other machine can explain it."""
    scans, slams = given.runs[track][at]
    run = slams[given.name]
    plan = TRACKS[track].plan((ODOMETRY,), (at[1],), levels=at[:1], seconds=given.seconds)
    with tempfile.TemporaryDirectory() as folder:
        file = recorded(plan, Path(folder))
        if recording.digest(file) != scans:
            return "its scans are others here", False
        if slam is None:
            return "", False
        drive = recording.load(file)
    row, arrays = alone(slam, drive)
    if digest_of(arrays["stamps_ns"], arrays["poses"]) == run["poses"]:
        row |= {"moving_share_of_returns": drive.share_of_returns(BeamClass.MOVING)}
        wrong = [k for k in OF_POSES if finite(row.get(k)) != run[k]]
        return (f"its {', '.join(wrong)} are not those of its poses" if wrong else ""), True
    return f"its poses are others here ({_words(_TOLD, run)}; here {_words(_TOLD, row)})", False


def recorded(plan: Plan, folder: Path) -> Path:
    """The recording of a comparison's one run, made in ``folder``."""
    file = folder / "run.npz"
    (one,) = plan.runs()
    recording.record(file, every=plan.every, **asdict(plan.recipe(one)))
    return file


def alone(slam: str, drive: Recording) -> tuple[Row, dict[str, Any]]:
    """The row of ``runs.csv`` and the arrays of a SLAM on one recording."""
    entry = Entry(slam, drive, Limits(), judge_maps=False)
    entry.over(drive.frames)
    arrays = entry.arrays()
    return json.loads(arrays["row"]), arrays


def _words(keys: Sequence[str], row: Mapping[str, Any]) -> str:
    return ", ".join(f"{key} {row.get(key)!s:.12}" for key in keys)


def _elsewhere(made: Mapping[str, Any]) -> str:
    """Processor and versions that it was made with; "" where they are those of here."""
    here = {"versions": versions(), "processor": machine()["processor"]}
    told = made.get("machine")
    there = {
        "versions": made.get("versions"),
        "processor": told.get("processor") if isinstance(told, Mapping) else None,
    }
    return "" if here == there else f"{there!s:.300}"

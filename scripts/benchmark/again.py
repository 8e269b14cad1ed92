# SPDX-License-Identifier: Apache-2.0
"""Some runs of a submission made again: its recordings, and the poses of its SLAM."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from scripts.benchmark import submission
from scripts.benchmark.submission import Submission
from scripts.benchmark.tracks import TRACKS
from scripts.comparison.entry import Entry
from scripts.comparison.recording import digest, load, record
from scripts.machine import machine, versions
from scripts.report.answer import ODOMETRY
from scripts.result_files import finite
from sim.recording.verify import Finding
from slam.frames import BeamClass
from slam.guests import Limits, limited

_TOLD = ("outcome", "ate_unaligned_m", "error_tracking_m")  # of a run with other poses


def made_again(path: Path, count: int, seed: int = 0, slam: str | None = None) -> Iterator[Finding]:
    """One finding for each of ``count`` runs, drawn by ``seed``; raises as ``submission.read``.

    slam  runs on them too, by this name; None: only recordings are checked, no SLAM runs

    A difference is no proof of anything with other versions or on another processor: then the
    verdict is "cannot be checked here".
    """
    given = submission.read(path)
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
    record(file, every=plan.every, **asdict(plan.recipe(one)))
    if digest(file) != run["recording"]:
        return "its scans are others here", False
    if slam is None:
        return "", False
    drive = load(file)
    entry = Entry(slam, drive, Limits(hidden=(folder,)), judge_maps=False)
    entry.over(drive.frames)
    arrays = entry.arrays()
    row = json.loads(arrays["row"])
    if submission.digest_of(arrays["stamps_ns"], arrays["poses"]) == run["poses"]:
        row |= {"moving_share_of_returns": drive.share_of_returns(BeamClass.MOVING)}
        wrong = [k for k in submission.OF_POSES if finite(row.get(k)) != run[k]]
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

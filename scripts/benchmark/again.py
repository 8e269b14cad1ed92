# SPDX-License-Identifier: Apache-2.0
"""Some runs of a submission simulated again: are its recordings those of its tracks?"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from scripts.benchmark import submission
from scripts.benchmark.tracks import TRACKS
from scripts.comparison.recording import digest, record
from scripts.machine import machine, versions
from scripts.report.answer import ODOMETRY
from sim.recording.verify import Finding


def made_again(path: Path, count: int, seed: int = 0) -> Iterator[Finding]:
    """One finding for each of ``count`` runs, drawn by ``seed``; raises as ``submission.read``.

    A difference is no proof of anything with other versions or on another processor: then the
    verdict is "cannot be checked here". Only recordings are checked: no SLAM runs.
    """
    given = submission.read(path)
    runs = [(track, run) for track, own in given.runs.items() for run in own]
    drawn = np.random.default_rng(seed).choice(len(runs), min(count, len(runs)), replace=False)
    for track, run in (runs[k] for k in sorted(drawn.tolist())):
        level = float(run["level"])
        plan = TRACKS[track].plan(
            (ODOMETRY,), (run["seed"],), levels=(level,), seconds=given.seconds
        )
        (one,) = plan.runs()
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "again.npz"
            record(file, every=plan.every, **asdict(plan.recipe(one)))
            same = digest(file) == run["recording"]
        name = f"{path.name}: {track}, level {level:g}, seed {run['seed']}"
        if same:
            yield Finding(episode=name, verdict="same bytes")
            continue
        there = _elsewhere(given.made_with)
        if there:
            why = f"its scans are others here, and it was made with {there}"
            yield Finding(episode=name, verdict="cannot be checked here", why=why)
            continue
        why = "its scans are others here, on the same processor and versions"
        yield Finding(episode=name, verdict="differs", why=why)


def _elsewhere(made_with: Mapping[str, Any]) -> str:
    """Processor and versions that it was made with; "" where they are those of here."""
    here = {"versions": versions(), "processor": machine()["processor"]}
    told = made_with.get("machine")
    there = {
        "versions": made_with.get("versions"),
        "processor": told.get("processor") if isinstance(told, Mapping) else None,
    }
    return "" if here == there else f"{there!s:.300}"

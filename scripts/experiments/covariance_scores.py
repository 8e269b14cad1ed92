# SPDX-License-Identifier: Apache-2.0
"""What smfeval says of the covariances: ``python -m scripts.experiments.covariance_scores``.

Needs the package smfeval (https://pypi.org/project/smfeval, tried with 0.4.0) in this interpreter.
Its commands ``score`` and ``nees`` read what ``mobilia export --to smfeval`` writes. smfeval scores
positions of three dimensions. A robot on a floor has two: z is known and exact. So where a
covariance is right, the median NEES is not 2.37 but 1.39, the mean 2, and the share within the 90 %
ellipsoid not 0.9 but 0.956.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from scripts.comparison.recording import Recording
from scripts.experiments.shared import CM, PERCENT, Row, kept, of, on_stream
from scripts.experiments.study import Study
from scripts.paper.runs import truth_of
from slam import create
from slam.errors import MissingDependencyError, MobiliaError
from slam.evaluation.wide_tum import write_wide_tum
from slam.frames import Frame
from slam.oracle import shown
from slam.replay import Track
from slam.trajectory import write_tum

EVERY = 8  # one scan in so many: 4.7 a second
LIMIT_S = 600.0  # that smfeval may take for a run


def exported(slam: str, frames: Sequence[Frame], folder: Path) -> tuple[Path, Path]:
    """The files of a run: online poses with covariances, and the true poses in the same map."""
    track, paths = Track(slam, create(slam)), (folder / "online.tum", folder / "truth.tum")
    for frame in frames:
        track.take(shown(track.system, frame))
    write_wide_tum(paths[0], track.online(), track.covariances(), algorithm=slam)
    write_tum(paths[1], truth_of(frames))
    return paths


def asked(verb: str, estimate: Path, truth: Path) -> dict[str, Any]:
    """The report of ``smfeval VERB``.

    Raises ``MissingDependencyError`` where it does not run, ``MobiliaError`` after ``LIMIT_S``.
    """
    command = [sys.executable, "-m", "smfeval.cli.main", verb, "--json"]
    command += ["--ref-body-frame", "robot", "--ref-pose-frame", "map", str(estimate), str(truth)]
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=LIMIT_S)
    except subprocess.TimeoutExpired as error:
        raise MobiliaError(
            f"smfeval {verb} must end within {LIMIT_S:g} s, {estimate} takes it longer"
        ) from error
    if done.returncode != 0:
        raise MissingDependencyError(
            f"smfeval must run (pip install smfeval): {done.stderr.strip()[-300:]}"
        )
    report: dict[str, Any] = json.loads(done.stdout)
    return report


def scores(case: Row, drive: Recording) -> Row:
    """Of one run."""
    with tempfile.TemporaryDirectory() as folder:
        files = exported(case["slam"], kept(drive.frames, EVERY), Path(folder))
        scores, nees = asked("score", *files)["scores"], asked("nees", *files)
    return {
        "scans": scores["translation_crps"]["n"],
        "crps_m": scores["translation_crps"]["mean"],
        "energy_m": scores["energy_score"]["mean"],
        "interval_m": scores["interval_score"]["mean"],
        "log_score": scores["log_score_translation"]["median"],
        "coverage": nees["coverage"],
        "nees_mean": nees["anees"]["anees"],
        "nees_median": nees["median_nees"],
    }


STUDY = Study(
    name="covariance_scores",
    axes={"stream": ("office", "arena", "rush-hour"), "level": (0.5,),
          "slam": ("shunting", "oracle(shunting)")},
    drive=lambda case: on_stream(*(case[key] for key in ("stream", "level", "seed", "seconds"))),
    run=scores, lines=("stream", "slam"),
    columns={
        "CRPS, cm": of("crps_m", np.mean, CM), "energy score, cm": of("energy_m", np.mean, CM),
        "interval score, cm": of("interval_m", np.mean, CM, "{:.1f}"),
        "log score": of("log_score", np.mean, form="{:.1f}"),
        "in the 90 % ellipsoid": of("coverage", np.mean, PERCENT, "{:.1f} %"),
        "median NEES": of("nees_median"), "mean NEES": of("nees_mean"),
    },
    told="World {world}, {seeds} drives of a stream, level {level[0]:g}, training seeds from "
    "{first_seed}, 4.7 scans a second; scenes for {seconds:g} s, tracks as long as they are. Means "
    "over the drives, of the NEES the median drive. A right covariance has 95.6 %, 1.39 and 2.",
    page=Path("docs/uncertainty.md"), results=True, defaults={"seeds": 3, "first_seed": 0},
)  # fmt: skip


if __name__ == "__main__":
    sys.exit(STUDY.main())

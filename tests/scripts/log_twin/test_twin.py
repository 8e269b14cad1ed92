# SPDX-License-Identifier: Apache-2.0
"""The twin of a log of ours: its scans are those of the log, and SLAMs take it as they take one."""

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from scripts.cli import app
from sim.simulation import stream
from slam.logs import open_log, write_carmen

pytestmark = pytest.mark.slow
SCANNER = "scanner(fov_deg=180, beams=181, rate_hz=5, sigma_m=0.005)"


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("log") / "arena.log"
    write_carmen(path, stream("arena", seed=3, dynamism=0.0, seconds=30.0, laser=SCANNER))
    return path


def test_the_twin_of_a_log_shows_what_the_log_shows(log: Path, tmp_path: Path) -> None:
    told = CliRunner().invoke(app, ["twin", str(log), "--out", str(tmp_path)])
    assert told.exit_code == 0, told.output
    words = json.loads((tmp_path / "twin.json").read_text())
    assert words["beside"]["stands"]["median_m"] < 0.03
    assert words["beside"]["stands"]["within_10_cm"] > 0.75
    assert (tmp_path / "differences.png").stat().st_size > 10_000
    ours, theirs = list(open_log(log)), list(open_log(tmp_path / "twin.log"))
    assert [f.stamp_ns for f in ours] == [f.stamp_ns for f in theirs]
    # a pose is put right by the walls: to the middle of a scan, as the log has no times of beams
    moved = np.array([a.truth for a in ours]) - np.array([b.truth for b in theirs])
    assert np.median(np.hypot(moved[:, 0], moved[:, 1])) < 0.06
    before = (tmp_path / "twin.log").read_bytes()
    told = CliRunner().invoke(app, ["twin", str(log), "--out", str(tmp_path), "--overwrite"])
    assert told.exit_code == 0, told.output
    assert (tmp_path / "twin.log").read_bytes() == before


def test_a_crowd_without_motion_is_refused(log: Path, tmp_path: Path) -> None:
    told = CliRunner().invoke(
        app, ["twin", str(log), "--out", str(tmp_path), "--crowd", "escorts:2"]
    )
    assert told.exit_code != 0

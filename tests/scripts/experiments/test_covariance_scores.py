# SPDX-License-Identifier: Apache-2.0
"""What is given to smfeval, and the table of what it says."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import numpy as np
import pytest

from scripts.experiments import covariance_scores
from scripts.experiments.covariance_scores import STUDY, asked, exported
from sim.simulation import Simulation, tour
from slam.errors import MissingDependencyError, MobiliaError
from slam.evaluation.wide_tum import read_wide_tum
from slam.trajectory import read_tum


def test_poses_and_truth_are_in_one_map(tmp_path: Path):
    frames = list(tour(Simulation("arena", seed=0, dynamism=0.0, laser="lms221:noise"), 2.0))
    estimate, truth = exported("shunting", frames, tmp_path)
    online, covariances = read_wide_tum(estimate)
    true = read_tum(truth)
    assert np.array_equal(online.stamps_ns, true.stamps_ns)
    assert covariances.shape == (len(true), 3, 3)
    assert np.abs(online.poses - true.poses).max() < 0.05


@pytest.mark.skipif(importlib.util.find_spec("smfeval") is not None, reason="smfeval is installed")
def test_without_smfeval_it_says_how_to_get_it(tmp_path: Path):
    with pytest.raises(MissingDependencyError, match="pip install smfeval"):
        asked("nees", tmp_path / "a.tum", tmp_path / "b.tum")


def test_a_run_that_smfeval_does_not_end_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    (tmp_path / "smfeval" / "cli").mkdir(parents=True)
    (tmp_path / "smfeval" / "cli" / "main.py").write_text("import time\ntime.sleep(60.0)\n")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    monkeypatch.setattr(covariance_scores, "LIMIT_S", 0.3)
    with pytest.raises(MobiliaError, match=r"smfeval nees must end within 0\.3 s.*a\.tum"):
        asked("nees", tmp_path / "a.tum", tmp_path / "b.tum")


def test_drives_are_averaged():
    row = {"stream": "arena", "slam": "shunting", "seed": 0, "crps_m": 0.01, "energy_m": 0.02}
    row |= {"interval_m": 0.1, "log_score": -16.0, "coverage": 1.0, "nees_mean": 1.0}
    rows = [
        {**row, "nees_median": n, "crps_m": c} for n, c in ((1.0, 0.01), (3.0, 0.03), (2.0, 0.02))
    ]
    assert STUDY.markdown(rows).splitlines()[-1] == (
        "| arena | shunting | 2.00 | 2.00 | 10.0 | -16.0 | 100.0 % | 2.00 | 1.00 |"
    )

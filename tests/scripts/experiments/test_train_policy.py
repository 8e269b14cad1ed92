# SPDX-License-Identifier: Apache-2.0
"""The experiment with a trained policy: its driver, its table, and a training of the least size."""

from __future__ import annotations

import importlib.util
import json

import pytest

from scripts.experiments import train_policy
from scripts.experiments.goal_policies import drive
from slam.errors import LogFormatError


def test_the_driver_reaches_goals_where_nothing_is_in_the_way():
    rows = drive("driver", "arena", "truth", 0.0, [501, 502], 30.0)
    assert [row["seed"] for row in rows] == [501, 502]
    assert {row["outcome"] for row in rows} <= {"reached", "collided"}
    assert rows == drive("driver", "arena", "truth", 0.0, [501, 502], 30.0)


def test_the_interval_of_a_share_is_wilson_s():
    assert train_policy.share_interval(8, 10) == pytest.approx((0.4902, 0.9433), abs=1e-4)


def test_the_table_has_a_line_for_each_pose_and_a_column_for_each_level():
    cell = {"reached": 3, "collided": 1, "late": 0, "low": 0.3, "high": 0.95}
    names = (train_policy.DRIVER, *train_policy.POSES)
    cells = {f"{name} {level:g}": cell for name in names for level in train_policy.LEVELS}
    lines = train_policy.markdown(cells, 4).splitlines()
    assert len(lines) == 2 + len(names)
    assert all(line.count("75% (30% to 95%), 25%") == 5 for line in lines[2:])


def test_weights_are_wanted_where_nothing_is_trained(tmp_path, capsys):
    files = ["--results", str(tmp_path / "r.json"), "--no-page", "--steps", "0"]
    assert train_policy.main(files) == 1
    assert "--steps 0 needs a file of --weights" in capsys.readouterr().err


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"episodes": {}, "steps": 1, "seconds": 1}'])
def test_a_file_that_no_training_left_is_refused(tmp_path, text):
    (tmp_path / "w.pt").write_bytes(b"")
    (tmp_path / "w.json").write_text(text)
    wanted = ["--steps", "0", "--weights", str(tmp_path / "w.pt"), "--no-page"]
    wanted = train_policy._parser().parse_args(wanted)
    with pytest.raises(LogFormatError, match=r"w\.json: not"):
        train_policy._run(wanted, {}, wanted.weights)


@pytest.mark.skipif(
    importlib.util.find_spec("stable_baselines3") is None,
    reason="STABLE-BASELINES3 IS NOT HERE: training not tested",
)
@pytest.mark.filterwarnings("default")  # of PyTorch and Stable-Baselines3
def test_a_tiny_training_leaves_results_a_curve_and_weights(tmp_path, monkeypatch):
    monkeypatch.setattr(train_policy, "LEVELS", (0.0,))
    monkeypatch.setattr(train_policy, "POSES", ("odometry",))
    monkeypatch.setattr(train_policy, "markdown", lambda *_: "")
    results, curve, weights = (tmp_path / name for name in ("r.json", "c.png", "w.pt"))
    words = [
        "--steps", "512", "--rooms", "1", "--jobs", "1", "--seeds", "1", "--seconds", "3",
        "--results", str(results), "--picture", str(curve), "--weights", str(weights), "--no-page",
    ]  # fmt: skip
    assert train_policy.main(words) == 0
    found = json.loads(results.read_text())
    assert found["training"]["steps"] >= 512
    assert len(found["cells"]["odometry 0"]["outcomes"]) == 1
    assert curve.stat().st_size > 1000

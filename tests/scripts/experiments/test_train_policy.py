# SPDX-License-Identifier: Apache-2.0
"""The experiment with a trained policy: its driver, its table, and a training of the least size."""

from __future__ import annotations

import importlib.util
import json

import numpy as np
import pytest

from scripts.experiments import policy_tables, train_policy
from scripts.experiments.goal_policies import drive
from scripts.experiments.goal_room import free_way, room, rule
from slam.errors import LogFormatError


def test_the_driver_reaches_goals_where_nothing_is_in_the_way():
    rows = drive("driver", "arena", "truth", 0.0, [501, 502], 30.0)
    assert [row["seed"] for row in rows] == [501, 502]
    assert {row["outcome"] for row in rows} <= {"reached", "collided"}
    assert rows == drive("driver", "arena", "truth", 0.0, [501, 502], 30.0)


def test_the_rule_drives_round_what_it_sees():
    env = room("arena", "odometry", 0.0)
    seen, _ = env.reset(seed=502, options={"dynamism": 0.0})
    assert env.observation_space.contains(seen)
    rows = drive("rule", "arena", "odometry", 0.0, [502, 503], 30.0)
    assert [row["outcome"] for row in rows] == ["reached", "reached"]


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_the_rule_turns_to_the_goal_and_away_from_a_wall(side):
    free = np.full(72, 4.0)
    assert rule(free, 3.0, 0.0) == pytest.approx((1.0, 0.0))
    assert rule(free, 3.0, 2.0 * side) == pytest.approx((0.0, side))
    wall = free.copy()
    wall[36 - 12 : 36 + 12] = 1.0  # ahead
    forward, turn = rule(wall, 3.0, 0.2 * side)
    assert forward < 0.6
    assert turn * side > 0.0


def test_a_disc_goes_until_it_touches():
    ranges = np.full(72, 4.0)
    ranges[9] = 2.0  # one point, an eighth of a turn from sector 0
    way = free_way(ranges, 0.5)
    assert way[9] == pytest.approx(1.5)
    aside = 2.0 * np.sin(2.0 * np.pi / 36)  # m, of the point beside a way two sectors off
    assert way[11] == pytest.approx(2.0 * np.cos(np.pi / 18) - np.sqrt(0.25 - aside**2))
    assert way[9 + 36] == way[0] == pytest.approx(3.5, abs=0.51)


def test_the_interval_of_a_share_is_wilson_s():
    assert policy_tables.share_interval(8, 10) == pytest.approx((0.4902, 0.9433), abs=1e-4)


def _cells(driver, policy):
    cell = {"reached": 3, "collided": 1, "late": 0, "low": 0.3, "high": 0.95}
    return {
        f"{name} {level:g}": cell | {"outcomes": driver if name == "driver" else policy}
        for name in policy_tables.NAMES
        for level in policy_tables.LEVELS
    }


def test_the_table_has_a_line_for_each_pose_and_a_column_for_each_level():
    lines = policy_tables.shares(_cells("rrrc", "rrrc"), 4).splitlines()
    assert len(lines) == 2 + 5
    assert all(line.count("75% (30% to 95%), 25%") == 5 for line in lines[2:])


def test_the_difference_is_that_of_the_same_seeds():
    # by seed 0, 0, 1, 0: mean 0.25, standard deviation 0.5, over the root of 4
    assert policy_tables.paired("rrrl", "rrcl") == pytest.approx((0.25, 1.96 * 0.25))
    lines = policy_tables.differences(_cells("rrcl", "rrrl")).splitlines()
    assert len(lines) == 2 + 4
    assert all(line.count("+25 ± 49") == 6 for line in lines[2:])


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
    monkeypatch.setattr(train_policy, "tables", lambda *_: "")
    results, curve, weights = (tmp_path / name for name in ("r.json", "c.png", "w.pt"))
    words = [
        "--steps", "512", "--rooms", "1", "--jobs", "1",
        "--seeds", "1", "--seconds", "3",
        "--results", str(results), "--picture", str(curve), "--weights", str(weights), "--no-page",
    ]  # fmt: skip
    assert train_policy.main(words) == 0
    found = json.loads(results.read_text())
    assert found["training"]["steps"] >= 512
    assert len(found["cells"]["odometry 0"]["outcomes"]) == 1
    assert curve.stat().st_size > 1000

# SPDX-License-Identifier: Apache-2.0
"""The experiment with a trained policy: its driver, its table, and a training of the least size."""

from __future__ import annotations

import importlib.util
import json

import numpy as np
import pytest

from scripts.experiments import train_policy
from scripts.experiments.goal_room import free_way, room, rule
from scripts.experiments.train_policy import DRIVER, RULE, gap, reached, run, share
from slam.errors import LogFormatError

CASE = {"weights": "", "level": 0.0, "seconds": 30.0}


def test_the_driver_reaches_goals_where_nothing_is_in_the_way():
    row = run({**CASE, "who": DRIVER, "seed": 501})
    assert row["outcome"] in ("reached", "collided")
    assert row == run({**CASE, "who": DRIVER, "seed": 501})


def test_the_rule_drives_round_what_it_sees():
    env = room("odometry", 0.0)
    seen, _ = env.reset(seed=502, options={"dynamism": 0.0})
    assert env.observation_space.contains(seen)
    for seed in (502, 503):
        assert run({**CASE, "who": RULE, "seed": seed})["outcome"] == "reached"


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


def outcomes(letters: str) -> list[dict[str, str]]:
    words = {word[0]: word for word in train_policy.OUTCOMES}
    return [{"outcome": words[letter]} for letter in letters]


def test_a_share_has_its_interval_and_the_difference_is_that_of_the_same_seeds():
    assert share(outcomes("rrrc")) == "75% (30% to 95%), 25%"
    # by seed 0, 0, 1, 0: mean 0.25, standard deviation 0.5, over the root of 4
    assert gap(reached(outcomes("rrrl")) - reached(outcomes("rrcl"))) == "+25 ± 49"


def test_weights_are_wanted_where_nothing_is_trained(tmp_path, capsys):
    words = ["--results", str(tmp_path / "r.json"), "--no-page", "--steps", "0"]
    assert train_policy.main([*words, "--weights", str(tmp_path / "none.pt")]) == 1
    assert "--steps 0 needs a file of --weights" in capsys.readouterr().err


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"episodes": {}, "steps": 1, "seconds": 1}'])
def test_a_file_that_no_training_left_is_refused(tmp_path, text):
    (tmp_path / "w.json").write_text(text)
    with pytest.raises(LogFormatError, match=r"w\.json: not"):
        train_policy.training(tmp_path / "w.json")


@pytest.mark.skipif(
    importlib.util.find_spec("stable_baselines3") is None,
    reason="STABLE-BASELINES3 IS NOT HERE: training not tested",
)
@pytest.mark.filterwarnings("default")  # of PyTorch and Stable-Baselines3
def test_a_tiny_training_leaves_results_a_curve_and_weights(tmp_path):
    results, picture, weights = (tmp_path / name for name in ("r.json", "c.png", "w.pt"))
    words = [
        "--steps", "512", "--rooms", "1", "--jobs", "1", "--seeds", "1", "--seconds", "3",
        "--level", "0", "--results", str(results), "--picture", str(picture),
        "--weights", str(weights), "--folder", str(tmp_path / "runs"), "--no-page",
    ]  # fmt: skip
    assert train_policy.main(words) == 0
    assert train_policy.training(weights.with_suffix(".json"))["steps"] >= 512
    assert len(json.loads(results.read_text())["runs"]) == len(train_policy.POSES)
    assert picture.stat().st_size > 1000

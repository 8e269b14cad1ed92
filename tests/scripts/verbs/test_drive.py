# SPDX-License-Identifier: Apache-2.0
"""``mobilia drive``: tables of every run, made where they are missing and found where not."""

import csv
import json

import numpy as np
import pytest

from scripts.closed_loop import tables
from scripts.closed_loop.make import carry_out
from scripts.closed_loop.plan import DrivePlan
from scripts.closed_loop.runs import DrivenRun, load, run_one
from scripts.verbs.drive import _seeds
from sim.loop import LoopConfig

pytestmark = pytest.mark.slow
SHORT = {"goals": 1, "loop": LoopConfig(limit_s=1.0)}
FILES = ("goals.csv", "runs.csv", "levels.csv", "closed_loop.png", "paths.png")


def plan(**changes):
    settings = {"scene": "arena", "slams": ("odometry",), "levels": (0.0,), "seeds": (100,)}
    return DrivePlan(**{**settings, **SHORT, **changes})


def test_what_is_lost_is_made_again_to_the_same_bytes(tmp_path):
    wanted = plan(seeds=(100, 101))
    carry_out(wanted, tmp_path)
    before = {name: (tmp_path / name).read_bytes() for name in FILES}
    next((tmp_path / "runs").glob("*_s101_*.npz")).unlink()
    (tmp_path / "levels.csv").unlink()
    carry_out(wanted, tmp_path)
    assert {name: (tmp_path / name).read_bytes() for name in FILES} == before
    with (tmp_path / "goals.csv").open() as file:
        rows = [(row["seed"], row["outcome"], row["reason"]) for row in csv.DictReader(file)]
    assert rows == [("100", "given up", "time"), ("101", "given up", "time")]
    recipe = json.loads((tmp_path / "recipe.json").read_text())
    assert recipe["settings"]["loop"]["limit_s"] == 1.0


def test_seeds_are_a_number_or_a_list():
    assert _seeds(("2",)) == (100, 101)
    assert _seeds(("3", "7")) == (3, 7)
    assert _seeds(("3:6",)) == (3, 4, 5)


def test_a_slam_that_cannot_be_made_has_failed_at_every_goal(tmp_path, monkeypatch):
    (tmp_path / "stillborn.py").write_text("class Slam:\n    def __init__(self): 1 / 0\n")
    monkeypatch.syspath_prepend(tmp_path)
    world = {"scene": "arena", "dynamism": 0.0, "seed": 100}
    run_one(tmp_path / "run.npz", world=world, slam="stillborn:Slam", goals=2, loop={})
    run = load(tmp_path / "run.npz", {**world, "slam": "stillborn:Slam"})
    rows = tables.goal_rows(run)
    assert [(row["outcome"], row["reason"]) for row in rows] == [("failed", "raised")] * 2
    row = tables.run_row(run)
    assert (row["failed"], row["success"], row["failure"]) == (2, 0.0, "raised")
    assert row["failure_words"].count("cannot be made") == 1
    assert "ZeroDivisionError" in row["failure_words"]
    (level,) = tables.levels(rows, [row])
    assert (level["failed"], level["collisions_per_km"]) == (2, None)


def goal(outcome, precision=None):
    return {
        "goal": "lounge", "outcome": outcome, "reason": "", "precision_m": precision,
        "precision_rad": None if precision is None else -0.1, "time_s": 10.0, "driven_m": 500.0,
        "tally": {"by_robot": 1, "by_others": 0, "near_misses": 2, "touched": ["chair1"]},
        "taken": "",
    }  # fmt: skip


def test_a_level_counts_goals_over_seeds_and_says_how_sure_it_is():
    runs = []
    for seed, outcomes in enumerate((("reached", "wrong"), ("reached", "given up"))):
        goals = [goal(o, {"reached": 0.1, "wrong": 0.9}.get(o)) for o in outcomes]
        identity = {"scene": "office", "dynamism": 0.5, "seed": seed, "slam": "mine"}
        rest = {"lost_s": 3.0 if seed else None, "found_s": None, "failure": ["", ""]}
        arrays = {"believed": np.zeros((2, 3)), "true": np.ones((2, 3)), "trusted": np.ones(2)}
        runs.append(DrivenRun(identity=identity, goals=goals, rest=rest, arrays=arrays))
    rows = [row for run in runs for row in tables.goal_rows(run)]
    (level,) = tables.levels(rows, [tables.run_row(run) for run in runs])
    assert (level["goals"], level["reached"], level["success"]) == (4, 2, 0.5)
    assert level["success_low"] == pytest.approx(0.150, abs=1e-3)  # Wilson's, of 2 in 4
    assert level["success_high"] == pytest.approx(0.850, abs=1e-3)
    assert level["precision_m"] == 0.1
    assert level["collisions_per_km"] == 2.0
    assert (level["runs_lost"], level["runs_recovered"]) == (1, 0)

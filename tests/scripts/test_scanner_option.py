# SPDX-License-Identifier: Apache-2.0
"""``--scanner`` does the same on every verb; re-runs and environments follow the scanner."""

from __future__ import annotations

import json
from pathlib import Path

import gymnasium
import numpy as np
import pytest
from typer.testing import CliRunner

import sim  # noqa: F401  (registers the environments)
from scripts.cli import app
from scripts.closed_loop.plan import Plan as DrivePlan
from scripts.closed_loop.runs import load
from scripts.comparison.plan import Plan
from scripts.debugger.episode import Case
from scripts.debugger.recording import Checkpoint, record
from scripts.film.footage import open_run
from scripts.scanner_option import every_of
from sim.loop import LoopConfig
from sim.sensors.lidar.registry import scanner_of
from sim.twins.absence import Change
from slam.errors import InvalidValueError, UnknownNameError

VERBS = ("run", "demo", "generate", "compare", "drive", "blame")


@pytest.mark.parametrize("verb", VERBS)
def test_every_verb_that_simulates_has_the_option(verb: str) -> None:
    shown = CliRunner().invoke(app, [verb, "--help"], env={"COLUMNS": "200"}).output
    assert "--scanner" in shown
    assert "utm30lx" in shown


def test_a_run_keeps_its_scanner_in_the_recipe_and_is_filmed_with_it(tmp_path: Path) -> None:
    out = tmp_path / "run"
    words = ["run", "odometry", "--scene", "arena", "--seconds", "1", "--no-film"]
    done = CliRunner().invoke(app, [*words, "--scanner", "tim561:noise", "--out", str(out)])
    assert done.exit_code == 0, done.output
    assert json.loads((out / "recipe.json").read_text())["settings"]["laser"] == "tim561:noise"
    with open_run(out, view=None) as footage:
        assert footage.stream.metadata.laser == scanner_of("tim561").spec(
            footage.stream.metadata.laser.T_robot_laser
        )


def test_plans_take_names_and_refuse_what_is_none() -> None:
    some = {"slams": ("odometry",), "scenes": ("arena",), "levels": (0.0,), "seeds": (1,)}
    plan = Plan(**some, seconds=10.0, every=1, scanner="rplidar_a1:noise")
    assert plan.recipe(plan.runs()[0]).laser() == scanner_of("rplidar_a1:noise")
    with pytest.raises(UnknownNameError, match="Did you mean 'rplidar_a1'"):
        Plan(**some, scanner="rplidar_a2")
    with pytest.raises(InvalidValueError, match=r"one scan in 8 of 5\.5 a second has 1"):
        Plan(**some, seconds=1.0, every=8, scanner="rplidar_a1")


def test_slams_get_about_as_many_scans_a_second_of_each() -> None:
    names = ("full", "utm30lx", "tim561", "rplidar_a1")
    assert [every_of(name, None, 8) for name in names] == [8, 9, 3, 1]
    assert every_of("utm30lx", 2, 8) == 2


def test_a_closed_loop_drives_with_any_scanner(tmp_path: Path) -> None:
    plan = DrivePlan(
        scene="arena", slams=("odometry",), levels=(0.0,), seeds=(100,), goals=1,
        loop=LoopConfig(scans=1, limit_s=1.0), scanner="rplidar_a1:noise",
    )  # fmt: skip
    ((identity, job),) = plan.jobs()
    job.call(tmp_path / "run.npz", **job.arguments)
    stamps = load(tmp_path / "run.npz", identity).arrays["stamps_ns"]
    assert np.diff(stamps).min() >= 181_818_181


@pytest.mark.parametrize("laser", ["utm30lx:noise", "rplidar_a1"])
def test_a_run_goes_back_to_a_checkpoint_bit_for_bit(laser: str) -> None:
    settings = {"scene": "arena", "dynamism": 1.0, "seed": 1, "laser": laser}
    tape = record(Case(settings=settings, seconds=3.0, slam="odometry", every=1))
    last = len(tape.strip.frames) - 1
    row = tape.row_before(last // 2)
    assert row > 0
    checkpoint = Checkpoint(tape, row)
    checkpoint.verify(last)
    gone = next(n for n, k in zip(tape.names, tape.kinds, strict=True) if k.startswith("chair"))
    for change in (Change(out=(gone,)), Change(frozen=(gone,))):
        strip = checkpoint.rerun(change, last)
        assert [f.stamp_ns for f in strip.frames] == [
            f.stamp_ns for f in tape.strip.frames[row : last + 1]
        ]


@pytest.mark.parametrize("laser", ["utm30lx", "rplidar_a1:noise"])
def test_the_observation_follows_the_scanner(laser: str) -> None:
    beams = scanner_of(laser).spec().n_beams
    env = gymnasium.make("mobilia/Arena-v2", laser=laser)
    seen, _ = env.reset(seed=3)
    assert env.observation_space["ranges"].shape == seen["ranges"].shape == (beams,)
    rooms = gymnasium.make_vec("mobilia/Arena-v2", num_envs=2, laser=laser)
    stacked, _ = rooms.reset(seed=3)
    assert stacked["ranges"].shape == (2, beams)
    for _ in range(3):
        one = env.step(np.array([0.5, 0.2], np.float32))[0]
        many = rooms.step(np.full((2, 2), [0.5, 0.2], np.float32))[0]
        np.testing.assert_array_equal(many["ranges"][0], one["ranges"])
    env.reset(options={"laser": "tim561"})
    assert env.unwrapped.observation_space["ranges"].shape == (811,)
    with pytest.raises(InvalidValueError, match=r"noise_std_m is of the LMS-221, not of .*tim561"):
        env.reset(options={"laser": "tim561", "noise_std_m": 0.0})

# SPDX-License-Identifier: Apache-2.0
"""Options of several verbs: the axes, the crowd and the scanner mean the same on every verb, in
recipes, comparisons, drives, re-runs and environments."""

import json
from pathlib import Path

import gymnasium
import numpy as np
import pytest
from typer.testing import CliRunner

from scripts.cli import app
from scripts.closed_loop.plan import DrivePlan
from scripts.comparison import schema
from scripts.comparison.make import carry_out
from scripts.comparison.plan import Plan
from scripts.debugger.recording import Case, Checkpoint, record
from scripts.film.footage import open_run, title_of
from scripts.options import Axis, Levels, Moves, every_of
from scripts.report.study import study
from scripts.results import check
from sim.core.dynamism import Dynamism
from sim.recording.recipe import RECIPE, Recipe, read_recipe, write_recipe
from sim.sensors.lidar.registry import scanner_of
from sim.twins.absence import Change
from slam.errors import InvalidValueError, LogFormatError

ONE = {"scene": "arena", "seed": 1, "dynamism": 0.5, "seconds": 1.0}


def test_a_recipe_holds_the_knobs_that_are_given_and_no_other(tmp_path: Path):
    plain, both = Recipe(**ONE), Recipe(**ONE, motion=0.2, change=0.0)
    assert {"motion", "change"} & set(plain.words()) == set()
    assert (plain.name, both.name) == ("arena-d0.5-s0001", "arena-d0.5-m0.2-c0-s0001")
    assert len({r.sha256 for r in (plain, both, Recipe(**ONE, motion=0.2))}) == 3
    assert {k: both.simulation()[k] for k in ("motion", "change")} == {"motion": 0.2, "change": 0.0}
    assert "motion" not in plain.simulation()
    write_recipe(tmp_path / RECIPE, both, {})
    assert read_recipe(tmp_path / RECIPE).recipe == both
    words = json.loads((tmp_path / RECIPE).read_text())
    for name, value in (("motion", 2.0), ("change", "much"), ("motion", True)):
        words["recipe"] = {**both.words(), name: value}
        (tmp_path / RECIPE).write_text(json.dumps(words))
        with pytest.raises(LogFormatError, match=f"{RECIPE}.*{name} must"):
            read_recipe(tmp_path / RECIPE)


def test_the_hash_of_a_recipe_without_them_is_that_of_before():
    """Episodes of world 1 stay whole: their recipes' hashes are those on file."""
    assert Recipe(**ONE).sha256 == (
        "287bae2f8fbe7d178715e9469eb2f37139bf1622d64fcdbba97099354fadaf2c"
    )


def test_the_axis_is_what_has_several_levels():
    for given, axis, levels, held in (
        ({"dynamism": ["0", "1"]}, "dynamism", (0.0, 1.0), {}),
        ({"dynamism": ["0", "1"], "change": ["0.2"]}, "dynamism", (0.0, 1.0), {"change": 0.2}),
        ({"motion": ["0:1:1"]}, "motion", (0.0, 1.0), {}),
        ({"motion": ["0.3"], "change": ["0", "1"]}, "change", (0.0, 1.0), {"motion": 0.3}),
        ({"change": ["0.4"]}, "change", (0.4,), {}),
        ({"motion": ["0.8"], "people": ["0", "4"]}, "people", (0.0, 4.0), {"motion": 0.8}),
        ({"dynamism": ["0:1:0.25"]}, "dynamism", (0.0, 0.25, 0.5, 0.75, 1.0), {}),
        ({"dynamism": ["0.1:0.35:0.1"]}, "dynamism", (0.1, 0.2, 0.3), {}),
        ({}, "dynamism", (0.0, 0.25, 0.5, 0.75, 1.0), {}),
    ):
        wanted = {"axis": axis, "levels": levels, **held, "crowd": None}
        assert Levels(**given).of_plan() == wanted
    assert Axis(name="people").at(4.0) == {"dynamism": 0.0, "motion": 0.5, "change": None}
    assert Axis(name="people").crowd_at(4.0) == "escorts:4"
    for level in (1.5, -1.0):
        with pytest.raises(InvalidValueError, match=f"--people must be .*0..80, got {level:g}"):
            Axis(name="people").crowd_at(level)


def test_levels_of_one_axis_leave_the_other_at_0_or_as_it_is_held():
    rates = [Dynamism.of(**Axis(name=name).at(1.0)) for name in ("dynamism", "motion", "change")]
    assert [(r.crowd, r.change) for r in rates] == [(1.0, 1.0), (1.0, 0.0), (0.0, 1.0)]
    assert rates[1].door_rate > 0.0 == rates[2].door_rate
    held = Dynamism.of(**Axis(name="change", motion=0.5).at(1.0))
    assert (held.crowd, held.change) == (0.5, 1.0)
    for wrong in ({"motion": 1.5}, {"crowd": "dragons:1"}):
        for refuse in (lambda w: Axis(**w), lambda w: Moves(**w).world("arena", 0)):
            with pytest.raises(InvalidValueError):
                refuse(wrong)
    with pytest.raises(InvalidValueError, match="cannot be held"):
        Axis(name="change", change=0.5)


@pytest.mark.slow
def test_a_comparison_over_one_axis_names_it_everywhere(tmp_path: Path):
    axis = "change"
    plan = Plan(
        slams=("odometry",), scenes=("arena",), levels=(0.0, 0.5), seeds=(7,), seconds=0.6,
        axis=axis, crowd="none",
    )  # fmt: skip
    assert [run.name for run in plan.runs()] == [f"arena_{axis[0]}{d}_s7" for d in ("0", "0.5")]
    carry_out(plan, tmp_path)
    for name in (schema.RUNS, schema.LEVELS):
        header = (tmp_path / name).read_text().splitlines()[0].split(",")
        assert axis in header
        assert "dynamism" not in header
    read = study(tmp_path)
    assert (read.axis, read.levels) == (axis, [0.0, 0.5])
    assert read.run(read.compared.runs[1]).slams == ["odometry"]
    assert all(found.verdict == "whole" for found in check(tmp_path))


def test_recipes_of_one_axis_hold_the_other_at_0():
    plan = Plan(slams=("odometry",), scenes=("arena",), levels=(0.5,), seeds=(7,), axis="motion")
    recipe = plan.recipe(plan.runs()[0])
    assert (recipe.dynamism, recipe.motion, recipe.change) == (0.0, 0.5, None)
    drive = DrivePlan(
        scene="arena", slams=("odometry",), levels=(0.5,), seeds=(1,), axis="change",
        crowd="escorts:2",
    )  # fmt: skip
    ((identity, job),) = drive.jobs()
    assert identity["dynamism"] == 0.5
    assert job.name.startswith("arena_c0.5_")
    world = {"scene": "arena", "seed": 1, "laser": "full"}
    assert job.arguments["world"] == world | {
        "dynamism": 0.0, "motion": None, "change": 0.5, "crowd": "escorts:2"
    }  # fmt: skip
    for plan_of in (Plan, DrivePlan):
        scene = {"scenes": ("arena",)} if plan_of is Plan else {"scene": "arena"}
        with pytest.raises(InvalidValueError, match="axis must be"):
            plan_of(slams=("odometry",), **scene, levels=(0.5,), seeds=(1,), axis="noise")


def test_a_title_says_what_was_given():
    settings = {"scene": "arena", "dynamism": 0.5, "seed": 4}
    assert title_of(settings) == "arena · dynamism 0.5 · seed 4"
    more = {**settings, "motion": 0.2, "change": None, "crowd": "boards:1"}
    assert title_of(more) == "arena · dynamism 0.5 · motion 0.2 · crowd boards:1 · seed 4"


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


def test_slams_get_about_as_many_scans_a_second_of_each() -> None:
    names = ("full", "utm30lx", "tim561", "rplidar_a1")
    assert [every_of(name, None, 8) for name in names] == [8, 9, 3, 1]
    assert every_of("utm30lx", 2, 8) == 2


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

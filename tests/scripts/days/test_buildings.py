# SPDX-License-Identifier: Apache-2.0
"""A small building in a comparison: who lives in it, who starts anew, who fails, what is kept."""

import csv
import json
import shutil
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from scripts.comparison import folder, make
from scripts.comparison.plan import Plan
from scripts.days import lifelong, scores
from scripts.days.buildings import beside, identity, name_of, of_comparison
from scripts.output import read_recipe_words
from scripts.results import check
from slam.errors import InvalidValueError, LogFormatError
from tests.slam.guests import misbehaving

pytestmark = pytest.mark.slow
CRASHES = f"pipe:{sys.executable} -S -E {Path(misbehaving.__file__)} crash"
PLAN = Plan(
    slams=("shunting", "odometry", CRASHES), scenes=("arena",), axis="change", levels=(0.3,),
    seeds=(7,), seconds=5.0, every=5, scanner="noise", sessions=2, judge_maps=False,
)  # fmt: skip
TABLES = ("runs.csv", "levels.csv", "paired.csv")


@pytest.fixture(scope="module")
def compared(tmp_path_factory: pytest.TempPathFactory) -> folder.Compared:
    out = tmp_path_factory.mktemp("ages") / "out"
    make.carry_out(PLAN, out, more=beside(PLAN))
    return folder.read(out)


def test_each_slam_has_a_row_of_each_building(compared):
    with (compared.folder / "ages.csv").open() as file:
        assert tuple(next(csv.reader(file))) == scores.COLUMNS
    mine, wheels, crashed = compared.ages
    assert [row["slam"] for row in compared.ages] == list(PLAN.slams)
    for row in compared.ages:
        where = [row[name] for name in ("scene", "motion", "change", "seed", "sessions")]
        assert where == ["arena", 0.0, 0.3, 7.0, 2.0]
    assert (mine["map"], mine["to_find"], mine["failed"]) == ("days", 1.0, 0.0)
    assert mine["rmse_session0_m"] < 0.1
    assert mine["right_age1"] in (0.0, 1.0)
    assert mine["map_kb_late"] > 1.0
    assert (wheels["map"], wheels["found_share"], wheels["map_kb_late"]) == ("anew", None, None)
    assert wheels["rmse_last_m"] > 0.0
    assert (crashed["map"], crashed["failed"]) == ("anew", 2.0)
    assert crashed["rmse_last_m"] == float("inf")
    assert "scan 2," in crashed["failure"]
    summed = {(row["slam"], row["metric"]): row for row in compared.ages_levels}
    assert summed["shunting", "found_share"]["n"] == 1.0
    assert summed[CRASHES, "failed_share"]["value"] == 1.0
    assert tuple(compared.ages_levels[0]) == scores.LEVEL_COLUMNS
    (finding,) = check(compared.folder)
    assert finding.verdict == "whole", finding
    assert compared.settings["sessions"] == 2


def test_without_sessions_the_tables_are_the_same_bytes_and_nothing_is_added(compared, tmp_path):
    for name in ("recordings", "entries"):
        shutil.copytree(compared.folder / name, tmp_path / "out" / name)
    shutil.copy(compared.folder / "recipe.json", tmp_path / "out")
    plain = replace(PLAN, sessions=None)
    make.carry_out(plain, tmp_path / "out", more=beside(plain))
    for name in TABLES:
        assert (tmp_path / "out" / name).read_bytes() == (compared.folder / name).read_bytes()
    there = {path.name for path in (tmp_path / "out").iterdir()}
    assert not there & {"ages.csv", "ages_levels.csv", "days"}
    assert "sessions" not in read_recipe_words(tmp_path / "out" / "recipe.json")["settings"]
    assert folder.read(tmp_path / "out").ages == []


def test_a_building_at_each_level_and_the_same_one_only_once():
    plan = replace(PLAN, slams=("odometry",), levels=(0.0, 0.3), seeds=(7, 8))
    buildings = of_comparison(plan)
    names = ["arena_m0_c0_s7", "arena_m0_c0_s8", "arena_m0_c0.3_s7", "arena_m0_c0.3_s8"]
    assert [name_of(recipe) for recipe in buildings.recipes] == names
    sessions = buildings.recordings()["arena_m0_c0.3_s7"]
    told = [(job.arguments["session"], job.arguments["seconds"]) for job in sessions]
    assert told == [(0, 15.0), (1, 5.0)]
    longer = replace(buildings, sessions=4).recordings()["arena_m0_c0.3_s7"]
    assert [job.file_name() for job in longer[:2]] == [job.file_name() for job in sessions]
    held = replace(plan, axis="motion", levels=(0.0, 1.0), change=0.3, seeds=(7,))
    assert [identity(r)["motion"] for r in of_comparison(held).recipes] == [0.0, 1.0]
    one = replace(plan, axis="dynamism", levels=(0.0, 1.0), motion=0.2, change=0.3, seeds=(7,))
    assert [name_of(recipe) for recipe in of_comparison(one).recipes] == ["arena_m0.2_c0.3_s7"]
    assert of_comparison(replace(plan, sessions=None)) is None


@pytest.mark.parametrize(
    "values",
    [
        {"axis": "dynamism"}, {"axis": "motion"}, {"levels": (0.0,)},
        {"axis": "motion", "change": 0.0},
    ],
)  # fmt: skip
def test_sessions_without_change_are_refused(values):
    with pytest.raises(InvalidValueError, match=r"--sessions needs a share.*--change 0\.3 0\.6"):
        replace(PLAN, **values)


@pytest.mark.parametrize(
    ("text", "says"),
    [("{", "no rows"), ("[]", "no rows"), ('{"schema": 1, "rows": []}', "without 'ages'"),
     ('{"schema": 1, "rows": [], "ages": [], "failure": null}', "without 'rows'")],
)  # fmt: skip
def test_what_is_no_life_is_refused(tmp_path, text, says):
    (tmp_path / "life.json").write_text(text)
    with pytest.raises(LogFormatError, match=says):
        lifelong.read(tmp_path / "life.json")


def test_one_that_cannot_start_is_a_row(compared, tmp_path):
    """Also at its start, in each session."""
    (tmp_path / "lives").mkdir()
    files = sorted((compared.folder / "days/sessions").glob("*.npz"))
    mute = f"pipe:{sys.executable} -S -E -c pass"
    lifelong.live(tmp_path / "lives/a.json", sessions=[str(file) for file in files], slam=mute)
    found = json.loads((tmp_path / "lives/a.json").read_text())
    assert [row["place"] for row in found["rows"]] == ["failed", "failed"]
    assert found["ages"] == []
    assert found["failure"]

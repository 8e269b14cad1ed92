# SPDX-License-Identifier: Apache-2.0
"""``mobilia config`` prints every number, and ``--set`` reaches recipes."""

import json
import re
from pathlib import Path

import pytest

import sim
from scripts.options import named
from scripts.output import read_recipe_words, write_recipe
from scripts.spec import command
from scripts.verbs.config import Config
from sim.actors.config import ACTORS
from sim.sensors.lidar import registry
from slam import config_of
from slam.set_numbers import with_set

config = command(Config)

pytestmark = pytest.mark.slow


def numbers(capsys: pytest.CaptureFixture[str], what: str, group: str = "") -> list[dict]:
    config(what, group, as_json=True)
    words = json.loads(capsys.readouterr().out)
    return words["numbers"]


def test_every_number_of_a_tree_is_printed(capsys: pytest.CaptureFixture[str]) -> None:
    found = config_of("shunting")
    assert found is not None
    assert [n["path"] for n in numbers(capsys, "shunting")] == [row.path for row in found[1].rows()]
    (reward,) = numbers(capsys, "shunting{reward=7}", "matching.reward")
    assert (reward["path"], reward["value"], reward["low"]) == ("reward", 7.0, 1e-3)
    local = numbers(capsys, "shunting", "matching.local")
    assert all(n["path"].startswith("matching.local.") for n in local)


SCANNERS = ["lms221", "rplidar_a1", "scanner", "tim561", "utm30lx"]
SET = "scanner(fov_deg=200, beams=401, rate_hz=20, sigma_m=0.02)"


@pytest.mark.parametrize("what", ["actors", "ekf", "occupancy", "utm30lx:noise", SET, *SCANNERS])
def test_other_trees_say_unit_meaning_and_source(
    capsys: pytest.CaptureFixture[str], what: str
) -> None:
    for row in numbers(capsys, what):
        assert row["unit"], row
        assert row["meaning"], row
        assert row["source"], row


def test_a_scanner_says_what_is_simulated_and_where_its_data_sheet_states_it(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert registry.names() == SCANNERS
    found = {row["path"]: row for row in numbers(capsys, "utm30lx")}
    assert (found["rate_hz"]["value"], found["rate_hz"]["unit"]) == (40.0, "Hz")
    assert found["rate_hz"]["source"] == "SPEC: scan speed"
    assert [found[f"noise.{k}.error_m"]["value"] for k in (0, 1)] == [0.010, 0.030]
    assert found["systematic.1.error_m"]["source"] == "EW: accuracy"
    given = {row["path"]: row["value"] for row in numbers(capsys, SET)}
    assert (given["n_beams"], given["rate_hz"], given["noise.0.error_m"]) == (401, 20, 0.02)
    assert given["step_deg"] == 0.5
    needed = [r["path"] for r in numbers(capsys, "scanner") if r["value"] == "needed"]
    assert needed == ["fov_deg", "beams", "rate_hz", "sigma_m"]


def test_actors_are_what_a_seed_means_so_none_can_be_set() -> None:
    assert all(row.about.fixed for row in ACTORS.rows())


def test_every_number_of_the_actors_is_read_by_a_kernel_or_its_caller() -> None:
    files = [p for p in Path(sim.__file__).parent.rglob("*.py") if p.name != "config.py"]
    read = set(re.findall(r"\.([a-z_0-9]+)\b", "\n".join(p.read_text() for p in files)))
    assert {row.path.rpartition(".")[2] for row in ACTORS.rows()} <= read


def test_commas_inside_braces_part_no_names() -> None:
    assert named(["shunting{cell_m=0.1,reward=7},ekf", "pipe:a,b"]) == (
        "shunting{cell_m=0.1,reward=7}", "ekf", "pipe:a,b",
    )  # fmt: skip


def test_recipes_name_the_config_of_every_slam(tmp_path: Path) -> None:
    slams = with_set(["shunting", "odometry"], ["matching.reward=7"])
    write_recipe(tmp_path, "run", {"slams": slams})
    configs = read_recipe_words(tmp_path / "recipe.json")["configs"]
    assert list(configs) == ["shunting{matching.reward=7}"]
    assert configs[slams[0]]["changed"] == {"reward": 7.0}
    (config, _), (_, default) = config_of(slams[0]), config_of("shunting")  # type: ignore[misc]
    assert configs[slams[0]]["sha256"] == config.sha256() != default.sha256()
    write_recipe(tmp_path, "blame", {"slam": "shunting"})
    again = read_recipe_words(tmp_path / "recipe.json")["configs"]
    assert again == {"shunting": {"changed": {}, "sha256": default.sha256()}}

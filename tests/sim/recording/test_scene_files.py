# SPDX-License-Identifier: Apache-2.0
"""A scene's files are part of a recipe by their hash: what was edited since is not simulated."""

from pathlib import Path

import pytest

from scenes.scene_file import files, sha256_of
from scripts.comparison.plan import Plan
from sim.gym import offline
from sim.recording.recipe import Recipe, read_recipe, write_recipe
from sim.simulation import Simulation
from sim.world.robots import FOLDER
from slam.errors import LogFormatError, MissingPathError
from slam.names import NameFromFile

pytestmark = pytest.mark.slow
LAB = """
walls = [[[0, 0], [5, 0], [5, 4], [0, 4], [0, 0]]]
start = [1, 1, 90]
robot = "cart.toml"
"""


@pytest.fixture
def lab(tmp_path: Path) -> Path:
    (tmp_path / "cart.toml").write_text((FOLDER / "turtlebot3.toml").read_text())
    path = tmp_path / "lab.toml"
    path.write_text(LAB)
    return path


@pytest.mark.parametrize("name", ["lab.toml", "cart.toml"])
def test_an_edited_file_is_noticed_by_both_hashes(lab: Path, name: str) -> None:
    recipe = Recipe(scene=str(lab), seed=1, dynamism=0.0, seconds=1.0)
    write_recipe(lab.with_name("recipe.json"), recipe, {})
    Simulation(**recipe.simulation())
    edited = lab.with_name(name)
    edited.write_text(edited.read_text() + "# one more line\n")
    again = read_recipe(lab.with_name("recipe.json")).recipe
    assert again.scene_sha256 == recipe.scene_sha256 != sha256_of(str(lab))
    with pytest.raises(
        LogFormatError, match=f"then {recipe.scene_sha256}, now {sha256_of(str(lab))}"
    ):
        Simulation(**again.simulation())


def test_a_scene_is_found_above_its_result(lab: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(lab.parent)
    (lab.parent / "run").mkdir()
    file = lab.parent / "run" / "recipe.json"
    write_recipe(file, Recipe(scene="lab.toml", seed=1, dynamism=0.0, seconds=1.0), {})
    monkeypatch.chdir("/")
    again = read_recipe(file).recipe
    assert Path(again.simulation()["scene"]).samefile(lab)
    assert again.scene == "lab.toml"
    lab.unlink()
    with pytest.raises(MissingPathError, match=r"^lab\.toml: no such file here or above .*recipe"):
        again.simulation()


def test_a_dataset_tells_no_path_of_this_machine(lab: Path) -> None:
    pytest.importorskip("minari")
    recipe = Recipe(scene=str(lab), seed=1, dynamism=0.0, seconds=1.0)
    offline.write(lab.parent / "set", recipe.name, recipe, [])
    told = (lab.parent / "set" / "data" / "metadata.json").read_text()
    assert "lab.toml" in told
    assert lab.parent.name not in told


def test_a_comparison_keeps_the_hash_of_its_scenes(lab: Path) -> None:
    plan = Plan(slams=("odometry",), scenes=(str(lab), "arena"), levels=(0.0,), seeds=(1,))
    assert plan.scene_sha256 == {str(lab): sha256_of(str(lab))}
    lab.write_text(LAB + "# edited\n")
    told = {name: getattr(plan, name) for name in ("slams", "levels", "seeds", "scene_sha256")}
    told["scenes"] = tuple(NameFromFile(scene, "recipe.json") for scene in plan.scenes)
    again = Plan(**told)
    assert again.recipe(again.runs()[0]).scene_sha256 == plan.scene_sha256[str(lab)]
    assert again.recipe(again.runs()[1]).scene_sha256 is None


def test_the_robot_lies_beside_its_scene(lab: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(lab.parent.parent)
    assert files(lab) == (lab, lab.with_name("cart.toml"))
    assert Simulation(str(lab)).world.drive_config.track == pytest.approx(0.16)

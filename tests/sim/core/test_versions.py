# SPDX-License-Identifier: Apache-2.0
"""When the same seed gives another world, the version of the world goes up."""

import hashlib
import json
from pathlib import Path

import gymnasium
import numpy as np
import pytest

from scripts.debugger.recording import case_of
from scripts.film.footage import open_run
from scripts.output import write_recipe as write_run_recipe
from sim.core import versions
from sim.core.dynamism import Dynamism
from sim.core.versions import WORLD, WorldVersionError
from sim.recording import recipe as recipes
from sim.recording.dataset import Plan, writing
from sim.recording.episode import record
from sim.recording.recipe import RECIPE, Recipe, read_recipe
from sim.recording.sums import write_sums
from sim.recording.verify import regenerate
from sim.simulation import Simulation, tour
from slam.errors import InvalidValueError, LogFormatError

# of the worlds below, by version: a new one gets a line, the others stay
DIGESTS = {
    1: "390da08e98501105aebbe408c65928bd4a949b67349cb050c507a324d7983a9c",
    2: "f5510f42c1be13a2ceaf1675fc6a10f1abe7aae0445eb216873fa040d0c048bd",
}
SCENES, LEVELS, SEED, SECONDS = ("office", "warehouse"), (0.25, 1.0), 7, 1.0


def digest() -> str:
    """Layouts, 40 steps of everything that moves, scans and ticks, to a micrometre."""
    whole = hashlib.sha256()

    def note(values: object) -> None:
        rounded = np.round(np.nan_to_num(np.asarray(values, dtype=np.float64), posinf=-1.0), 6)
        whole.update((rounded + 0.0).tobytes())  # no negative zeros

    for level in np.linspace(0.0, 1.0, 5):
        rates = vars(Dynamism.at(float(level)))
        note([-2.0 if value is None else value for _, value in sorted(rates.items())])
    for scene in SCENES:
        for level in LEVELS:
            simulation = Simulation(scene, seed=SEED, dynamism=level)
            note(simulation.world.model.geom_size)
            note(simulation.world.model.geom_pos)
            for frame in tour(simulation, SECONDS):
                assert frame.scan is not None
                note(frame.truth)
                note(simulation.world.mover_poses())
                note(frame.scan.ranges)
                note(simulation.encoders.ticks)
    return whole.hexdigest()


def test_another_world_is_another_version():
    found = digest()
    assert WORLD in DIGESTS, f"world {WORLD} is new: its digest is {found}"
    assert found == DIGESTS[WORLD], (
        f"the same seeds give another world: raise WORLD in sim/core/versions.py, say in CHANGES "
        f"what became of world {WORLD}, and add the new digest {found} here"
    )
    assert sorted(versions.CHANGES) == list(range(WORLD + 1))
    assert len(set(DIGESTS.values())) == len(DIGESTS)


@pytest.mark.filterwarnings("ignore:.*out of date:DeprecationWarning")
def test_ids_carry_the_version_and_old_ones_name_the_new_one():
    assert gymnasium.spec(f"mobilia/Office-v{WORLD}")
    for make in (gymnasium.make, gymnasium.make_vec):
        with pytest.raises(gymnasium.error.DeprecatedEnv, match=f"Office-v{WORLD}"):
            make("mobilia/Office-v0")


@pytest.fixture(scope="module")
def episode(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("data")
    plan = Plan(recipe=RECIPE_OF, dynamisms=(0.5,), episodes=1)
    with writing(folder, plan):
        record(RECIPE_OF, folder)
    return folder / RECIPE_OF.name


RECIPE_OF = Recipe(scene="arena", seed=1, dynamism=0.5, seconds=0.1)


def of_world(path: Path, world: object) -> None:
    """Let the recipe in the file say so."""
    words = json.loads(path.read_text())
    words.pop("world", None)
    path.write_text(json.dumps(words | ({} if world is None else {"world": world})))


def test_recipes_hold_it_and_one_without_is_of_world_1(episode: Path):
    assert json.loads((episode / RECIPE).read_text())["world"] == WORLD
    of_world(episode / RECIPE, None)
    assert read_recipe(episode / RECIPE).world == 1
    for world in ("one", -1, True, 1.5):
        of_world(episode / RECIPE, world)
        with pytest.raises(LogFormatError, match="world must be a whole number"):
            read_recipe(episode / RECIPE)


@pytest.mark.parametrize(("world", "says"), [(0, "table of dynamism"), (99, "newer")])
def test_another_world_is_not_made_again(episode: Path, world: int, says: str):
    of_world(episode / RECIPE, world)
    write_sums(episode)
    finding = regenerate(episode)
    assert (finding.verdict, finding.ok) == ("other world", True)
    assert f"world version {world}, this mobilia has {WORLD}" in finding.why
    assert says in finding.why
    for opened in (lambda: open_run(episode), lambda: case_of(episode, None, 1)):
        with pytest.raises(WorldVersionError, match=f"recipe.json: .* world version {world}"):
            opened()
    plan = Plan(recipe=RECIPE_OF, dynamisms=(0.5,), episodes=1)
    with (
        writing(episode.parent, plan) as dataset,
        pytest.raises(WorldVersionError, match=f"version {world}"),
    ):
        dataset.missing()


@pytest.mark.parametrize("command", ["run", "compare"])
def test_a_run_of_another_world_is_refused(tmp_path: Path, command: str):
    settings = {"slams": ["odometry"], "seconds": 0.5}
    one = {"scene": "arena"}
    many = {"scenes": ["arena"], "levels": [0.5], "seeds": [1]}
    write_run_recipe(tmp_path, command, settings | (one if command == "run" else many))
    assert json.loads((tmp_path / RECIPE).read_text())["world"] == WORLD
    of_world(tmp_path / RECIPE, 0)
    path = tmp_path if command == "run" else tmp_path / "runs" / "arena_d0.5_s1.npz"
    for opened in (lambda: open_run(path), lambda: case_of(path, None, 1)):
        if command == "compare":
            path.parent.mkdir(exist_ok=True)
            path.touch()
        with pytest.raises(WorldVersionError, match="world version 0"):
            opened()


@pytest.mark.parametrize(
    "name",
    ["seed", "dynamism", "scene", "name", "laser", "labels", "odometry", "twin", "drive", "start",
     "moving_share", "chairs", "seconds", "scanner", "options"],
)  # fmt: skip
def test_an_option_of_the_scene_takes_the_place_of_nothing_else(name: str, tmp_path: Path):
    with pytest.raises(InvalidValueError, match=f"'{name}' is none"):
        Recipe(scene="arena", seed=1, dynamism=0.5, seconds=1.0, options={name: 3})
    recipe = Recipe(
        scene="arena", seed=1, dynamism=0.5, seconds=1.0,
        options={"n_chairs": 3, "scan_height_m": 0.4},
    )  # fmt: skip
    recipes.write_recipe(tmp_path / RECIPE, recipe, {})
    assert read_recipe(tmp_path / RECIPE).recipe == recipe
    words = json.loads((tmp_path / RECIPE).read_text())
    words["recipe"]["options"] = {name: 3}
    (tmp_path / RECIPE).write_text(json.dumps(words))
    with pytest.raises(LogFormatError, match=f"'{name}' is none"):
        read_recipe(tmp_path / RECIPE)

# SPDX-License-Identifier: Apache-2.0
"""Scenes by name, with options; what cannot be is refused; scenes of other packages."""

import hashlib

import pytest

import scenes
from slam.errors import InvalidValueError, UnknownNameError
from tests.built_scenes import NAMES, built, model_bytes
from tests.processes import python

pytestmark = pytest.mark.slow


@pytest.mark.parametrize(
    ("name", "options"),
    [("arena", {"walls": "paper"}), ("office", {"glass": 1}), ("classroom", {"glass": "yes"})],
)
def test_words_and_switches_that_cannot_be_are_refused(name, options):
    with pytest.raises(InvalidValueError, match=next(iter(options))):
        scenes.build(name, 0, **options)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("option", ["n_chairs", "n_people"])
@pytest.mark.parametrize("value", [-1, 1.5, True, "3", 100_000])
def test_counts_that_cannot_be_are_refused_by_name(name, option, value):
    with pytest.raises(InvalidValueError, match=option):
        scenes.build(name, 0, **{option: value})


def test_what_does_not_fit_is_refused():
    with pytest.raises(InvalidValueError, match="n_chairs = 400 does not fit"):
        scenes.build("arena", 0, n_chairs=400)


@pytest.mark.parametrize("seed", [-1, 1.5, True, "a"])
def test_seeds_that_cannot_be_are_refused(seed):
    with pytest.raises(InvalidValueError, match="seed"):
        scenes.build("arena", seed)


def test_an_unknown_option_is_refused():
    with pytest.raises(InvalidValueError, match="n_dogs"):
        scenes.build("arena", 0, n_dogs=1)


def test_an_unknown_scene_names_the_nearest():
    with pytest.raises(UnknownNameError, match="Did you mean 'office'"):
        scenes.build("ofice")


PLUGIN = '''
from pathlib import Path

from scenes.builder import Builder
from scenes.plan import Plan
from scenes.recipe import Draws, finish, free_floor, scatter, seat_chairs

HERE = Path(__file__).parent


def shed(seed, *, n_chairs=2):
    """A shed."""
    plan = Plan(str(HERE / "shed.xml"), floors=["floor_concrete"])
    plan.floor("shed", (0.0, 0.0), (3.0, 2.0), "floor_concrete")
    for name, pos, half in (("n", (0, 2.1), (3.2, 0.1)), ("s", (0, -2.1), (3.2, 0.1)),
                            ("w", (-3.1, 0), (0.1, 2.2)), ("e", (3.1, 0), (0.1, 2.2))):
        plan.wall(name, pos, half)
    plan.mark("room:shed", (0.0, 0.0, 0.0), (3.0, 2.0))
    plan.mark("start:robot", (-2.0, 0.0, 0.0))
    plan.mark("goal:end", (2.0, 0.0, 0.0))
    plan.furnish(str(HERE / "crate.xml"), (0.0, 1.5, 0.0))
    plan.furnish("cabinet", (2.0, 1.75, 0.0))
    builder = Builder(plan.finish())
    draws = Draws(seed)
    seat_chairs(builder, free_floor(builder), plan.seats, n_chairs, draws)
    return finish(builder, "shed", seed, {"n_chairs": n_chairs})
'''
CRATE = """<mujoco model="crate"><worldbody><body name="base">
  <geom type="box" size="0.3 0.3 0.3" pos="0 0 0.3" material="wood_pallet" group="1"/>
  <site name="footprint" type="box" size="0.3 0.3 0.3" pos="0 0 0.3"/>
</body></worldbody></mujoco>"""


def test_a_scene_of_ones_own_needs_no_change_here(tmp_path, monkeypatch):
    plans = scenes.assembly.file_of("plans", "blank").parent
    (tmp_path / "my_pkg").mkdir()
    (tmp_path / "my_pkg/__init__.py").write_text(PLUGIN)
    (tmp_path / "my_pkg/crate.xml").write_text(CRATE)
    blank = (plans / "blank.xml").read_text()
    blank = blank.replace("../parts/common.xml", str(plans.parent / "parts/common.xml"))
    blank = blank.replace('"world.xml"', f'"{plans / "world.xml"}"')
    (tmp_path / "my_pkg/shed.xml").write_text(blank)
    monkeypatch.syspath_prepend(tmp_path)
    scene = scenes.build("my_pkg:shed", 3, n_chairs=3)
    assert [m.kind for m in scene.movers].count("robot") == 1
    assert len(scene.movers) == 4
    model = scene.compile()
    assert model.body("crate0/base").id > 0
    assert {model.camera(i).name for i in range(model.ncam)} == {"top", "follow", "persp"}
    with pytest.raises(InvalidValueError, match="n_dogs"):
        scenes.build("my_pkg:shed", 3, n_dogs=1)


ELSEWHERE = """
import hashlib
import scenes
from tests.built_scenes import NAMES, model_bytes
for name in reversed(NAMES):
    scenes.build(name, 1).compile()
    print(name, hashlib.sha256(model_bytes(scenes.build(name, 7))).hexdigest())
"""


def test_another_process_builds_the_same_bytes_whatever_it_built_before():
    run = python("-c", ELSEWHERE)
    theirs = dict(line.split() for line in run.stdout.splitlines())
    ours = {name: hashlib.sha256(model_bytes(scenes.build(name, 7))).hexdigest() for name in NAMES}
    assert theirs == ours


def test_a_recipe_can_be_named_by_module_and_function():
    assert scenes.build("scenes.random_rooms:random_rooms", 2).initial == (
        built("random-rooms", 2).initial
    )
    for entry in ("no_such_module:f", "scenes.random_rooms:nothing", ":"):
        with pytest.raises(UnknownNameError):
            scenes.build(entry)

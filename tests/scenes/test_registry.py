# SPDX-License-Identifier: Apache-2.0
"""Scenes by name, with options; what cannot be is refused; scenes of other packages."""

import hashlib

import pytest

import scenes
from slam.errors import InvalidValueError, UnknownNameError
from tests.built_scenes import NAMES, built, model_bytes
from tests.processes import python

pytestmark = pytest.mark.slow
COUNTS = ("n_chairs", "n_people")


@pytest.mark.parametrize(
    ("name", "option", "values"),
    [
        ("arena", "walls", ["paper"]),
        ("office", "glass", [1]),
        ("classroom", "glass", ["yes"]),
        ("arena", "n_dogs", [1]),
        ("arena", "seed", [-1, 1.5, True, "a"]),
        *((name, n, [-1, 1.5, True, "3", 100_000]) for name in NAMES for n in COUNTS),
        ("arena", "n_chairs = 400 does not fit", [400]),
    ],
)
def test_what_cannot_be_is_refused_by_name(name, option, values):
    for value in values:
        with pytest.raises(InvalidValueError, match=option):
            scenes.build(name, **{"seed": 0, option.partition(" ")[0]: value})


def test_an_unknown_scene_names_the_nearest():
    with pytest.raises(UnknownNameError, match="Did you mean 'office'"):
        scenes.build("ofice")


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

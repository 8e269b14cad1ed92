# SPDX-License-Identifier: Apache-2.0
"""What needs no simulator, compiler or figure loads none: lists, help and typing errors."""

import importlib
from types import SimpleNamespace

import pytest

from scenes import registry
from slam import system
from tests.processes import mobilia_each

pytestmark = pytest.mark.slow
SLOW = ("mujoco", "numba", "matplotlib", "scipy", "cv2", "rosbags", "joblib")
SAID = {
    "list": "random-rooms",
    "--help": "sensor-card",
    "blame --help": "--horizon",
    "tune --help": "--space",
    "rnu": "Did you mean 'run'",
    "run --sene arena": "No such option: --sene",
    "run shuntin --scene arena": "Did you mean 'shunting'",
    "run ekf --scene aren": "Did you mean 'arena'",
    "compare --slam shunting{a=1 --out x": "'{' without '}'",
}


@pytest.fixture(scope="module")
def answers(tmp_path_factory) -> dict[str, SimpleNamespace]:
    here = tmp_path_factory.mktemp("here")
    found = mobilia_each([*SAID], here)
    assert not any(here.iterdir())
    return found


@pytest.mark.parametrize("words", SAID)
def test_what_simulates_nothing_loads_no_simulator(words, answers):
    answer = answers[words]
    assert SAID[words] in answer.stdout + answer.stderr
    assert not set(SLOW) & set(answer.loaded)


def test_what_a_list_says_of_a_name_is_what_its_docstring_says():
    for name, entry in system.OWN.items():
        module, _, attribute = entry.partition(":")
        own = getattr(importlib.import_module(module), attribute)
        assert system.describe(name) == own.__doc__.strip().partition("\n")[0] != ""
    assert all(registry.describe(name) for name in registry.OWN)
    assert set(system.OWN) <= set(system.names())
    assert set(registry.OWN) <= set(registry.names())


def test_a_public_name_is_what_its_module_has():
    import scenes
    import slam

    for package in (slam, scenes):
        for name in package.__all__:
            assert getattr(package, name) is not None
            assert name in dir(package)
        with pytest.raises(AttributeError, match="nothing_of_that_name"):
            package.nothing_of_that_name  # noqa: B018
    assert slam.names() == system.names()

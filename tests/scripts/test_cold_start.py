# SPDX-License-Identifier: Apache-2.0
"""What needs no simulator, compiler or figure loads none: lists, help and typing errors."""

import importlib

import pytest

from scenes import registry
from slam import system
from tests.processes import python

pytestmark = pytest.mark.slow
SLOW = ("mujoco", "numba", "matplotlib", "scipy", "cv2", "rosbags", "joblib")
_PROBE = """
import sys
from scripts.__main__ import main
sys.argv = ["mobilia", *sys.argv[1:]]
try:
    main()
except SystemExit as ended:
    print(f"ended with {ended.code}")
print("loaded:", *sorted({name.partition(".")[0] for name in sys.modules}))
"""


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("list", "random-rooms"),
        ("--help", "sensor-card"),
        ("blame --help", "--horizon"),
        ("tune --help", "--space"),
        ("rnu", "Did you mean 'run'"),
        ("run --sene arena", "No such option: --sene"),
        ("run shuntin --scene arena", "Did you mean 'shunting'"),
        ("run ekf --scene aren", "Did you mean 'arena'"),
        ("compare --slam shunting{a=1 --out x", "'{' without '}'"),
    ],
)
def test_what_simulates_nothing_loads_no_simulator(words, said, tmp_path):
    ran = python("-c", _PROBE, *words.split(), cwd=tmp_path)
    answer, _, loaded = ran.stdout.rpartition("loaded:")
    assert said in answer + ran.stderr
    assert "ended with" in answer
    assert not set(SLOW) & set(loaded.split())
    assert not any(tmp_path.iterdir())


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

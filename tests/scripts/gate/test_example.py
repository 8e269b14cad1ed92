# SPDX-License-Identifier: Apache-2.0
"""The example repository with a gate: its tests pass, and what a wrong one says."""

import re
import shutil
from xml.etree import ElementTree

import pytest
import yaml

from tests.commands import read_by
from tests.processes import REPO, python

pytestmark = pytest.mark.slow
EXAMPLE = REPO / "docs" / "examples" / "ci"
WORKFLOW = EXAMPLE / ".github" / "workflows" / "slam.yml"
WRONG = """
import pytest
from slam.odometry import OdometrySlam

@pytest.mark.mobilia(track="rush-hour", seconds=4, seeds=2)
def test_wheels_are_exact(mobilia_stream):
    assert len(list(mobilia_stream)) == len(mobilia_stream.truth)
    run = mobilia_stream.run(OdometrySlam())
    assert run.error_m < 1e-6
"""
MARKS = {
    'track="rush-huor"': "no track is called 'rush-huor'. Did you mean 'rush-hour'?",
    'track="rush-hour", lvel=1': "unknown key 'lvel'; known: track, level, seeds, seconds",
    'track="rush-hour", level=0.3': "must be one of 0, 0.25, 0.5, 0.75, 1, got 0.3",
    'track="rush-hour", seeds="many"': "mobilia.seeds must be a whole number from 1",
    "": "mobilia.track must be a word, got nothing",
}


@pytest.fixture(scope="module")
def ran(tmp_path_factory: pytest.TempPathFactory) -> tuple[str, ElementTree.Element]:
    """What pytest prints and writes in a copy of the example, with tests that are wrong beside."""
    folder = tmp_path_factory.mktemp("ci") / "copy"
    shutil.copytree(EXAMPLE, folder)
    own = folder / "test_slam.py"
    own.write_text(own.read_text().replace("seeds=2", "seeds=1"))  # a recording takes seconds
    (folder / "test_wrong.py").write_text(WRONG)
    for k, mark in enumerate(MARKS):
        test = f"import pytest\n@pytest.mark.mobilia({mark})\ndef test_it(mobilia_stream): ...\n"
        (folder / f"test_mark_{k}.py").write_text(test)
    done = python(
        "-m", "pytest", "-p", "mobilia.pytest_plugin", "--continue-on-collection-errors",
        "--strict-markers", "--junit-xml=junit.xml", cwd=folder, check=False,
        PYTEST_DISABLE_PLUGIN_AUTOLOAD="1",
    )  # fmt: skip
    return done.stdout, ElementTree.parse(folder / "junit.xml").getroot()


def test_its_tests_pass_and_the_wrong_ones_say_numbers_seed_and_command(ran):
    said, junit = ran
    assert "2 failed, 1 passed, 5 errors" in said
    assert re.search(
        r"<rush-hour-v1, level 0\.5, seed 1: held, 0\.\d+ m off, 0\.\d+ m/s>\n"
        r"mobilia blame --slam slam\.odometry:OdometrySlam --scene station .*--seed 1 ", said
    )  # fmt: skip
    names = [case.get("name") for case in junit.iter("testcase")]
    assert "test_it_holds_in_a_crowd[rush-hour-v1-0.5-0]" in names


@pytest.mark.parametrize("words", MARKS.values())
def test_a_wrong_mark_is_told_in_one_line(ran, words):
    assert [line for line in ran[0].splitlines() if line.startswith("test_mark_") and words in line]


def test_a_folder_that_hides_a_package_is_told(tmp_path):
    (tmp_path / "slam").mkdir()
    (tmp_path / "slam" / "__init__.py").touch()
    (tmp_path / "test_it.py").write_text(
        "import pytest\n@pytest.mark.mobilia(track='rush-hour')\ndef test_it(mobilia_stream): ...\n"
    )
    words = ("-m", "pytest", "-p", "mobilia.pytest_plugin", "-p", "no:cacheprovider")
    alone = {"PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1", "PYTHONPATH": f"{tmp_path}:{REPO}"}
    said = python(*words, cwd=tmp_path, check=False, **alone).stdout
    assert f"{tmp_path / 'slam'} hides the package 'slam' of mobilia: rename it" in said


def test_the_plugin_loads_nothing_until_it_is_asked_for():
    words = "import sys, mobilia.pytest_plugin; print(*{n.partition('.')[0] for n in sys.modules})"
    assert not {"slam", "sim", "scripts", "numpy", "mujoco"} & {*python("-c", words).stdout.split()}


def test_the_workflow_runs_what_is_there(monkeypatch):
    steps = yaml.safe_load(WORKFLOW.read_text())["jobs"]["gate"]["steps"]
    lines = [step["run"] for step in steps if "run" in step]
    for line in filter(lambda line: line.startswith("mobilia"), lines):
        assert read_by(monkeypatch)(line).slam == "my_slam:MySlam"
    assert sum(line.startswith("mobilia gate") for line in lines) == 2
    assert "class MySlam" in (EXAMPLE / "my_slam.py").read_text()

# SPDX-License-Identifier: Apache-2.0
"""A run of a comparison, simulated again for a film or an inquest, is the run on file."""

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from scripts.cli import app
from scripts.comparison import make
from scripts.comparison.again import run_of
from scripts.comparison.plan import Plan
from scripts.comparison.run_file import RunFile
from scripts.debugger.recording import case_of, record
from scripts.film.footage import open_run
from slam.errors import InvalidValueError, LogFormatError

pytestmark = pytest.mark.slow
READERS = (open_run, lambda path: case_of(path, None, 1))  # of films and of inquests
PLAN = {"scenes": ("arena",), "levels": (0.5,), "seeds": (7,), "scanner": "noise"}


@pytest.fixture(scope="module")
def run(tmp_path_factory) -> Path:
    out = tmp_path_factory.mktemp("compare") / "out"
    make.carry_out(Plan(slams=("odometry", "occupancy"), seconds=1.3, **PLAN), out)
    return out / "runs" / "arena_d0.5_s7.npz"


def test_a_film_shows_the_scans_that_its_slams_got(run):
    footage, on_file = open_run(run, view=None), RunFile(run)
    frames = list(footage.stream)
    assert footage.stream.length == len(frames) == 7
    assert (footage.slam, footage.title) == ("occupancy", "arena · dynamism 0.5 · seed 7")
    assert [frame.stamp_ns for frame in frames] == on_file.stamps_ns.tolist()
    np.testing.assert_array_equal([frame.scan.ranges for frame in frames], on_file.ranges)
    np.testing.assert_array_equal([frame.truth for frame in frames], on_file.truth)


@pytest.mark.parametrize("slam", ["odometry", "occupancy"])
def test_an_inquest_is_held_on_the_run_on_file(run, slam):
    case = case_of(run, slam, 1)
    strip = record(case).strip
    np.testing.assert_array_equal(strip.believed, RunFile(run).believed(slam).poses)
    np.testing.assert_array_equal(strip.truth, RunFile(run).truth)
    np.testing.assert_array_equal(case.recorded, strip.believed)


def test_the_verbs_take_it(run, tmp_path):
    film, out = tmp_path / "film.mp4", tmp_path / "blame"
    made = CliRunner().invoke(app, ["render", str(run), "--no-3d", "--out", str(film)])
    assert made.exit_code == 0, made.exception
    assert film.stat().st_size > 1000
    asked = CliRunner().invoke(app, ["blame", str(run), "--out", str(out)])
    assert asked.exit_code == 0, asked.exception
    assert "note:" not in asked.stdout  # run again, it is the run on file
    assert json.loads((out / "blame.json").read_text())["slam"] == "occupancy"


def test_what_is_no_run_is_told_in_a_line(run, tmp_path):
    for opened in READERS:
        with pytest.raises(LogFormatError, match=r"many runs: name one of them, as .*_s7\.npz"):
            opened(run.parent.parent)
    with pytest.raises(InvalidValueError, match=r"--every: .* one scan in 8"):
        case_of(run, None, 4)
    with pytest.raises(LogFormatError, match=r"first is arena_d0\.5_s7"):
        run_of(run.with_name("arena_d1_s7.npz"))
    (tmp_path / "runs").mkdir()
    with pytest.raises(LogFormatError, match="No such file"):
        run_of(tmp_path / "runs" / "x.npz")
    (tmp_path / "recipe.json").write_text('{"command": "drive"}')
    with pytest.raises(LogFormatError, match="went its own way"):
        run_of(tmp_path / "runs" / "x.npz")
    (tmp_path / "recipe.json").write_text(
        '{"command": "compare", "world": 2, "settings": {"slams": 3}}'
    )
    with pytest.raises(LogFormatError, match="no recipe of a comparison: "):
        run_of(tmp_path / "runs" / "x.npz")


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("{", "recipe.json: no recipe"),
        ('{"world": 2, "settings": {"sce', "recipe.json: no recipe"),
        ("[]", "not a JSON object"),
        ('{"command": "run"}', "no settings"),
        ('{"command": "bench", "settings": {}}', "made by 'mobilia bench'"),
        ('{"command": "compare", "settings": {}}', "a comparison of many runs: name one"),
        ('{"command": "drive", "settings": {}}',
         "made by 'mobilia drive', where each SLAM's robot went its own way"),
        ('{"command": "run", "settings": {"log": "a.log"}}', "this run was on a log"),
        ('{"world": 2, "settings": {"log": "a.log", "slams": ["ekf"]}}',
         "the film of the log is mobilia render a.log --slam ekf"),
        ('{"world": 2, "settings": {"scene": "arena", "seconds": "long"}}',
         "no recipe of a run: seconds must be a number"),
        ('{"world": 2, "settings": {"scene": "arena", "slams": [7]}}',
         "slams must be a list of names, got [7]"),
        ('{"world": 2, "settings": {"scene": "arena", "seconds": 2, "cut": {"from_s": 5}}}',
         "cut.from_s must be < 2 s, its run's end, got 5"),
        ('{"world": 2, "settings": {"scene": "arena", "seconds": 2, "cut": {"from": 1}}}',
         "cut has from_s, keep, every, beams, but no 'from'"),
    ],
)  # fmt: skip
def test_a_recipe_that_cannot_be_one_is_told_in_a_line(tmp_path: Path, text: str, says: str):
    (tmp_path / "recipe.json").write_text(text)
    for opened in READERS:
        with pytest.raises(LogFormatError, match=r"^[^\n]*$") as told:
            opened(tmp_path)
        assert says in str(told.value)

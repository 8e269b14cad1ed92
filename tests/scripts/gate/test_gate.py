# SPDX-License-Identifier: Apache-2.0
"""``mobilia gate``: what is saved is held against, on the very same recordings, or refused."""

import json
import shlex
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import pytest
from typer.testing import CliRunner

from scripts.benchmark import runs_file, submission
from scripts.benchmark.tracks import newest
from scripts.cli import TYPED, app
from scripts.gate import make
from scripts.gate.runs import of_results, of_tracks
from scripts.gate.told import Paired
from scripts.verbs.blame import Blame
from sim.sensors.lidar.registry import scanner_of
from tests.commands import read_by

pytestmark = pytest.mark.slow
SAVE = "--tracks tour-guide --seeds 4 --seconds 2 --level 0"
ALWAYS_FAILS = """
class Slam:
    def reset(self): ...
    def update(self, frame): raise ValueError("no map yet")
    def map(self): ...
    def trajectory(self): ...
"""


def gate(words: str) -> tuple[int, str]:
    """Exit status, and what is printed."""
    done = CliRunner().invoke(app, ["gate", *shlex.split(words)])
    error = "" if done.exception is None else str(done.exception)
    usual = 2 if isinstance(done.exception, TYPED) else done.exit_code
    status = getattr(done.exception, "status", usual)
    return status, " ".join((done.output + error).split())


@pytest.fixture(scope="module")
def saved(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Results of four short runs, with their recordings beside them."""
    folder = tmp_path_factory.mktemp("gate")
    file = folder / "results.json"
    assert gate(f"--slam odometry --save {file} --out {folder / 'out'} {SAVE}")[0] == 0
    return file


def test_unchanged_is_undecided_after_few_runs_and_the_recordings_stay(saved):
    out = saved.parent / "out"
    made = {file: file.stat().st_mtime_ns for file in out.glob("recordings/*.npz")}
    status, said = gate(f"--slam odometry --against {saved} --out {out}")
    assert status == 0
    assert "is undecided against results.json: error × 1.00, 0 newly lost" in said
    assert made == {file: file.stat().st_mtime_ns for file in out.glob("recordings/*.npz")}
    (case,) = ElementTree.parse(out / "junit.xml").getroot()
    assert case[0].tag == "skipped"
    assert "| tour-guide-v1 | 4 | 0 [0] |" in (out / "summary.md").read_text()
    assert CliRunner().invoke(app, ["verify", str(out)]).exit_code == 0
    assert CliRunner().invoke(app, ["verify", str(saved)]).exit_code == 0


def test_worse_ends_with_status_1(saved, monkeypatch):
    """By errors so small that any SLAM is worse, and a test that a few runs are enough for."""
    monkeypatch.setattr("scripts.gate.evidence.WRONG", 0.2)
    results = submission.read(saved)
    better = {
        track: {
            at: (scans, {"odometry": slams["odometry"] | {"ate_se2_m": 1e-3}})
            for at, (scans, slams) in runs.items()
        }
        for track, runs in results.runs.items()
    }
    file = saved.parent / "better.json"
    runs_file.write(file, replace(results, runs=better))
    out = saved.parent / "out"
    status, said = gate(f"--slam odometry --against {file} --out {out}")
    assert status == 1
    assert "`odometry` is worse than better.json" in said
    (case,) = ElementTree.parse(out / "junit.xml").getroot()
    assert case[0].tag == "failure"
    assert "mobilia blame --slam odometry" in (out / "summary.md").read_text()


def test_other_scans_are_refused(saved):
    results = submission.read(saved)
    others = {
        track: {at: ("0" * 64, slams) for at, (_, slams) in runs.items()}
        for track, runs in results.runs.items()
    }
    file = saved.parent / "others.json"
    runs_file.write(file, replace(results, runs=others))
    status, said = gate(f"--slam odometry --against {file} --out {saved.parent / 'out'}")
    assert status == 2
    assert "tour-guide-v1, level 0, seed 0 is of other scans than here" in said
    assert not [file for file in (saved.parent / "out").iterdir() if file.name in make.TOLD]


def test_a_slam_that_fails_in_all_of_the_first_runs_is_told_in_one_line(saved, monkeypatch):
    (saved.parent / "always_fails.py").write_text(ALWAYS_FAILS)
    monkeypatch.syspath_prepend(saved.parent)
    monkeypatch.setenv("PYTHONPATH", str(saved.parent), prepend=":")
    words = f"--slam always_fails:Slam --against {saved} --out {saved.parent / 'out'}"
    status, said = gate(words)
    assert status == 2
    assert said.endswith("scan 0, raised ValueError: no map yet (always_fails.py:4)")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("--slam ekf", "name exactly one of --against and --save"),
        ("--slam ekf --save a.json --tracks nowhere", "no track is called 'nowhere'"),
        ("--slam ekf --save a.json --level 0.3", "level of a track must be one of 0, 0.25"),
        ("--slam ekf --save out/gate/a.json", "--save must lie outside --out, out/gate"),
        ("--slam ekf --save /proc/a.json", "cannot write /proc/a.json"),
        ("--slam ekf --save a.json --seeds 21", "--seeds must be 1 to 20, got 21"),
        ("--slam ekf --save a.json --set matchin=1", "'matchin'"),
        ("--slam 'oracle(ekf)' --save a.json", "an oracle is a control"),
        (
            "--slam ekf --against a.json",
            "no such file; to make it: mobilia gate --slam ekf",
        ),
        ("--slam ekf --against a.json --level 1", "--level is of --save"),
        ("--slam ekf --against bad.json", "bad.json: no results of the benchmark"),
    ],
)
def test_wrong_words_are_one_line_and_status_2(words, said, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "bad.json").write_text(json.dumps({"a": 1}))
    status, told = gate(words)
    assert (status, said in told) == (2, True), told
    assert [file.name for file in tmp_path.iterdir()] == ["bad.json"]


def test_the_command_that_shows_a_run_makes_its_very_world(monkeypatch):
    read = read_by(monkeypatch)
    for track in newest():
        (one,) = of_tracks((track,), 0.5, 1, 20.0)
        asked = read(one.blame("ekf"))
        assert isinstance(asked, Blame)
        case = asked._simulated()
        laser = scanner_of(case.settings["laser"])
        assert {**case.settings, "labels": True, "laser": laser} == one.recipe.simulation()
        assert (case.seconds, case.every, case.slam) == (20.0, one.every, "ekf")


def test_the_runs_of_saved_results_come_track_by_turns(saved):
    (first, *_) = runs = of_results(submission.read(saved))
    assert [one.at for one in runs] == [(0.0, seed) for seed in range(4)]
    assert str(first) == "tour-guide-v1, level 0, seed 0"
    assert Paired(slam="ekf", against="a", total=4).worst() is None

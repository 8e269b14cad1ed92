# SPDX-License-Identifier: Apache-2.0
"""The counterfactual debugger on SLAMs whose weakness is known by construction."""

import json
import math
from pathlib import Path

import cv2
import pytest
from typer.testing import CliRunner

from scripts.cli import app
from scripts.debugger.counterfactual import Inquest, Question, Trial, hold
from scripts.debugger.make import blame_picture
from scripts.debugger.recording import Case, Tape, record
from scripts.debugger.words import as_json, headline
from sim.twins.absence import Change
from slam.errors import SlamFailedError, UnknownNameError
from slam.evaluation.lost import Divergence

pytestmark = pytest.mark.slow
SKITTISH = """
import numpy as np
from slam import Estimate, Trajectory, se2

class Skittish:
    '''Knows its pose to the mm, until something is nearer than 1.4 m: then it is 1 m off.'''

    def __init__(self): self.reset()
    def reset(self): self.first, self.off = None, 0.0
    def map(self): return None
    def trajectory(self): return Trajectory(stamps_ns=np.zeros(0, int), poses=np.zeros((0, 3)))

    def update(self, frame):
        here = frame.odometry.T_odom_robot
        self.first = here if self.first is None else self.first
        ranges = frame.scan.ranges[frame.scan.valid]
        self.off = 1.0 if self.off or (ranges < 1.4).any() else 0.0
        pose = se2.between(self.first, here) + [self.off, 0.0, 0.0]
        return Estimate(stamp_ns=frame.stamp_ns, T_map_robot=pose, covariance=np.eye(3))

class Moody(Skittish):
    '''Off by what nobody can foresee.'''

    moods = iter(range(10_000_000))

    def update(self, frame):
        estimate = super().update(frame)
        pose = estimate.T_map_robot + 1e-6 * next(self.moods)
        return Estimate(stamp_ns=frame.stamp_ns, T_map_robot=pose, covariance=np.eye(3))

class Late(Skittish):
    '''Not before two seconds.'''

    def update(self, frame):
        calm = frame.stamp_ns < 2_000_000_000
        estimate = super().update(frame)
        self.off = 0.0 if calm else self.off
        here = se2.between(self.first, frame.odometry.T_odom_robot) + [self.off, 0.0, 0.0]
        return Estimate(stamp_ns=frame.stamp_ns, T_map_robot=here, covariance=np.eye(3))

class Blind(Skittish):
    '''Off after three seconds, whatever it sees.'''

    def update(self, frame):
        self.off = 1.0 if frame.stamp_ns > 3_000_000_000 else 0.0
        here = frame.odometry.T_odom_robot
        pose = here + [self.off, 0.0, 0.0]
        return Estimate(stamp_ns=frame.stamp_ns, T_map_robot=pose, covariance=np.eye(3))
"""
ROOM = {
    "scene": "arena", "walls": "none", "n_chairs": 3, "odometry": "ideal", "dynamism": 1.0,
    "change": 0.0, "crowd": "none",
}  # fmt: skip


@pytest.fixture(scope="module", autouse=True)
def _slams(tmp_path_factory):
    folder = tmp_path_factory.mktemp("slams")
    (folder / "skittish_slams.py").write_text(SKITTISH)
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(folder)
        yield


def case(name: str, seconds: float = 8.0, **changes) -> Case:
    settings = {**ROOM, "seed": 6, **changes}
    return Case(settings=settings, seconds=seconds, slam=f"skittish_slams:{name}", every=4)


@pytest.fixture(scope="module")
def startled() -> tuple[Tape, Inquest]:
    tape = record(case("Skittish", 5.0))
    return tape, hold(tape, Question(horizon_s=1.0, repeats=1))


def test_the_culprit_is_who_was_there_by_construction(startled):
    tape, found = startled
    assert found.moment is not None
    strip, row = tape.strip, found.moment.found
    away = [math.dist(pose[:2], strip.truth[row][:2]) for pose in strip.poses[row]]
    near = min((d, n) for d, n in zip(away, tape.names, strict=True) if n != "robot")
    assert near[0] < 1.6
    assert found.verdict == "culprit"
    assert found.firm
    best = found.named[0]
    assert best.change == Change(out=(near[1],))
    assert best.share == pytest.approx(1.0, abs=0.05)
    assert headline(found)[0].startswith(f"Culprit: {near[1]}, its presence")
    assert all(t.path_m == 0.0 for t in found.trials)  # nobody touches anybody here


def test_two_that_do_it_each_are_joint():
    """In this run two chairs come near: without either the other one does it."""
    found = hold(record(case("Skittish", 6.0, seed=7)), Question(horizon_s=1.0, repeats=1))
    assert found.verdict == "joint"
    assert found.named[0].change == Change(out=("chair0", "chair1"))
    assert headline(found)[0].startswith("Joint: nobody alone, but chair0 + chair1 out cures it")


@pytest.fixture(scope="module")
def accompanied() -> Tape:
    room = {"crowd": "escorts:4,boards:1", "n_chairs": 0, "n_people": 0, "dynamism": 0.5}
    return record(case("Late", 4.0, **room))


def test_a_crowd_that_does_it_together_is_named_by_one_word(accompanied, tmp_path: Path):
    found = hold(accompanied, Question(horizon_s=0.6, repeats=1, top=2))
    assert found.verdict == "joint"
    best = found.named[0]
    assert (best.kind, str(best.change)) == ("group", "escorts out")
    assert best.change.out == tuple(f"escort{k}" for k in range(4))
    assert headline(found)[0].startswith("Joint: nobody alone, but escorts out cures it")
    assert not any(t.cured for t in found.trials if t.kind == "single")
    blame_picture(tmp_path / "blame.png", found)
    assert cv2.imread(str(tmp_path / "blame.png")).std() > 10.0
    trials = as_json(found)["trials"]
    assert "escorts" in {trial.get("called") for trial in trials}


def test_only_those_that_are_asked_for_are_tried(accompanied):
    who = ("board_pusher0", "escort[0-3]")
    found = hold(accompanied, Question(horizon_s=0.6, repeats=1, who=who))
    words = {str(t.change) for t in found.trials if t.kind != "all"}
    assert words == {
        "board_pusher0 + board0 out", "board_pusher0 frozen",  # out with what it holds
        "escort[0-3] out", "escort[0-3] frozen",
    }  # fmt: skip
    assert headline(found)[0].startswith("Joint: nobody alone, but escort[0-3] out cures it")
    with pytest.raises(UnknownNameError, match="no group is called 'dragons'"):
        hold(accompanied, Question(horizon_s=0.6, repeats=1, who=("dragons",)))


def test_a_slam_that_fails_by_itself_is_not_blamed_on_the_movers():
    found = hold(record(case("Blind", 6.0)), Question(horizon_s=1.0, repeats=1))
    assert found.verdict == "not the movers"
    assert {t.kind for t in found.trials} >= {"all"}
    assert "sensor, geometry or odometry" in headline(found)[0]


def test_a_slam_that_does_not_repeat_itself_is_refused():
    tape = record(case("Moody", 3.0))
    with pytest.raises(SlamFailedError, match="does not repeat itself"):
        hold(tape, Question(at_s=2.0, horizon_s=0.5))


def trial(name: str, share: float, again: int, kind: str = "single") -> Trial:
    names = tuple(name.split("+"))
    return Trial(
        change=Change(out=names), kind=kind, rise_m=1.0 - share, share=share, cured=share > 0.5,
        again=again,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("trials", "recurs", "verdict", "firm"),
    [
        ([trial("a", 0.9, 3), trial("b", 0.1, 0)], 3, "culprit", True),
        ([trial("a", 0.9, 2), trial("b", 0.1, 0)], 3, "culprit", False),
        ([trial("a", 0.9, 3), trial("b", 0.8, 3)], 3, "several", True),
        ([trial("a", 0.9, 1)], 3, "undecided", True),
        ([trial("a", 0.9, 3)], 1, "undecided", False),
        ([trial("a", 0.2, 0), trial("a+b", 0.9, 3, "pair")], 3, "joint", True),
        ([trial("a", 0.2, 0), trial("a+b+c", 0.1, 0, "all")], 3, "not the movers", True),
    ],
)
def test_the_verdict_follows_the_rule(trials, recurs, verdict, firm):
    tape = Tape(case=case("Blind"), names=("a", "b", "c"), kinds=("chair_swivel",) * 3)
    found = Inquest(
        tape=tape, question=Question(), largest_rise_m=1.0, end_error_m=1.0,
        moment=Divergence(begins=1, found=2, rise_m=1.0), rise_m=1.0, recurs=recurs, trials=trials,
    )  # fmt: skip
    assert found.verdict == verdict
    assert found.firm == firm or verdict == "undecided"


def mobilia(*words: str | Path):
    return CliRunner().invoke(app, list(map(str, words)))


def test_a_run_without_divergence_says_so_and_is_a_result(tmp_path: Path):
    run, out = tmp_path / "run", tmp_path / "out"
    made = mobilia("run", "odometry", "--scene", "arena", "--seconds", "2", "--seed", "3",
                   "--no-film", "--out", run)  # fmt: skip
    assert made.exit_code == 0
    done = mobilia("blame", run, "--out", out)
    assert done.exit_code == 0, done.exception
    assert "No divergence" in done.stdout
    assert "note:" not in done.stdout  # run again, it is the run on file
    words = json.loads((out / "blame.json").read_text())
    assert words["verdict"] == "none"
    assert words["slam"] == "odometry"
    assert 0.0 < words["largest_rise_m"] < 0.25


def test_the_verb_leaves_picture_table_and_numbers(tmp_path: Path):
    out = tmp_path / "out"
    done = mobilia(
        "blame", "--scene", "arena", "--option", "walls=none", "n_chairs=3",
        "--option", "odometry=ideal", "--dynamism", "1", "--seed", "6", "--seconds", "4",
        "--change", "0", "--crowd", "none",
        "--slam", "skittish_slams:Skittish", "--every", "4", "--horizon", "1", "--repeats", "1",
        "--out", out,
    )  # fmt: skip
    assert done.exit_code == 0, done.exception
    assert "Held fixed" in done.stdout
    words = json.loads((out / "blame.json").read_text())
    assert words["verdict"] == "culprit"
    assert words["checkpoint_s"] < words["begins_s"] <= words["found_s"] < words["horizon_s"]
    assert {len(t["errors_m"]) for t in words["trials"]} != {0}
    picture = cv2.imread(str(out / "blame.png"))
    assert picture.shape[0] > 900
    assert picture.std() > 10.0
    assert json.loads((out / "recipe.json").read_text())["settings"]["every"] == 4

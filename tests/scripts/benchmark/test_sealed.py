# SPDX-License-Identifier: Apache-2.0
"""Seeds that are promised by their hash, and runs of a submission that come out again."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from scripts.benchmark import sealed, submission
from scripts.benchmark.make import Wanted, carry_out
from scripts.benchmark.submission import made_again
from scripts.benchmark.tracks import TEST, TRACKS, TRAIN, newest
from slam.errors import InvalidValueError, LogFormatError

TRACK = newest()["no-walls"]


def test_they_come_back_and_are_none_that_is_published(tmp_path: Path):
    drawn, path = sealed.drawn(50), tmp_path / "seeds.json"
    assert len(set(drawn.seeds)) == 50
    assert not {*TRAIN, *TEST} & set(drawn.seeds)
    sealed.write(path, drawn)
    assert path.stat().st_mode & 0o077 == 0
    assert sealed.read(path) == drawn
    with pytest.raises(InvalidValueError, match="exists"):
        sealed.write(path, drawn)


def test_the_seal_is_of_each_seed_its_order_and_the_salt():
    """The salt hides them: without it, a hundred million guesses would find two seeds."""
    drawn = sealed.drawn(3)
    others = [
        replace(drawn, seeds=drawn.seeds[::-1]),
        replace(drawn, seeds=drawn.seeds[:2]),
        replace(drawn, salt=sealed.drawn(1).salt),
    ]
    assert len({one.sha256 for one in (drawn, *others)}) == 4
    assert replace(drawn).sha256 == drawn.sha256


@pytest.mark.parametrize(
    ("key", "value", "says"),
    [
        ("sealed", [720], "none that is published"),
        ("sealed", [21, 21], "each once"),
        ("sealed", [2**40], "whole number"),
        ("sealed", "21", "sealed must be a list"),
        ("salt", "", "64 hexadecimal"),
        ("what", "a recipe", "no sealed seeds"),
        ("tracks", {}, "one or more"),
        ("tracks", {TRACK.name: "0" * 64}, "none of this version's"),
        ("more", 1, "no sealed seeds"),
    ],
)
def test_what_is_wrong_is_named(tmp_path: Path, key: str, value: object, says: str):
    path = tmp_path / "seeds.json"
    sealed.write(path, sealed.drawn(2))
    path.write_text(json.dumps(json.loads(path.read_text()) | {key: value}))
    with pytest.raises(LogFormatError, match=says) as told:
        sealed.read(path)
    assert str(path) in str(told.value)


def test_a_later_track_takes_nothing_from_seeds_that_were_sealed_before(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    drawn, path = sealed.drawn(2), tmp_path / "seeds.json"
    sealed.write(path, drawn)
    later = TRACK.later(seconds=30.0)
    monkeypatch.setitem(TRACKS, later.name, later)
    assert sealed.read(path).sha256 == drawn.sha256
    wanted: dict[str, Any] = {"slams": ("ekf",), "subject": "ekf", "seeds": 2}
    Wanted(tracks=(TRACK,), sealed=sealed.read(path), **wanted)
    with pytest.raises(InvalidValueError, match=f"not for track {later.name}"):
        Wanted(tracks=(later,), sealed=sealed.read(path), **wanted)
    Wanted(tracks=(later,), sealed=sealed.drawn(2), **wanted)


@pytest.fixture(scope="module")
def submitted(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two runs of a second on sealed seeds."""
    out = tmp_path_factory.mktemp("board")
    drawn = sealed.SealedSeeds(seeds=(21, 5), salt="0" * 64)
    wanted = Wanted(
        tracks=(TRACK,), slams=("ekf",), subject="ekf", sealed=drawn, seeds=2, quick=True,
        seconds=1.0, submit="mine",
    )  # fmt: skip
    carry_out(wanted, out)
    return out / submission.file_of("mine")


def test_the_poses_of_a_submission_come_out_again(submitted: Path):
    given = submission.read(submitted)
    assert (given.seeds_of, given.seeds) == ("sealed", (21, 5))
    assert [one.verdict for one in made_again(submitted, 2, slam="ekf")] == ["same bytes"] * 2


def test_another_slam_or_other_numbers_do_not(submitted: Path, tmp_path: Path):
    (other,) = made_again(submitted, 1, slam="odometry")
    assert other.verdict == "differs"
    assert "its poses are others here (outcome finished, ate_unaligned_m" in other.why
    given = submission.read(submitted)
    nothing = [run | {"nees_abs_log": 0.0} for run in given.runs[TRACK.name]]
    submission.write(tmp_path / "null.json", replace(given, runs={TRACK.name: nothing}))
    (wrong,) = made_again(tmp_path / "null.json", 1, slam="ekf")
    assert wrong.verdict == "differs", "a number that the run does not have"
    better = [run | {"error_tracking_m": 0.0} for run in given.runs[TRACK.name]]
    faked = tmp_path / "faked.json"
    submission.write(faked, replace(given, runs={TRACK.name: better}))
    assert [one.verdict for one in made_again(faked, 1)] == ["same bytes"]
    (wrong,) = made_again(faked, 1, slam="ekf")
    assert (wrong.verdict, wrong.why.partition(" are not")[0]) == (
        "differs", "its error_tracking_m",
    )  # fmt: skip

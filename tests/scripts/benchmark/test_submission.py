# SPDX-License-Identifier: Apache-2.0
"""A submission comes back as it was written; anything else is refused by name."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from scripts.benchmark import make, runs_file, submission
from scripts.benchmark.make import Wanted
from scripts.benchmark.runs_file import Results
from scripts.benchmark.tracks import LEVELS, newest
from scripts.comparison import recording
from scripts.result_files import MAX_BYTES
from sim.core import versions
from sim.core.versions import WorldVersionError
from slam.errors import InvalidValueError, LogFormatError

TRACK = newest()["tour-guide"].name
KEY = f"{TRACK} 0 720"
ROW = {
    "outcome": "finished", "failure": None, "lost": 0, "scans": 282.0, "lost_at_s": None,
    "ate_unaligned_m": 0.01, "error_tracking_m": 0.01, "silent_share": float("nan"),
    "peak_memory_mb": 12.0,
}  # fmt: skip


def made() -> Results:
    runs = {
        (level, seed): (f"{seed:064x}", {"mine": submission.run_of(ROW, "a" * 64)})
        for level in LEVELS
        for seed in (720, 721)
    }
    made_with = submission.made_with("odometry")
    return Results(name="mine", slam="my_slam:MySlam", runs={TRACK: runs}, made_with=made_with)


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / submission.file_of("mine")
    runs_file.write(path, made())
    return path


def rewritten(file: Path, change: Callable[[dict[str, Any]], Any]) -> None:
    """The file with that change, and the digest of what it holds now."""
    data = json.loads(file.read_text())
    change(data)
    data.pop("sha256")
    data["sha256"] = runs_file._sha256(data)
    file.write_text(json.dumps(data))


def test_it_comes_back(file: Path):
    found, wanted = submission.read(file), made()
    for name in ("name", "slam", "seconds", "runs", "made_with"):
        assert getattr(found, name) == getattr(wanted, name)
    row = found.rows(TRACK)[0]
    assert (row["slam"], row["dynamism"], row["silent_share"]) == ("mine", 0.0, None)
    assert "peak_memory_mb" not in row  # of another machine
    assert found.runs[TRACK][0.0, 720][1]["mine"]["peak_memory_mb"] == 12.0
    assert found.rows("no-walls-v1") == []
    assert found.origin()["slam"] == "my_slam:MySlam"
    assert "mujoco" in found.origin()["made_with"]


def test_the_runs_that_ship_are_the_same_file_but_no_submission():
    assert runs_file.read().name == ""
    with pytest.raises(LogFormatError, match="no submission: it holds runs of many SLAMs"):
        submission.read(runs_file.FILE)


def test_each_track_has_each_level_with_each_of_its_own_seeds(file: Path):
    one, other = made(), newest()["moving-boards"].name
    of = {(at, seed + 186): run for (at, seed), run in one.runs[TRACK].items()}  # from 906 on
    runs_file.write(file, replace(one, runs={**one.runs, other: of}))
    assert submission.read(file).runs == {**one.runs, other: of}
    fewer = dict(list(of.items())[1:])
    for runs, words in ((fewer, "each level and seed"), (one.runs[TRACK], "seeds that are not")):
        with pytest.raises(InvalidValueError, match=f"{other}: .*{words}"):
            replace(one, runs={**one.runs, other: runs})


def cell(data: dict[str, Any], name: str, value: Any) -> None:
    """Another value in a column of the first run."""
    data["runs"][KEY]["slams"]["mine"][data["columns"].index(name)] = value


def moved(data: dict[str, Any], key: str) -> None:
    data["runs"][key] = data["runs"].pop(KEY)


def submitted(data: dict[str, Any], **values: Any) -> None:
    data["submitted"].update(values)


WRONG: dict[str, tuple[Callable[[dict[str, Any]], Any], str]] = {
    "schema": (lambda d: d.update(schema=2), "of schema 3"),
    "what": (lambda d: d.update(what="a recipe"), "no results of the benchmark"),
    "name": (lambda d: submitted(d, name="../x"), "name must be up to 40"),
    "slam": (lambda d: submitted(d, slam="a\nb"), "slam must be"),
    "seconds": (lambda d: submitted(d, seconds=-1), "seconds must be"),
    "another SLAM's name": (lambda d: submitted(d, name="shunting"), "the name of another SLAM"),
    "oracle": (lambda d: submitted(d, slam="oracle(ekf,movable)"), "an oracle is a control"),
    "no tracks": (lambda d: d.update(tracks={}, runs={}), "no runs"),
    "no runs": (lambda d: d.update(runs={}), "each level and seed once"),
    "track": (lambda d: d["tracks"].update(x=""), "track 'x'"),
    "other track": (lambda d: d["tracks"].update({TRACK: "0" * 64}), "none of this version"),
    "run of no track": (lambda d: moved(d, "x 0 720"), "a track without its hash"),
    "run twice": (lambda d: moved(d, f"{TRACK} 0.0 721"), "a track without its hash"),
    "seed of no track": (lambda d: moved(d, f"{TRACK} 0 {2**32}"), "seed must be"),
    "level": (lambda d: moved(d, f"{TRACK} 0.3 720"), "level must be"),
    "fewer cells": (lambda d: d["runs"][KEY]["slams"]["mine"].pop(), "no results"),
    "another's run": (lambda d: d["runs"][KEY]["slams"].clear(), "a run of another SLAM"),
    "columns": (lambda d: d["columns"].reverse(), "columns must be poses"),
    "recording": (lambda d: d["runs"][KEY].update(recording="0"), "recording must be a SHA-256"),
    "poses": (lambda d: cell(d, "poses", None), "poses must be a SHA-256"),
    "outcome": (lambda d: cell(d, "outcome", "won"), "outcome must be"),
    "lost": (lambda d: cell(d, "lost", 1), "lost must be"),
    "error": (lambda d: cell(d, "ate_unaligned_m", -0.1), "ate_unaligned_m must be"),
    "no tracking": (lambda d: cell(d, "error_tracking_m", None), "error_tracking_m must be a n"),
    "share": (lambda d: cell(d, "silent_share", 1.5), "silent_share must be"),
    "lost, finished": (lambda d: cell(d, "lost_at_s", 3.0), "lost_at_s must be None"),
    "finished, lost": (lambda d: cell(d, "outcome", "lost"), "lost must be"),
}


@pytest.mark.parametrize("what", WRONG)
def test_what_is_wrong_is_named(file: Path, what: str):
    change, words = WRONG[what]
    rewritten(file, change)
    with pytest.raises(LogFormatError, match=words) as told:
        submission.read(file)
    assert str(file) in str(told.value)


def test_a_file_of_an_older_mobilia_is_refused_in_one_line(file: Path):
    old = {"schema": 2, "what": "submission to the benchmark of mobilia", "tracks": {}}
    file.write_text(json.dumps(old))
    with pytest.raises(LogFormatError, match="another version of mobilia made it") as told:
        submission.read(file)
    assert "\n" not in str(told.value)


def test_only_recordings_are_checked_and_only_by_the_machine_that_made_them(file, monkeypatch):
    monkeypatch.setattr(recording, "record", lambda path, **_: path.write_bytes(b""))
    monkeypatch.setattr(recording, "digest", lambda _: "0" * 64)
    (other,) = submission.made_again(file, 1)
    assert (other.verdict, other.status) == ("differs", 1)
    monkeypatch.setattr(submission, "versions", lambda: {"mujoco": "0"})
    (other,) = submission.made_again(file, 1)
    assert (other.verdict, other.ok, other.status) == ("cannot be checked here", False, 6)
    monkeypatch.setattr(recording, "digest", lambda _: f"{720:064x}")
    assert {one.verdict for one in submission.made_again(file, 10)} == {
        "same bytes", "cannot be checked here",
    }  # fmt: skip


def test_damage_and_other_files_are_refused(file: Path):
    text = file.read_text()
    for wrong in (
        text.replace("0.01", "0.02", 1), text[:-40], "[]", "{}", "[" * 100_000, '{"a": NaN}', "\0",
    ):  # fmt: skip
        file.write_text(wrong)
        with pytest.raises(LogFormatError):
            submission.read(file)
    with pytest.raises(LogFormatError):
        submission.read(file.parent)
    with file.open("wb") as big:
        big.truncate(MAX_BYTES + 1)
    with pytest.raises(LogFormatError, match="at most"):
        submission.read(file)


def test_a_submission_of_an_older_world_is_read_but_its_scans_are_not_made_again(file, monkeypatch):
    monkeypatch.setattr(versions, "WORLD", versions.WORLD + 1)
    assert submission.read(file).runs == made().runs
    with pytest.raises(WorldVersionError, match=f"track {TRACK}: cannot be made again"):
        list(submission.made_again(file, 1))


@pytest.mark.parametrize(
    ("by", "kind"),
    [(1, WorldVersionError), (-1, LogFormatError)],
    ids=["newer", "of no such track"],
)
def test_a_submission_that_says_another_world_than_its_tracks_is_refused(file, by, kind):
    world = versions.WORLD + by
    rewritten(file, lambda data: data.update(world=world))
    with pytest.raises(kind, match=f"world.* {world}"):
        submission.read(file)


def test_only_what_is_alike_is_merged():
    track = newest()["tour-guide"]
    plain: dict[str, Any] = {"tracks": (track,), "slams": ("ekf",), "subject": "ekf", "seeds": 2}
    make._check_alike([made()], Wanted(**plain), set())
    later = newest()["moving-boards"]  # whose seeds are others
    make._check_alike([made()], Wanted(**plain | {"tracks": (track, later)}), set())
    for other in ({"seeds": 3}, {"quick": True}, {"seconds": 5.0}, {"train": True}):
        with pytest.raises(InvalidValueError, match="those of the board"):
            make._check_alike([made()], Wanted(**plain | other), set())
    with pytest.raises(InvalidValueError, match="the board has none of its tracks"):
        make._check_alike([made()], Wanted(**plain | {"tracks": (track.later(),)}), set())
    with pytest.raises(InvalidValueError, match="of that name"):
        make._check_alike([made(), made()], Wanted(**plain), set())
    there = {(level, seed): f"{seed:064x}" for level in LEVELS for seed in (720, 721)}
    assert len(made().rows(TRACK, there)) == 10
    make._check_scans(made(), {TRACK: there})
    with pytest.raises(InvalidValueError, match=r"level 0\.5, seed 721 is of other scans"):
        make._check_scans(made(), {TRACK: there | {(0.5, 721): "f" * 64}})

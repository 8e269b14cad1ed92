# SPDX-License-Identifier: Apache-2.0
"""A submission comes back as it was written; anything else is refused by name."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from scripts.benchmark import make, submission
from scripts.benchmark.make import Wanted
from scripts.benchmark.submission import Submission
from scripts.benchmark.tracks import LEVELS, newest
from scripts.comparison import recording
from scripts.result_files import MAX_BYTES
from sim.core import versions
from sim.core.versions import WorldVersionError
from slam.errors import InvalidValueError, LogFormatError

TRACK = newest()["tour-guide"].name
ROW = {
    "outcome": "finished", "failure": None, "lost": 0, "scans": 282.0, "lost_at_s": None,
    "ate_unaligned_m": 0.01, "error_tracking_m": 0.01, "silent_share": float("nan"),
    "peak_memory_mb": 12.0,
}  # fmt: skip


def made() -> Submission:
    runs = [
        submission.run_of({**ROW, "dynamism": level, "seed": seed}, f"{seed:064x}", "a" * 64)
        for level in LEVELS
        for seed in (720, 721)
    ]
    return Submission(
        name="mine", slam="my_slam:MySlam", seeds_of="test", seeds=(720, 721), levels=LEVELS,
        seconds=None, runs={TRACK: runs}, made_with=submission.made_with("odometry"),
    )  # fmt: skip


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / submission.file_of("mine")
    submission.write(path, made())
    return path


def test_it_comes_back(file: Path):
    found, wanted = submission.read(file), made()
    for name in ("name", "slam", "seeds_of", "seeds", "levels", "seconds", "runs"):
        assert getattr(found, name) == getattr(wanted, name)
    row = found.rows(TRACK)[0]
    assert (row["slam"], row["dynamism"], row["silent_share"]) == ("mine", 0.0, None)
    assert row["peak_memory_mb"] is None  # of another machine
    assert found.runs[TRACK][0]["peak_memory_mb"] == 12.0
    assert found.rows("no-walls-v1") == []
    assert found.origin()["slam"] == "my_slam:MySlam"
    assert "mujoco" in found.origin()["made_with"]


def test_tracks_of_other_seeds_are_in_one_file(tmp_path: Path):
    """Each with the runs of its own seeds, no fewer."""
    other, path = newest()["moving-boards"].name, tmp_path / submission.file_of("mine")
    one, whole = made(), {**made().runs}
    whole[other] = [{**run, "seed": run["seed"] + 186} for run in whole[TRACK]]  # from 906 on
    submission.write(path, replace(one, seeds=(720, 721, 906, 907), runs=whole))
    assert submission.read(path).runs == whole
    submission.write(path, replace(one, seeds=(720, 721, 906, 907), runs={**whole, other: []}))
    with pytest.raises(LogFormatError, match=f"{other}: expected 10 runs"):
        submission.read(path)
    submission.write(path, replace(one, runs={**whole, other: []}))
    with pytest.raises(LogFormatError, match=f"{other}: none of its seeds"):
        submission.read(path)


def first_run(data: dict[str, Any], **values: Any) -> None:
    data["tracks"][TRACK]["runs"][0].update(values)


HUGE = 10**400  # JSON has it, no double holds it
WRONG: dict[str, tuple[Callable[[dict[str, Any]], Any], str]] = {
    "schema": (lambda d: d.update(schema=1), "of schema 2"),
    "what": (lambda d: d.update(what="a recipe"), "no submission"),
    "name": (lambda d: d.update(name="../x"), "name must be up to 40"),
    "slam": (lambda d: d.update(slam="a\nb"), "slam must be"),
    "seeds_of": (lambda d: d.update(seeds_of="best"), "seeds_of must be one of sealed"),
    "seeds": (lambda d: d.update(seeds=[720, 720]), "seeds must be each once"),
    "one seed": (lambda d: d.update(seeds=[720]), "expected 5 runs"),
    "levels": (lambda d: d.update(levels=[0.0, 0.3]), "levels must be of"),
    "seconds": (lambda d: d.update(seconds=-1), "seconds must be"),
    "no tracks": (lambda d: d.update(tracks={}), "tracks must be"),
    "track": (lambda d: d["tracks"].update(x={"sha256": "", "runs": []}), "track 'x'"),
    "other track": (lambda d: d["tracks"][TRACK].update(sha256="0" * 64), "none of this version"),
    "run twice": (lambda d: first_run(d, seed=721), "each level and seed once"),
    "run of words": (lambda d: d["tracks"][TRACK]["runs"].__setitem__(0, "x"), "a run must have"),
    "more in a run": (lambda d: first_run(d, more=1), "a run must have"),
    "recording": (lambda d: first_run(d, recording="0"), "recording must be a SHA-256"),
    "poses": (lambda d: first_run(d, poses=None), "poses must be a SHA-256"),
    "outcome": (lambda d: first_run(d, outcome="won"), "outcome must be"),
    "lost": (lambda d: first_run(d, lost=1), "lost must be"),
    "error": (lambda d: first_run(d, ate_unaligned_m=-0.1), "ate_unaligned_m must be"),
    "error of words": (lambda d: first_run(d, ate_unaligned_m="0"), "ate_unaligned_m must be"),
    "share": (lambda d: first_run(d, silent_share=1.5), "silent_share must be"),
    "huge scans": (lambda d: first_run(d, scans=HUGE), "scans must be"),
    "huge seconds": (lambda d: d.update(seconds=HUGE), "seconds must be"),
    "huge seed": (lambda d: d.update(seeds=[HUGE, 721]), r"seeds\[0\] must be"),
    "huge seed of a run": (lambda d: first_run(d, seed=HUGE), "seed must be"),
    "seed with a point": (lambda d: first_run(d, seed=720.0), "seed must be"),
    "level of truth": (lambda d: first_run(d, level=False), "level must be"),
    "level of a list": (lambda d: first_run(d, level=[0.0]), "level must be"),
    "no error": (lambda d: first_run(d, ate_unaligned_m=None), "ate_unaligned_m must be a number"),
    "no tracking": (lambda d: first_run(d, error_tracking_m=None), "error_tracking_m must be a n"),
    "lost, finished": (lambda d: first_run(d, lost_at_s=3.0), "lost_at_s must be None"),
    "never lost": (lambda d: first_run(d, outcome="lost", lost=1), "lost_at_s must be a number"),
    "made_with of words": (lambda d: d.update(made_with="me"), "made_with must be a table"),
    "made_with of pairs": (lambda d: d.update(made_with=[["a", 1]]), "made_with must be a table"),
    "tracks of a list": (lambda d: d.update(tracks=[1]), "tracks must be"),
    "another SLAM's name": (lambda d: d.update(name="shunting"), "the name of another SLAM"),
    "oracle": (lambda d: d.update(slam="oracle(ekf,movable)"), "an oracle is a control"),
    "no made_with": (lambda d: d.pop("made_with"), "made_with"),
}


@pytest.mark.parametrize("what", WRONG)
def test_what_is_wrong_is_named(file: Path, what: str):
    data = json.loads(file.read_text())
    change, words = WRONG[what]
    change(data)
    data.pop("sha256")
    data["sha256"] = submission._sha256(data)
    file.write_text(json.dumps(data))
    with pytest.raises(LogFormatError, match=words) as told:
        submission.read(file)
    assert str(file) in str(told.value)


def test_an_object_as_deep_as_can_be_read_is_refused(file: Path):
    text = file.read_text()
    for depth in range(20, 2000, 60):  # what can be read but not written again, wherever that is
        deep = '{"a":' * depth + "1" + "}" * depth
        data = json.loads(text)
        try:
            data["made_with"] = json.loads(deep)
            data["sha256"] = submission._sha256({k: v for k, v in data.items() if k != "sha256"})
        except RecursionError:
            data["made_with"] = {}
        file.write_text(json.dumps(data).replace('"made_with": {}', f'"made_with": {deep}'))
        with pytest.raises(LogFormatError):
            submission.read(file)


def test_a_slam_may_be_submitted_by_its_own_name_only():
    assert submission.checked_name("ekf", "ekf") == "ekf"
    for slam in ("my_slam:MySlam", "ekf{x=1}", "shunting"):
        with pytest.raises(InvalidValueError, match="'ekf' is the name of another SLAM"):
            submission.checked_name("ekf", slam)


def test_only_recordings_are_checked_and_only_by_the_machine_that_made_them(
    file: Path, monkeypatch: pytest.MonkeyPatch
):
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


def test_a_submission_of_an_older_world_is_read_but_its_scans_are_not_made_again(
    file: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(versions, "WORLD", versions.WORLD + 1)
    assert submission.read(file).runs == made().runs
    with pytest.raises(WorldVersionError, match=f"track {TRACK}: cannot be made again"):
        list(submission.made_again(file, 1))


@pytest.mark.parametrize(
    ("by", "kind"),
    [(1, WorldVersionError), (-1, LogFormatError)],
    ids=["newer", "of no such track"],
)
def test_a_submission_that_says_another_world_than_its_tracks_is_refused(
    file: Path, by: int, kind: type[Exception]
):
    data = json.loads(file.read_text())
    data["world"] += by
    data["sha256"] = submission._sha256({k: v for k, v in data.items() if k != "sha256"})
    file.write_text(json.dumps(data))
    with pytest.raises(kind, match=f"world.* {data['world']}"):
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
    assert len(make._on_the_same_scans(made(), TRACK, there)) == 10
    with pytest.raises(InvalidValueError, match=r"level 0\.5, seed 721 is of other scans"):
        make._on_the_same_scans(made(), TRACK, there | {(0.5, 721): "f" * 64})

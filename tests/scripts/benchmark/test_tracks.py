# SPDX-License-Identifier: Apache-2.0
"""The tracks: each as it was published, each possible, and a new one beside them."""

from collections.abc import Iterator
from pathlib import Path

import pytest

import scenes
from scenes.crowd import crowd_of
from scripts.benchmark import published
from scripts.benchmark.publish import tracks_table
from scripts.benchmark.tracks import (
    FRESH,
    LEVELS,
    TEST,
    TRACKS,
    TRAIN,
    Track,
    chosen,
    newest,
    register,
)
from sim.core import versions
from sim.core.versions import WORLD, WorldVersionError
from slam.errors import InvalidValueError, UnknownNameError

DOCS = Path(__file__).resolve().parents[3] / "docs"

PUBLISHED = {  # what is published is added, and nothing here ever changes
    "tour-guide-v1": "5af2086d9b4e",
    "rush-hour-v1": "4005dac13643",
    "busy-chairs-v1": "fbce4241b9fe",
    "moving-boards-v1": "2189a64a32cf",
    "moving-day-v1": "e56db9f29148",
    "overnight-v1": "db955dddc953",
    "classroom-break-v1": "b4d0c7adc550",
    "warehouse-shift-v1": "25cd31886993",
    "ward-round-v1": "af7be1c7248c",
    "slow-scans-v1": "d32ae5599c18",
    "kidnapped-in-a-crowd-v1": "e73cb0e804eb",
    "no-walls-v1": "d11c3e575a0a",
    "moving-boards-v2": "33b12d694168",
    "kidnapped-in-a-crowd-v2": "df4a5739d5b8",
    "half-turn-v1": "1b45f644f22c",
    "slow-boards-v1": "6718b8b49840",
    "depth-camera-v1": "010f48f6ed49",
    "ward-round-v2": "3d5e9d83258c",
}
NOT_COUNTING = {
    "warehouse-shift-v1", "ward-round-v1", "kidnapped-in-a-crowd-v1", "ward-round-v2",
}  # fmt: skip
OPEN: set[str] = set()
NOW = [track for track in newest().values() if track.world == WORLD]
ONE = TRACKS["tour-guide-v1"]


@pytest.fixture
def one_more() -> Iterator[Track]:
    """A second version of one of them, for as long as the test runs."""
    later = ONE.later(seconds=30.0)
    register(later)
    yield later
    del TRACKS[later.name]


def test_a_published_track_never_changes():
    """One that must gets a new version, or its numbers would have two meanings."""
    assert {name: TRACKS[name].sha256[:12] for name in PUBLISHED} == PUBLISHED
    assert set(published.read().runs) <= set(PUBLISHED)


def test_which_tracks_count_is_decided_once_and_a_new_version_is_open_again():
    """Not by each reader's oracle, and it is no part of the hash: the runs stay what they are."""
    assert {name for name in PUBLISHED if TRACKS[name].counts is False} == NOT_COUNTING
    assert {name for name in PUBLISHED if TRACKS[name].counts is None} == OPEN
    assert ONE.counts
    assert ONE.later().counts is None
    assert ONE.later(counts=True).sha256 == ONE.later().sha256


def test_another_world_moves_no_hash_and_runs_no_track_of_this_one(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(versions, "WORLD", WORLD + 1)
    test_a_published_track_never_changes()
    says = f"track tour-guide-v1: cannot be made again, it is of world version {ONE.world}, this"
    with pytest.raises(WorldVersionError, match=says):
        ONE.plan((), (720,))
    later = ONE.later(world=WORLD + 1)
    assert later.plan((), (720,)).runs()
    assert later.sha256 != ONE.later().sha256


def test_a_new_version_is_one_declaration_and_moves_nothing_else(one_more: Track):
    assert (one_more.name, one_more.family, one_more.version) == ("tour-guide-v2", "tour-guide", 2)
    test_a_published_track_never_changes()
    assert chosen(["tour-guide"]) == (one_more,)
    assert chosen(["tour-guide-v1", "tour-guide-v2"]) == (ONE, one_more)
    assert ONE not in chosen(None)
    assert len(chosen(None)) == len({track.family for track in TRACKS.values()})
    register(one_more)
    with pytest.raises(InvalidValueError, match="tour-guide-v2 is there already"):
        register(ONE.later(seconds=31.0))


def test_tuning_has_seeds_of_its_own():
    assert not set(TRAIN) & {*TEST, *FRESH}
    assert not set(TEST) & set(FRESH)
    for track in TRACKS.values():
        assert track.scanner.startswith(("noise", "scanner(fov_deg=87, beams=174, rate_hz=30,"))
        assert track.controls[0] == "odometry"
        assert track.controls[1].startswith("oracle(shunting")
        assert track.controls[2] == "oracle(map)"


@pytest.mark.parametrize("track", NOW, ids=lambda track: track.name)
def test_every_level_sets_something_else_and_the_top_one_has_room(track: Track):
    plan = track.plan(("ekf",), (track.test[0],))
    assert plan.levels == LEVELS
    assert plan.slams == ("ekf", *track.controls)
    recipes = [plan.recipe(run) for run in plan.runs()]
    assert len({recipe.sha256 for recipe in recipes}) == len(LEVELS)
    assert recipes[0].motion in (0.0, 0.5, 1.0)
    top = recipes[-1]
    built = scenes.build(top.scene, top.seed, **top.options)
    wanted = crowd_of(top.options["crowd"])
    assert crowd_of(built.options.get("crowd", "none")) == wanted


def test_the_page_has_every_track():
    assert tracks_table(list(newest().values())) in (DOCS / "benchmark.md").read_text()


def test_names_may_leave_out_the_version_and_a_wrong_one_is_told():
    assert chosen(["tour-guide", "no-walls-v1"]) == (newest()["tour-guide"], TRACKS["no-walls-v1"])
    with pytest.raises(UnknownNameError, match=r"'tour-giude'.*tour-guide"):
        chosen(["tour-giude"])
    with pytest.raises(UnknownNameError, match=r"'tour-guide-v9'.*tour-guide-v1"):
        chosen(["tour-guide-v9"])


def test_a_track_that_cannot_be_is_refused():
    told = {"name": "x-v1", "about": "x", "world": 2, "scene": "arena", "axis": "x"}
    with pytest.raises(InvalidValueError, match=r"Track\.sets must have 5 levels"):
        Track(**told, says=ONE.says, sets=ONE.sets[:4])
    with pytest.raises(InvalidValueError, match="must be apart"):
        Track(**told, says=ONE.says, sets=ONE.sets, train=(720,))
    for name in ("x", "x-v0", "X-v1", "x-v01", "-v1"):
        with pytest.raises(InvalidValueError, match="end in its version"):
            Track(**told | {"name": name}, says=ONE.says, sets=ONE.sets)

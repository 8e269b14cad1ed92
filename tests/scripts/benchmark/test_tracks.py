# SPDX-License-Identifier: Apache-2.0
"""The tracks: twelve, each as it was published, each possible."""

from __future__ import annotations

from pathlib import Path

import pytest

import scenes
from scenes.crowd import crowd_of
from scripts.benchmark.tracks import LEVELS, TEST, TRACKS, TRAIN, Track, chosen
from slam.errors import InvalidValueError, UnknownNameError

PAGE = Path(__file__).resolve().parents[3] / "docs" / "benchmark.md"

PUBLISHED = {
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
}


def test_a_track_never_changes():
    """One that must gets a new version, or its numbers would have two meanings."""
    assert {name: track.sha256[:12] for name, track in TRACKS.items()} == PUBLISHED


def test_there_are_twelve_and_tuning_has_seeds_of_its_own():
    assert len(TRACKS) == 12
    assert all(name.endswith("-v1") and track.name == name for name, track in TRACKS.items())
    assert not set(TRAIN) & set(TEST)
    for track in TRACKS.values():
        assert track.scanner == "noise"
        assert track.controls[0] == "odometry"
        assert track.controls[1].startswith("oracle(shunting")


@pytest.mark.parametrize("name", TRACKS)
def test_every_level_sets_something_else_and_the_top_one_has_room(name: str):
    plan = TRACKS[name].plan(("ekf",), (TEST[0],))
    assert plan.levels == LEVELS
    assert plan.slams == ("ekf", *TRACKS[name].controls)
    recipes = [plan.recipe(run) for run in plan.runs()]
    assert len({recipe.sha256 for recipe in recipes}) == len(LEVELS)
    assert recipes[0].motion in (0.0, 0.5, 1.0)
    top = recipes[-1]
    built = scenes.build(top.scene, top.seed, **top.options)
    wanted = crowd_of(top.options["crowd"])
    assert crowd_of(built.options.get("crowd", "none")) == wanted


def test_the_page_has_every_track_with_its_levels():
    rows = [line for line in PAGE.read_text().splitlines() if line.startswith("| `")]
    for track in TRACKS.values():
        (row,) = (row for row in rows if f"`{track.name}`" in row)
        counts = ", ".join(word.split(" ", 1)[0] for word in track.says)
        for words in (track.about, f"{track.axis}: {counts}", track.scene, f"{track.seconds:g}"):
            assert words in row


def test_names_may_leave_out_the_version_and_a_wrong_one_is_told():
    assert chosen(["tour-guide", "no-walls-v1"]) == (TRACKS["tour-guide-v1"], TRACKS["no-walls-v1"])
    assert chosen(None) == tuple(TRACKS.values())
    with pytest.raises(UnknownNameError, match=r"'tour-giude'.*tour-guide-v1"):
        chosen(["tour-giude"])


def test_a_track_that_cannot_be_is_refused():
    one = TRACKS["tour-guide-v1"]
    told = {"name": "x", "about": "x", "scene": "arena", "axis": "x", "says": one.says}
    with pytest.raises(InvalidValueError, match=r"Track\.sets must have 5 levels"):
        Track(**told, sets=one.sets[:4])
    with pytest.raises(InvalidValueError, match="must be apart"):
        Track(**told, sets=one.sets, train=(720,))

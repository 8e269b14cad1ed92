# SPDX-License-Identifier: Apache-2.0
"""The search for rooms that are hard and fair: what it draws, when it gives one up, going on."""

import json
from pathlib import Path
from typing import Any

import pytest

from scripts.benchmark import search
from scripts.benchmark.tracks import TRAIN
from slam.errors import InvalidValueError


def run(lost: int, ours: tuple[int, float], of_map: tuple[int, float]) -> dict[str, Any]:
    rows = {"oracle(shunting)": ours, "oracle(map)": of_map}
    oracles = {name: {"lost": at[0], "error_tracking_m": at[1]} for name, at in rows.items()}
    return {"slams": {"mine": {"lost": lost}, **(oracles if lost else {})}}


GOOD, OFF, GONE = (0, 0.01), (0, 0.06), (1, 0.01)
EASY, HARD = run(0, GOOD, GOOD), run(1, GOOD, GONE)


@pytest.mark.parametrize(
    ("runs", "state"),
    [
        ([HARD], "open"),
        ([EASY, EASY], "dropped"),  # nobody is lost
        ([EASY, HARD, EASY], "dropped"),  # at most half
        ([EASY, HARD, HARD, HARD], "found"),
        ([run(1, GONE, GONE)], "dropped"),  # no oracle holds
        ([run(1, GONE, GOOD), HARD], "dropped"),  # nor one and the same
        ([run(1, OFF, GONE)] * 3, "dropped"),  # too far off
    ],
)
def test_a_room_is_found_where_most_are_lost_and_one_oracle_holds(runs: list[Any], state: str):
    assert search.standing(search.drawn("boards", 0), runs, "mine", 4)[0] == state


def test_a_draw_is_of_its_space_and_repeats():
    for name, space in search.SPACES.items():
        track = search.drawn(name, 3)
        assert track == search.drawn(name, 3)
        assert track.scene in space["scene"]
        assert track.plan(("ekf",), TRAIN[:1]).recipe(track.plan((), TRAIN[:1]).runs()[-1])


def test_it_goes_on_where_it_stopped_and_skips_what_cannot_be(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    made: list[int] = []

    def tried(track: object, level: float, seed: int, slam: str) -> dict[str, Any]:
        made.append(seed)
        return HARD

    monkeypatch.setattr(search, "tried", tried)
    words = ["boards", "--tries", "1", "--slam", "mine", "--out", str(tmp_path / "a/runs.jsonl")]
    assert search.main([*words, "--seeds", "2"]) == 0
    assert search.main([*words, "--seeds", "3"]) == 0
    assert made == [0, 1, 2]
    lines = (tmp_path / "a/runs.jsonl").read_text().splitlines()
    assert [json.loads(line)["seed"] for line in lines] == made
    assert capsys.readouterr().out.count("found boards 0 {'lost': ") == 2

    def full(*_: object) -> dict[str, Any]:
        raise InvalidValueError("crowd: a board does not fit")

    monkeypatch.setattr(search, "tried", full)
    assert search.main(["kidnaps", "--tries", "1", "--out", str(tmp_path / "b.jsonl")]) == 0
    assert "impossible kidnaps 0 {'why': 'crowd: a board does not fit'}" in capsys.readouterr().out

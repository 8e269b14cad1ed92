# SPDX-License-Identifier: Apache-2.0
"""The runs that ship: whole, of tracks that count, and taken on the very same recordings alone."""

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest

from scripts.benchmark import make, picture, publish, published, runs_file, scores
from scripts.benchmark.make import QUICK_LEVELS, QUICK_SEEDS
from scripts.benchmark.scores import ranking
from scripts.benchmark.tracks import TRACKS, chosen
from scripts.comparison.plan import Plan
from slam.errors import InvalidValueError, LogFormatError
from tests.scripts.benchmark.test_submission import rewritten

SHIPPED = runs_file.read()
TRACK, OTHER = "moving-boards-v2", "no-walls-v1"
KEY = f"{TRACK} 0.5 906"
LEAST = 7  # SLAMs beside the reader's


def digests(track: str) -> dict[tuple[float, int], str]:
    return {run: recording for run, (recording, _) in SHIPPED.runs[track].items()}


def quick(track: str) -> dict[tuple[float, int], str]:
    """Digests of the runs of a quick benchmark."""
    return {run: told for run, told in digests(track).items()
            if run[0] in QUICK_LEVELS and run[1] in TRACKS[track].test[:QUICK_SEEDS]}  # fmt: skip


def test_every_run_of_a_quick_benchmark_ships_with_seven_slams_and_the_controls():
    asked = SHIPPED.quick(chosen(None))
    assert {TRACK, OTHER} <= {track.name for track in asked}
    assert not SHIPPED.quick([TRACKS["ward-round-v1"]])
    for track in asked:
        assert track.counts
        runs = [SHIPPED.runs[track.name][run][1] for run in quick(track.name)]
        assert len(runs) == len(QUICK_LEVELS) * QUICK_SEEDS
        slams = set.intersection(*map(set, runs))
        assert len(slams - set(track.controls)) >= LEAST
        assert set(track.controls) <= slams
    assert not SHIPPED.has(TRACK, [(0.5, 999)], "karto")


def test_an_oracle_holds_in_the_runs_that_ship_of_a_track_that_counts():
    for name in SHIPPED.runs:
        track, rows = TRACKS[name], SHIPPED.rows(name, digests(name), ())
        found = scores.fairness(replace(track, counts=None), rows)
        assert found["counts"] or not track.counts, (name, found)


def test_rows_are_taken_on_the_same_recordings_alone():
    here = quick(TRACK)
    rows = SHIPPED.rows(TRACK, here, ("karto",))
    assert {row["slam"] for row in rows} >= {"shunting", "kiss-icp", "odometry"}
    assert "karto" not in {row["slam"] for row in rows}
    assert SHIPPED.others(TRACK, here) == []
    first, *rest = here
    other = {**here, first: "0" * 64}
    assert SHIPPED.others(TRACK, other) == [first]
    runs = {(row["dynamism"], row["seed"]) for row in SHIPPED.rows(TRACK, other, ())}
    assert runs == set(rest)
    assert SHIPPED.rows("nowhere-v1", other, ()) == []


def test_the_ranking_of_what_ships_has_shunting_before_odometry():
    runs = {name: SHIPPED.rows(name, digests(name), ()) for name in SHIPPED.runs}
    named = [row["slam"] for row in ranking(runs, "shunting")]
    assert named.index("shunting") < named.index("odometry")
    assert len(named) > LEAST


CHANGES: dict[str, tuple[Callable[[dict[str, Any]], Any], str]] = {
    "columns": (lambda d: d.update(columns=["lost"]), "columns must be"),
    "track": (lambda d: d["tracks"].update({TRACK: "0" * 64}), "none of this version's"),
    "cells": (lambda d: d["runs"][KEY]["slams"].update(karto=["lost"]), "no results"),
    "ms": (lambda d: d["runs"][KEY]["slams"]["karto"].__setitem__(-1, "1"), "ms_per_scan_p50 must"),
}  # fmt: skip


@pytest.mark.parametrize("what", CHANGES)
def test_a_file_that_is_wrong_is_refused_by_name(tmp_path: Path, what: str):
    change, words = CHANGES[what]
    path = tmp_path / "published.json"
    path.write_bytes(runs_file.FILE.read_bytes())
    rewritten(path, change)
    with pytest.raises(LogFormatError, match=words) as told:
        runs_file.read(path)
    assert str(path) in str(told.value)


def test_a_readers_row_stands_between_the_others_and_no_oracle_runs_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    asked: list[Plan] = []

    def compared(plan: Plan, *_: object, **__: object) -> list[dict[str, Any]]:
        """The reader's SLAM was never lost, and 3 cm off."""
        asked.append(plan)
        row = {"outcome": "finished", "failure": None, "lost": 0, "lost_at_s": None}
        errors = dict.fromkeys(("error_tracking_m", "ate_unaligned_m", "rpe_m_per_m"), 0.03)
        return [
            {"slam": slam, "dynamism": run.dynamism, "seed": run.seed, **row, **errors}
            for slam in plan.slams
            for run in plan.runs()
        ]

    tracks = (TRACKS[TRACK], TRACKS[OTHER])
    there = iter([quick(track.name) for track in tracks])
    monkeypatch.setattr(make, "compare", compared)
    monkeypatch.setattr(published, "digests", lambda plan, folder: next(there))
    wanted = make.wanted_of(tracks, ["odometry", "shunting"], "odometry", quick=True, seeds=1)
    board = make.carry_out(wanted, tmp_path / "out", shared=SHIPPED)
    assert [plan.slams for plan in asked] == [("odometry", "shunting")] * 2
    assert len({row["slam"] for row in board.ranking}) >= LEAST + 2
    mine = next(row for row in board.ranking if row["slam"] == "odometry")
    assert (mine["runs"], mine["lost_runs"]) == (6, 0)
    assert any(said.startswith("It is number ") for said in board.said())
    assert "are others here" not in capsys.readouterr().err

    there = iter([dict.fromkeys(quick(track.name), "0" * 64) for track in tracks])
    board = make.carry_out(wanted, tmp_path / "out", shared=SHIPPED)
    assert {row["slam"] for row in board.ranking} == {"odometry", "shunting"}
    printed = capsys.readouterr()
    assert "6 of 6 recordings are others here" in " ".join((printed.out + printed.err).split())


def test_the_file_is_of_the_folders_alone_and_of_one_commit(tmp_path, monkeypatch):
    path, track, commit = tmp_path / "published.json", TRACKS[TRACK], "0123456789abcdef"
    path.write_bytes(runs_file.FILE.read_bytes())
    (tmp_path / TRACK).mkdir()
    (tmp_path / TRACK / "recipe.json").touch()
    again = {(1.0, seed): digests(TRACK)[1.0, seed] for seed in track.test[:2]}
    rows = [
        {"slam": slam, "dynamism": at, "seed": seed, "outcome": "raised", "lost": 1,
         "lost_at_s": 3.0, "ms_per_scan_p50": 2.0}
        for slam in ("shunting", "odometry") for at, seed in again
    ]  # fmt: skip
    asked = {"slams": ["shunting"], "seeds": track.test[:2], "levels": [1.0]}
    done = SimpleNamespace(runs=rows, settings=asked)
    monkeypatch.setattr(published, "compared", lambda folder: done)
    monkeypatch.setattr(published, "digests", lambda plan, folder: again)
    made = published.write_from([tmp_path], path, commit)
    assert {name: set(own) for name, own in made.runs.items()} == {TRACK: set(again)}
    assert made.runs[TRACK][1.0, 906][1]["shunting"]["error_tracking_m"] is None
    told = publish.runs_table(made)
    assert {(r["SLAM"], r["seed"], r["commit"], r["ms"]) for r in told} == {
        (slam, seed, commit, 2.0) for slam in ("shunting", "odometry") for _, seed in again
    }  # fmt: skip
    assert publish.at_the_top(made)[TRACK] == {}  # too few
    again = {(0.5, 906): again[1.0, 906]}  # what is run later is added to it
    rows = [{**rows[0], "slam": "karto", "dynamism": 0.5}]
    asked["seeds"], asked["levels"] = track.test[:1], [0.5]
    both = published.write_from([path, tmp_path], path, commit).runs[TRACK]
    assert [*both] == [(0.5, 906), *made.runs[TRACK]]
    with pytest.raises(InvalidValueError, match=f"of commit {commit}"):
        published.write_from([path], path, "0123456")
    with pytest.raises(InvalidValueError, match="commit must be the hash"):
        published.write_from([], path, "0c42a0f (oracle(map): 02c3eff)")
    with pytest.raises(InvalidValueError, match="no track in"):
        published.write_from([tmp_path / "x"], path, commit)


def test_what_is_ahead_is_what_runs():
    """Oracles that ship are not among it; of training seeds none ship."""
    counts, hard = TRACKS[OTHER], TRACKS["slow-boards-v1"]
    wanted = make.wanted_of((counts, hard), ["kiss-icp"], None, seeds=1, quick=True)
    plans = make.plans_of(wanted, SHIPPED)
    assert plans[OTHER].slams == ("kiss-icp", "odometry")
    assert plans[hard.name].slams == ("kiss-icp", "odometry")
    trained = make.wanted_of((counts,), ["kiss-icp"], None, seeds=1, quick=True, train=True)
    assert make.plans_of(trained, SHIPPED)[OTHER].slams == ("kiss-icp", *counts.controls)


def test_names_at_the_ends_of_lines_never_overlap():
    for ends in ([20.0] * 12, [200.0] * 12, [26.0, 100.0, 101.0, 102.0, 199.0, 200.0]):
        places = picture.spread(ends, 206.0)
        assert np.diff(sorted(places)).min() >= picture.APART - 1e-9
        assert max(places) <= 206.0
    assert picture.spread([30.0, 90.0], 206.0) == [30.0, 90.0]


def test_the_pictures_mark_the_subject_and_hold_every_name_on_a_phone():
    lost = {"a-v1": {"<me>": (1, 4), "karto": (10, 10)}, "b-v1 *": {"karto": (0, 10)}}
    ranked = [{"slam": s, "runs": 9, "levels": [0.0, 1.0], "lost_shares": [0.0, share]}
              for s, share in (("karto", 0.5), ("<me>", 0.25))]  # fmt: skip
    drawn = picture.drawn(lost, ranked, "<me>", "level 1")
    for svg in map(ElementTree.fromstring, drawn.values()):
        words = [text for text in svg.iter() if text.tag.endswith("text")]
        assert any("mine" in w.get("class", "") and "<me>" in str(w.text) for w in words)
        assert float(svg.get("viewBox", "").split()[2]) <= 390
        assert all(float(w.get("x", 0)) <= 390 for w in words)
    cells = re.findall(r'fill="(#\w+)"/>\n<text [^>]*>(\d+)<', drawn[picture.NAMES[0]])
    shade = (picture.SHADES[-1], picture.SHADES[0], picture.SHADES[2])
    assert cells == list(zip(shade, ("100", "0", "25"), strict=True))
    assert list(picture.drawn(lost, [], "<me>", "")) == [picture.NAMES[0]]


def test_a_folder_without_days_is_refused(tmp_path: Path):
    assert publish.main([str(tmp_path)]) == 1

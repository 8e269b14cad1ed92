# SPDX-License-Identifier: Apache-2.0
"""Scores of age on rows made by hand: what is added up, and what a SLAM without days has."""

import math

import pytest

from scripts.days import scores
from scripts.days.lifelong import COLUMNS
from scripts.days.truth import AGE_COLUMNS
from scripts.report import score_tables
from slam.evaluation.statistics import median_interval, share_interval

pytestmark = pytest.mark.slow
ROOM = {"scene": "room", "motion": 0.0, "change": 0.3}
GHOSTS = (0.0, 0.01, 0.02, 0.03, 0.04, 0.05, 0.06)


def session(number, **values):
    """A session that went well."""
    row = {
        **dict.fromkeys(COLUMNS), "slam": "mine", "session": number, "start": "known",
        "map": "merged" if number else "new", "place": "right", "found_after_s": 2.0 * number,
        "rmse_m": 0.02 + 0.01 * number, "ghost_rate": GHOSTS[number], "map_kb": 100.0 + number,
        "ms_per_scan": 2.0, "load_s": 0.1,
    }  # fmt: skip
    return row | values


def aged(age, **values):
    return {**dict.fromkeys(AGE_COLUMNS), "age": age, "place": "right", "rmse_m": 0.05, **values}


def lived(rows, ages=(), seed=1, slam="mine", failure=None):
    return scores.of_building({**ROOM, "seed": seed, "slam": slam}, rows, ages, failure)


def anew(seed=1):
    own = [session(k, map="anew", place="", found_after_s=None, start=None) for k in range(7)]
    return lived(own, seed=seed, slam="guest")


def test_a_building_is_one_row_by_hand():
    rows = [session(k) for k in range(7)]
    rows[6] |= {"found_after_s": 11.0, "start": "unknown"}
    rows[4] |= {"found_after_s": None, "place": "not found", "rmse_m": None}
    row = lived(rows, [aged(1), aged(3, place="wrong", rmse_m=2.0)])
    assert tuple(row) == scores.COLUMNS
    assert (row["map"], row["sessions"], row["failed"]) == ("days", 7, 0)
    assert (row["to_find"], row["found"], row["found_soon"], row["wrong"]) == (6, 5, 4, 0)
    assert (row["known"], row["known_soon"]) == (5, 4)
    assert row["found_share"] == pytest.approx(5 / 6)
    errors = [row[key] for key in ("rmse_session0_m", "rmse_session1_m", "rmse_last_m")]
    assert errors == pytest.approx([0.02, 0.03, 0.08])
    assert row["rmse_growth"] == pytest.approx(8 / 3)
    assert (row["right_age1"], row["rmse_age1_m"]) == (1, 0.05)
    assert (row["right_age3"], row["rmse_age3_m"]) == (0, 2.0)
    assert (row["right_age10"], row["rmse_age10_m"]) == (None, None)
    assert row["ghost_rate_early"] == pytest.approx(0.03)  # sessions 1 to 5
    assert row["ghost_rate_late"] == pytest.approx(0.04)  # the last five
    assert (row["map_kb_early"], row["map_kb_late"]) == (103.0, 104.0)
    assert scores.early(rows[:3]) == scores.late(rows[:3]) == rows[1:3]  # without the first


def test_a_slam_that_starts_anew_has_nothing_about_a_map_of_before():
    row = anew()
    assert row["map"] == "anew"
    about_a_map = {
        "to_find", "found", "found_soon", "wrong", "known", "known_soon", "found_share",
        "found_soon_share", "rmse_growth", "outdated_told", "outdated_false",
        *(k for k in row if "_age" in k or k.startswith(("map_", "memory", "load", "ghost_seen"))),
    }  # fmt: skip
    assert {key: row[key] for key in about_a_map} == dict.fromkeys(about_a_map)
    assert row["rmse_last_m"] == pytest.approx(0.08)
    assert (row["ghost_rate_early"], row["ms_per_scan_late"]) == (pytest.approx(0.03), 2.0)


def test_a_session_that_failed_has_an_infinite_error_and_a_map_made_again_was_not_found():
    failed = {"place": "failed", "rmse_m": None, "found_after_s": None}
    rows = [session(0, **failed), session(1, map="new", found_after_s=0.0), session(2, **failed)]
    row = lived(rows, failure="scan 3, raised ValueError")
    assert (row["failed"], row["failure"]) == (2, "scan 3, raised ValueError")
    assert row["rmse_session0_m"] == row["rmse_last_m"] == row["rmse_growth"] == math.inf
    assert (row["to_find"], row["found"]) == (1, 0)


def test_over_buildings_medians_have_intervals_and_shares_are_of_all_sessions():
    rows = []
    for seed in range(5):
        own = [session(k, ghost_rate=0.01 * (seed + 1)) for k in range(7)]
        own[5] |= {"found_after_s": 20.0} if seed == 0 else {}
        rows.append(lived(own, [aged(1)], seed=seed))
    found = {row["metric"]: row for row in scores.levels([*rows, anew()]) if row["slam"] == "mine"}
    assert tuple(found["found_share"]) == scores.LEVEL_COLUMNS
    soon = found["found_soon_share"]
    assert (soon["statistic"], soon["n"], soon["value"]) == ("share", 30, pytest.approx(24 / 30))
    assert (soon["low"], soon["high"]) == share_interval(24, 30)
    ghosts = found["ghost_rate_late"]
    assert (ghosts["n"], ghosts["value"]) == (5, pytest.approx(0.03))
    assert (ghosts["low"], ghosts["high"]) == median_interval([r["ghost_rate_late"] for r in rows])
    assert (found["right_age1_share"]["n"], found["right_age1_share"]["value"]) == (5, 1.0)
    assert "rmse_age10_m" not in found  # nobody tried


def test_the_table_and_the_sentence_say_who_starts_anew():
    rows = [lived([session(k) for k in range(7)], [aged(1), aged(10)], seed=s) for s in range(6)]
    ((group, own),) = score_tables.groups([*rows, anew(0)]).items()
    assert score_tables.where(group) == "room, motion 0, change 0.3"
    assert score_tables.size(own) == "6 buildings of 7 sessions"
    cells = {row[0].text: [str(cell) for cell in row[1:]] for row in score_tables.table(own).rows}
    assert cells["map"][1] == "starts anew [cannot load a map]"
    assert cells["sessions found"] == ["36 of 36 [90 to 100 %]", "–"]
    assert cells["error of session 1, cm"] == ["3.00 [3.00 to 3.00]", "3.00"]
    assert "sessions that failed" not in cells
    mine, guest = score_tables.sentences(own)
    assert mine == (
        "`mine`: found 36 of 36 sessions from an unknown start, 30 within 10 s, never at a wrong "
        "place; error 3.00 cm in session 1, 8.00 cm in the last, 5.00 cm in a map 10 sessions "
        "old; ghosts 3.00 % early, 4.00 % late."
    )
    assert guest.startswith("`guest`: starts anew: cannot load a map; error 3.00 cm in session 1")
    assert guest.count("in a frame of its own") == 1

# SPDX-License-Identifier: Apache-2.0
"""What the leaderboard says of hand-made runs."""

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from scripts.benchmark import scores
from scripts.benchmark.board import Board, lost_from_words
from scripts.benchmark.tracks import LEVELS, TRACKS, Track

TRACK = TRACKS["tour-guide-v1"]
ORACLE = TRACK.oracle
OPEN = TRACK.later()  # not decided whether it counts


def runs(slam: str, lost: list[list[int]], *, error_m: float = 0.01, **more) -> list[dict]:
    """``lost`` is seed by seed, level by level; the error grows with the level."""
    return [
        {
            "slam": slam, "dynamism": level, "seed": 720 + k, "lost": is_lost, "failure": None,
            "outcome": "lost" if is_lost else "finished", "ate_unaligned_m": error_m + 0.1 * level,
            "error_tracking_m": error_m, "rpe_m_per_m": error_m + 0.1 * level,
            "silent_share": 0.25 * is_lost, "ms_per_scan_p50": 2.0,
            "ms_per_scan_p999": 9.0, "peak_memory_mb": 10.0, **more,
        }
        for k, seed in enumerate(lost)
        for level, is_lost in zip(LEVELS, seed, strict=True)
    ]  # fmt: skip


KEPT = [[0, 0, 0, 0, 0]] * 6
HALF = [[0, 0, 1, 1, 1]] * 3 + [[0, 0, 0, 1, 1]] * 3


@pytest.mark.parametrize(
    ("shares", "level"),
    [
        ([0, 0, 0, 0, 0], math.inf),
        ([0, 0, 0, 0.25, 0.49], math.inf),
        ([0.5, 1, 1, 1, 1], 0.0),
        ([0, 0, 1, 1, 1], 0.375),  # halfway between the last level without and the first with all
        ([0, 0, 0.5, 1, 1], 0.5),
        ([0, 1, 0, 1, 1], 0.25),  # 1 and 0 in the wrong order are one half each
        ([0, 0.4, 0.2, 0.7, 1], 0.625),  # 0.3, 0.3, then 0.7
    ],
)
def test_the_level_at_which_half_are_lost(shares: list[float], level: float):
    assert scores.lost_from(LEVELS, shares) == pytest.approx(level)


def test_its_interval_holds_it_and_repeats():
    lost = np.array(HALF, dtype=float)
    low, high = scores.lost_from_interval(LEVELS, lost)
    assert low == 0.25  # the level before the crossing at 0.5
    assert scores.lost_from(LEVELS, lost.mean(axis=0)) == 0.5
    assert 0.5 < high <= 0.625
    assert scores.lost_from_interval(LEVELS, lost) == (low, high)
    assert all(math.isnan(value) for value in scores.lost_from_interval(LEVELS, lost[:1]))
    assert scores.lost_from_interval(LEVELS, np.zeros((4, 5))) == (math.inf, math.inf)
    alike = np.array([[0, 0, 1, 1, 1]] * 6, dtype=float)  # nothing was run between 0.25 and 0.5
    assert scores.lost_from_interval(LEVELS, alike) == (0.25, 0.5)
    assert scores.lost_from_interval(LEVELS, np.ones((6, 5))) == (0.0, 0.0)


def test_the_interval_of_the_error_draws_seeds_whole():
    """Ten runs of one room are no ten rooms: the same values, and an interval as of two."""
    near, far = [(720, 0.01)] * 5, [(721, 0.03)] * 5
    assert scores.by_seed_interval([*near, *far]) == (0.01, 0.03)
    apart = [(k, value) for k, (_, value) in enumerate([*near, *far] * 4)]
    low, high = scores.by_seed_interval(apart)
    assert high - low <= 0.02
    assert all(math.isnan(value) for value in scores.by_seed_interval(near))


def test_a_row_sums_up_its_runs():
    row = scores.score(TRACK, "mine", runs("mine", HALF))
    assert (row["seeds"], row["runs"], row["lost_runs"], row["failed_runs"]) == (6, 30, 15, 0)
    assert row["lost_at_top"] == 1.0
    assert (row["spearman"], row["spearman_ate"]) == pytest.approx((1.0, 1.0))
    assert row["silent_share"] == pytest.approx(0.25 * 15 / 30)
    assert (row["error_tracking_m"], row["error_tracking_m_runs"]) == (0.01, 30)
    assert (row["ms_per_scan_p50"], row["ms_per_scan_p999"]) == (2.0, 9.0)
    claims_nothing = scores.score(TRACK, "mine", runs("mine", HALF, silent_share=None))
    assert claims_nothing["silent_share"] is None


def test_drift_weighs_every_seed_alike():
    """One seed that slips by 100 times the usual does not outweigh five that get twice as bad."""
    rows = runs("mine", KEPT)
    for row in rows:
        row["rpe_m_per_m"] = 0.01 * (1.0 + row["dynamism"])
    rows[0]["rpe_m_per_m"] = 0.02  # seed 720 at level 0
    by_level = scores.drift_by_level(rows)
    assert by_level[0.0] == pytest.approx(0.01 * 2.0 ** (1 / 6))
    assert by_level[1.0] == pytest.approx(0.02)
    assert scores.spearman(by_level) == pytest.approx(1.0)
    rows[-1] |= {"outcome": "raised", "rpe_m_per_m": None}
    assert scores.drift_by_level(rows)[1.0] == math.inf


def test_a_published_track_says_itself_whether_it_counts_and_any_other_its_oracle():
    good = runs(ORACLE, KEPT, error_m=0.019)
    lost = runs(ORACLE, [*KEPT[:5], [0, 0, 0, 0, 1]])
    assert scores.fairness(TRACK, lost)["counts"]
    assert not scores.fairness(TRACKS["ward-round-v1"], good)["counts"]
    assert scores.fairness(OPEN, good)["counts"]
    assert not scores.fairness(OPEN, lost)["counts"]
    assert not scores.fairness(OPEN, [])["counts"]
    far = [r | {"error_tracking_m": 0.051} if r["dynamism"] == 0.75 else r for r in good]
    assert not scores.fairness(OPEN, far)["counts"]  # at one level is enough
    assert scores.fairness(OPEN, far)["oracle_error_m"] == 0.051
    other = scores.fairness(OPEN, [*lost, *runs("oracle(map)", KEPT)])
    assert (other["counts"], other["oracle"]) == (True, "oracle(map)")  # either may hold
    for lost, fair in ((2, True), (3, False)):
        table = [[0, 0, 0, 0, k < lost] for k in range(20)]
        assert scores.fairness(OPEN, runs(ORACLE, table))["counts"] is fair


def board(mine: list[dict], track: Track = TRACK, oracle: list[list[int]] = KEPT) -> Board:
    seeds = len({row["seed"] for row in mine})
    rows = [*mine, *runs("odometry", KEPT[:seeds], error_m=0.2), *runs(ORACLE, oracle[:seeds])]
    return Board(subject="mine", head={"seeds": [720]}, tracks=[track], runs={track.name: rows})


def test_the_sentence_says_where_the_subject_is_lost():
    made = board(runs("mine", HALF))
    assert made.slams == ["mine", "odometry", ORACLE]
    over, track = made.said()
    assert over.startswith(
        "`mine` was lost in tour-guide-v1 in 0 of 6 at level 0, 0 of 6 at 0.25, 3 of 6 at 0.5, 6 of"
    )
    assert track == (
        "`mine` is lost in half of the runs in tour-guide-v1 from level 0.5 [0.25, 0.6] on."
    )
    never = board(runs("mine", KEPT)).said()[-1]
    assert never == "`mine` is not lost in half of the runs at any level of tour-guide-v1."
    worse = board(runs("mine", HALF, error_m=0.3)).said()
    assert "worse than its own odometry in tour-guide-v1" in worse[-1]
    left_out = board(runs("mine", HALF), OPEN, HALF).said()[-1]
    assert left_out == f"Left out, because no oracle holds there: {OPEN.name}."


def test_nothing_is_claimed_of_too_few_runs():
    made = board(runs("mine", HALF[:5], error_m=0.3))
    (seen,) = made.said()
    assert "`mine` was lost in tour-guide-v1" in seen
    row = made.row(TRACK.name, "mine")
    assert math.isfinite(row["lost_from_low"])
    assert lost_from_words(row) == "0.46"  # no interval
    assert lost_from_words(board(runs("mine", KEPT[:5])).row(TRACK.name, "mine")) == "> 1"


def test_never_is_said_where_the_whole_interval_is_above_the_top():
    assert lost_from_words(board(runs("mine", KEPT)).row(TRACK.name, "mine")) == "never"
    some = [[0, 0, 0, 0, 1]] * 2 + [[0, 0, 0, 0, 0]] * 4
    made = board(runs("mine", some))
    words = lost_from_words(made.row(TRACK.name, "mine"))
    assert words == "> 1 [0.94, > 1]"
    told = f"Whether half of its runs are lost cannot be told in tour-guide-v1 {words}."
    assert made.said()[-1] == told


TWO = (TRACK, TRACKS["no-walls-v1"])


def of_two(slam: str, lost: list[list[int]], **more) -> dict[str, list[dict]]:
    own = {t.name: t.oracle if slam == ORACLE else slam for t in TWO}
    return {track: runs(name, lost, **more) for track, name in own.items()}


def test_its_worst_tracks_come_first():
    lost = ([[0, 0, 0, 0, 1]], [[0, 1, 1, 1, 1]])
    rows = {t.name: runs("mine", of) for t, of in zip(TWO, lost, strict=True)}
    made = Board(subject="mine", head={"seeds": [720]}, tracks=TWO, runs=rows)
    assert scores.worst(made.of(made.subject)) == ["no-walls-v1", "tour-guide-v1"]


def test_over_all_tracks_each_room_is_a_run_and_the_subject_gets_a_place():
    slams = {
        "mine": of_two("mine", [[0, 0, 0, 0, 1]]),
        "near": of_two("near", [[0, 0, 0, 0, 1]], error_m=0.005),
        "lost": of_two("lost", [[0, 1, 1, 1, 1]], error_m=0.001),
        "odometry": of_two("odometry", [[1, 1, 1, 1, 1]]),
        ORACLE: of_two(ORACLE, [[0, 0, 0, 0, 0]]),
    }
    rows = {t.name: [row for of in slams.values() for row in of[t.name]] for t in TWO}
    made = Board(subject="mine", head={"seeds": [720]}, tracks=TWO, runs=rows)
    assert [row["slam"] for row in made.ranking] == [ORACLE, "near", "mine", "lost", "odometry"]
    assert [line[:2] for line in made.ranked()] == [
        ["–", ORACLE], ["1", "near"], ["2", "mine"], ["3", "lost"], ["–", "odometry"],
    ]  # fmt: skip
    assert made.ranking[2]["lost_from"] == 0.875
    over, place, where, more = made.said()
    assert more == "Track by track it takes `--seeds 6` to tell from which level on."
    assert "in the 2 tracks that count in 0 of 2 at level 0" in over
    assert "so at least 34 % of such runs are lost at 1 (95 %)" in over
    assert "`--seeds 2` would tell whether more than half are lost" in over
    assert place == "It is number 2 of 3 on these 10 runs, behind `near` and before `lost`."
    assert where == "It was lost on tour-guide-v1 at 1; no-walls-v1 at 1."
    assert made.cite() == board_of_one_more_slam(made).cite()


def board_of_one_more_slam(made: Board) -> Board:
    """One that made a run less: it has no place, and what is cited stays."""
    more = {track: [*rows, *runs("less", KEPT)[1:]] for track, rows in made.runs.items()}
    other = replace(made, runs=more)
    assert "less" not in {row["slam"] for row in (*other.ranking, *other.rows)}
    assert len(other.ranking) == len(made.ranking)
    return other


def test_what_failed_is_told_with_its_line(tmp_path: Path):
    raised = runs("mine", KEPT)
    raised[3] |= {"outcome": "raised", "failure": "scan 2: ValueError (my.py:7)", "lost": 1}
    made = board(raised)
    head = "mine failed in 1 runs of tour-guide-v1: "
    assert made.failures() == [head + "scan 2: ValueError (my.py:7)"]
    made.write(tmp_path)
    assert f"{head}`scan 2: ValueError (my.py:7)`" in (tmp_path / "leaderboard.md").read_text()
    data = json.loads((tmp_path / "leaderboard.json").read_text())
    assert data["subject"] == "mine"
    assert data["tracks"][TRACK.name]["counts"] is True
    assert data["leaderboard"]["tour-guide-v1 mine"]["failed_runs"] == 1
    assert data["leaderboard"]["tour-guide-v1 odometry"]["lost_from"] == "inf"
    assert data["lost_shares"]["tour-guide-v1 odometry"] == {
        "levels": list(LEVELS), "lost": [0.0] * 5,
    }  # fmt: skip
    header, *lines = (tmp_path / "leaderboard.csv").read_text().splitlines()
    assert header.split(",") == list(scores.COLUMNS)
    assert len(lines) == 3


def test_a_submitted_row_says_whose_word_it_is_and_nothing_in_it_is_markdown():
    failed = runs("mine", KEPT)
    failed[0] |= {"outcome": "raised", "failure": "`![x](http://x)` <img src=x>", "lost": 1}
    origin = {"slam": "a`b:C", "made_with": "mujoco 3, a CPU"}
    page = replace(board(failed), merged={"mine": origin}).markdown()
    assert ": `'![x](http://x)' <img src=x>`\n" in page
    told = "- `mine` was submitted, as SLAM `a'b:C`, and its results are the submitter's word."
    assert f"{told} Made with `mujoco 3, a CPU`" in page

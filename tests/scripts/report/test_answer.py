# SPDX-License-Identifier: Apache-2.0
"""The sentence on top: what it says in each case, however few the runs."""

from dataclasses import replace
from typing import Any

import pytest

from scripts.report.answer import Level, Lost, Standing, answer, controls, failed, standing

pytestmark = pytest.mark.film
MINE, ORACLE = "my_icp", "oracle(shunting)"


def of(lost: list[int], *, runs: int = 10, levels=(0.0, 0.4, 1.0), failures=(), against=(),
       odometry=(), oracle=(), own=False) -> Standing:  # fmt: skip
    """A SLAM that lost so many runs at each level, beside controls that did so."""

    def at(values, k, default):
        return values[k] if values else default

    return Standing(
        subject=MINE,
        scene="arena",
        axis="dynamism",
        own_oracle=own,
        levels=tuple(
            Level(
                at=levels[k],
                subject=Lost(lost=n, runs=runs, failed=at(failures, k, 0)),
                against=at(against, k, 0),
                odometry=Lost(lost=odometry[k], runs=runs) if odometry else None,
                oracle=Lost(lost=oracle[k], runs=runs) if oracle else None,
            )
            for k, n in enumerate(lost)
        ),
    )


@pytest.mark.parametrize(
    ("case", "said"),
    [
        (
            of([0, 6, 9], against=[-1, -1, -1]),
            "was lost in arena in 0 of 10 at dynamism 0, 6 of 10 at 0.4 and 9 of 10 at 1; it "
            "holds at 0 and is lost at 0.4, so at least 31 % of such runs are lost at 0.4 (95 %); "
            "at 0 it is already worse than its own odometry, so dynamism is not its problem; that "
            "is too near to one half at 0.4 for 50 seeds to tell.",
        ),
        (
            of([5, 5, 5], runs=5),
            "was lost in 15 of 15 runs in arena, already at dynamism 0; so at least 57 % of such "
            "runs are lost at 0 (95 %); this begins at 0, so dynamism is not its problem.",
        ),
        (
            of([0, 0, 0], odometry=[0, 0, 0]),
            "was lost in none of 30 runs in arena, up to dynamism 1; so at most 28 % of such runs "
            "are lost at 1 (95 %); but odometry alone is not lost either, so these runs are too "
            "easy to tell.",
        ),
        (
            of([0, 10, 10], oracle=[0, 0, 3]),
            "was lost in arena in 0 of 10 at dynamism 0, 10 of 10 at 0.4 and 10 of 10 at 1; it "
            "holds at 0 and is lost at 0.4, so at least 72 % of such runs are lost at 0.4 (95 %); "
            "the oracle fails too at dynamism 1 (3 of 10 runs, 11 to 60 %): the room is unfair "
            "there.",
        ),
        (
            of([0, 10, 10], oracle=[0, 2, 3], own=True),
            "was lost in arena in 0 of 10 at dynamism 0, 10 of 10 at 0.4 and 10 of 10 at 1; it "
            "holds at 0 and is lost at 0.4, so at least 72 % of such runs are lost at 0.4 (95 %); "
            "without the returns of movers it is lost too at dynamism 0.4 and 1 (3 of 10 runs, 11 "
            "to 60 % at 1), so they are not its only problem, or the room is unfair.",
        ),
        (
            of([0, 9, 9], failures=[0, 9, 9]),
            "failed in arena in 0 of 10 at dynamism 0, 9 of 10 at 0.4 and 9 of 10 at 1; it holds "
            "at 0 and is lost at 0.4, so at least 60 % of such runs are lost at 0.4 (95 %).",
        ),
        (
            of([9], levels=(0.5,), failures=[1], odometry=[3]),
            "failed or was lost in 9 of 10 runs in arena at dynamism 0.5; so at least 60 % of such "
            "runs are lost (95 %).",
        ),
        (
            of([0, 2], levels=(0.0, 1.0), runs=2),
            "was lost in arena in 0 of 2 at dynamism 0 and 2 of 2 at 1; it holds at 0 and is "
            "lost at 1, so at least 34 % of such runs are lost at 1 (95 %); `--seeds 4` would tell "
            "whether more than half are lost at 0 and 1.",
        ),
    ],
)  # fmt: skip
def test_the_sentence_of_each_case(case: Standing, said: str):
    assert answer(case) == f"`{MINE}` {said}"


def test_what_is_lost_at_times_does_not_hold():
    assert "; half of the runs or more are lost at 1, so at least" in answer(of([4, 4, 10]))


def test_people_are_named_where_they_are_what_is_varied():
    case = replace(of([0, 0, 10], levels=(0.0, 8.0, 12.0)), axis="people", scene="intel.toml")
    said = "it holds at 8 and is lost from 12 people on in intel.toml, so at least 72 %"
    assert said in answer(case)
    lost = replace(of([10, 10], levels=(0.0, 4.0)), axis="people")
    assert "already at 0 people" in answer(lost)


def test_a_level_above_zero_blames_nothing_on_dynamism():
    assert "is not its problem" not in answer(of([9, 9], levels=(0.5, 1.0), against=[-1, -1]))


@pytest.mark.parametrize(
    ("case", "said"),
    [
        (
            of([0, 6, 9], odometry=[5, 5, 5], oracle=[0, 0, 0]),
            [
                "Odometry alone is lost in 5 of 10 runs, 24 to 76 %, at dynamism 1.",
                "The oracle is never lost (0 of 10 runs at each level, 0 to 28 %), so the room is "
                "fair.",
            ],
        ),
        (
            of([0, 6, 9]),
            [
                "Odometry, the control that looks at nothing, did not run: `--slam … odometry`.",
                "No oracle ran: `--oracle shunting` tells whether the room is fair.",
            ],
        ),
    ],
)
def test_the_controls_are_told_or_asked_for(case: Standing, said: list[str]):
    assert controls(case) == said


def row(slam: str, level: float, seed: int, error_m: float, **more: Any) -> dict[str, Any]:
    outcome = "lost" if error_m > 0.5 else "finished"
    head = {"scene": "arena", "dynamism": level, "seed": seed, "slam": slam, "failure": None}
    lost = int(error_m > 0.5)
    return head | {"outcome": outcome, "lost": lost, "ate_unaligned_m": error_m} | more


RAISED = {"outcome": "raised", "lost": 1, "ate_unaligned_m": None}


def rows() -> list[dict[str, Any]]:
    """At level 0 mine is further off than odometry, at level 1 lost; one oracle fails, one not."""
    errors = {
        MINE: (0.3, 0.9),
        "odometry": (0.1, 0.8),
        ORACLE: (0.01, 0.02),
        "oracle(x)": (0.9, 0.9),
    }
    made = [
        row(slam, float(level), seed, both[level] + 1e-3 * seed)
        for slam, both in errors.items()
        for level in (0, 1)
        for seed in range(6)
    ]
    words = "SLAM 'my_icp', scan 9, raised ZeroDivisionError: by zero (my_icp.py:31)"
    made[3] |= RAISED | {"failure": words}
    return made


def test_the_rows_of_a_comparison_are_read():
    found = standing(rows(), MINE, "arena")
    assert [level.at for level in found.levels] == [0.0, 1.0]
    assert [level.subject for level in found.levels] == [
        Lost(lost=1, runs=6, failed=1),
        Lost(lost=6, runs=6),
    ]
    assert [level.against for level in found.levels] == [-1, -1]
    assert [level.oracle for level in found.levels] == [Lost(lost=0, runs=6)] * 2
    assert not found.own_oracle
    assert standing(rows(), "x", "arena").levels[0].subject == Lost(lost=0, runs=0)
    assert standing(rows(), "shunting", "arena").own_oracle
    alone = standing(rows(), "odometry", "arena")  # a control has none itself
    assert [(level.odometry, level.oracle) for level in alone.levels] == [(None, None)] * 2
    assert controls(alone) == []


def test_a_slam_that_raised_is_told_with_its_line():
    assert failed(rows()) == [
        "`my_icp` raised or ended in 1 of 12 runs, first in arena at dynamism 0, seed 3: SLAM "
        "'my_icp', scan 9, raised ZeroDivisionError: by zero (my_icp.py:31)"
    ]
    assert failed([one for one in rows() if one["slam"] == "odometry"]) == []

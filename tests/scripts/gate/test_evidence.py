# SPDX-License-Identifier: Apache-2.0
"""The sequential test: its E have mean 1 at most, its errors are what they say."""

import math
import random
from itertools import product
from statistics import mean

import pytest

from scripts.gate.evidence import (
    LEAST,
    MOST,
    WORSE,
    WRONG,
    against_larger,
    against_lost,
    against_unchanged,
    change,
    verdict_of,
)

FIFTH = math.log1p(WORSE)


@pytest.mark.parametrize("sizes", [(0.1, 0.3, 2.0), (0.01, math.inf, 0.5, 0.02)])
def test_the_mean_over_all_signs_is_one(sizes):
    """Where nothing changed each sign is a fair coin: exactly, for runs of any size."""
    signs = list(product((-1.0, 1.0), repeat=len(sizes)))
    flipped = [[s * d for s, d in zip(sign, sizes, strict=True)] for sign in signs]
    assert mean(map(against_unchanged, flipped)) == pytest.approx(1.0)
    fifth = [[FIFTH + value for value in changes] for changes in flipped]
    assert mean(map(against_larger, fifth)) == pytest.approx(1.0)


@pytest.mark.parametrize("share", [WORSE, 0.4])
def test_the_mean_is_at_most_one_where_so_many_runs_are_newly_lost(share):
    lost, held = against_lost([math.inf]), against_lost([0.1])
    assert share * lost + (1.0 - share) * held <= 1.0 + 1e-12
    assert against_lost([-math.inf]) == 1.0  # it was lost before: says nothing of new losses


def test_equal_answers_pass_as_soon_as_enough_runs_are_held():
    verdict, runs = verdict_of([0.0] * 60)
    assert verdict == "not worse"
    assert (1.0 - WORSE) ** runs <= WRONG  # else so many could be lost and none be seen


def test_only_lost_runs_are_enough():
    assert verdict_of([math.inf] * 60) == ("worse", 8)
    assert verdict_of([None] * 60) == ("undecided", 60)
    assert verdict_of([0.0, math.inf] * 30)[0] == "worse"


@pytest.mark.parametrize(("shift", "wanted"), [(0.0, "not worse"), (FIFTH, "worse")])
def test_errors_of_the_verdict(shift, wanted):
    """Over 500 trials of 60 runs that scatter by a quarter."""
    draws = random.Random(7)
    trials = [verdict_of([draws.gauss(shift, 0.25) for _ in range(60)])[0] for _ in range(500)]
    wrong = sum(verdict not in (wanted, "undecided") for verdict in trials) / len(trials)
    assert wrong <= WRONG + 3.0 * math.sqrt(WRONG / len(trials))
    assert trials.count(wanted) > 0.95 * len(trials)


def test_a_change_is_the_mean_of_both_errors_and_a_loss_is_without_bounds():
    def row(ate, rpe, lost=0):
        return {"lost": lost, "ate_se2_m": ate, "rpe_m_per_s": rpe}

    assert change(row(0.1, 0.02), row(0.2, 0.02)) == pytest.approx(0.5 * math.log(2.0))
    assert change(row(LEAST / 9, LEAST / 2), row(LEAST, LEAST / 5)) == 0.0
    assert change(row(0.1, None), row(0.3, 0.2)) == pytest.approx(math.log(3.0))
    assert change(row(0.1, 0.1), row(None, None, 1)) == math.inf
    assert change(row(9.0, 0.1, 1), row(0.1, 0.1)) == -math.inf
    assert change(row(9.0, 0.1, 1), row(9.0, 0.1, 1)) is None
    assert len({against_unchanged([value]) for value in (50.0, MOST, math.inf)}) == 1

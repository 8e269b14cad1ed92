# SPDX-License-Identifier: Apache-2.0
"""Branch and bound is exhaustive search, only faster, and the same on any number of threads."""

from __future__ import annotations

import math

import numpy as np
import pytest

from slam.tracker.matching import branch_and_bound
from slam.tracker.matching.branch_and_bound import Found, Lattice, Search, levels_of


def random_lattice(rng: np.random.Generator, depth: int, *, flat: bool = False) -> Lattice:
    """Sparse random structure; ``flat``: few values, so that many candidates are equally good."""
    reach, headings, points = int(rng.integers(1, 12)), int(rng.integers(1, 14)), 12
    field = (rng.random((64, 64)) ** 6 * 255.0).astype(np.uint8)
    root = rng.normal(size=(3, 3))
    precision = (root @ root.T + 0.1 * np.eye(3)) * float(rng.uniform(0.1, 20.0))
    if flat:
        field, precision = (field > 40).astype(np.uint8), np.zeros((3, 3))
    return Lattice(
        levels=levels_of(field, depth),
        bases=rng.integers(20, 36, (headings, points, 2)).astype(np.int32),
        turns=np.sort(rng.uniform(-0.3, 0.3, headings)),
        reach=reach,
        pitch=0.05,
        precision=precision,
        gain=0.01,
    )


def exhaustive(lattice: Lattice) -> Found:
    """Every candidate, the first of the best by heading, row and column."""
    offsets = np.arange(-lattice.reach, lattice.reach + 1)
    rows, columns = offsets[:, None], offsets[None, :]
    scores = np.empty((len(lattice.turns), len(offsets), len(offsets)))
    P = lattice.precision
    for h, turn in enumerate(lattice.turns.tolist()):
        sums = np.zeros(scores.shape[1:], np.int64)
        for column, row in lattice.bases[h].tolist():
            sums += lattice.levels[0, row + rows, column + columns]
        ex, ey = columns * lattice.pitch, rows * lattice.pitch
        square = P[0, 0] * ex * ex + P[1, 1] * ey * ey + P[2, 2] * turn * turn
        square = square + 2.0 * (P[0, 1] * ex * ey + P[0, 2] * ex * turn + P[1, 2] * ey * turn)
        scores[h] = lattice.gain * sums - 0.5 * square
    first = np.argwhere(scores >= scores.max() - 1e-12)[0]
    heading, row, column = first.tolist()
    reach = lattice.reach
    return Found(score=float(scores.max()), heading=heading, row=row - reach, column=column - reach)


def test_branch_and_bound_equals_exhaustive_search_in_200_of_200_cases() -> None:
    rng = np.random.default_rng(11)
    for case in range(200):
        lattice = random_lattice(rng, 1 + case % 3, flat=case % 10 == 9)
        found, best = Search(lattice).best(), exhaustive(lattice)
        assert found.score == pytest.approx(best.score, abs=1e-9)
        assert (found.heading, found.row, found.column) == (best.heading, best.row, best.column)


def test_any_number_of_threads_finds_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(12)
    lattices = [random_lattice(rng, 2, flat=case % 2 == 0) for case in range(20)]
    undivided = [Search(lattice).best() for lattice in lattices]
    monkeypatch.setattr(branch_and_bound, "WORTH_THREADS", 0)
    for lattice, alone in zip(lattices, undivided, strict=True):
        found = [Search(lattice, threads).best() for threads in (1, 2, 4)]
        assert found[0] == found[1] == found[2]
        assert (found[0].score, found[0].heading) == (alone.score, alone.heading)
        assert (found[0].row, found[0].column) == (alone.row, alone.column)


def test_answers_above_a_floor_and_apart_from_others() -> None:
    rng = np.random.default_rng(13)
    lattice = random_lattice(rng, 2)
    best = Search(lattice).best()
    assert Search(lattice).best(best.score).heading == -1  # nothing is better than the best
    apart = Lattice(**(vars(lattice) | {"apart": (3.0, 1e9)}))
    taken = np.array([[best.column, best.row, 0.0]], dtype=np.float64)
    other = Search(apart).best(taken=taken)
    assert other.score <= best.score
    assert math.hypot(other.column - best.column, other.row - best.row) >= 3.0


def test_levels_are_the_largest_of_what_lies_ahead() -> None:
    field = np.random.default_rng(1).integers(0, 255, (13, 9)).astype(np.uint8)
    for level, maxima in enumerate(levels_of(field, 3)):
        span = 1 << level
        for r in range(13):
            for c in range(9):
                assert maxima[r, c] == field[r : r + span, c : c + span].max()

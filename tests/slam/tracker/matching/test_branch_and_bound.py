# SPDX-License-Identifier: Apache-2.0
"""Branch and bound is exhaustive search, only faster."""

import numpy as np
import pytest

from slam.tracker.matching.branch_and_bound import Lattice, best_of, look_ahead


def random_lattice(rng: np.random.Generator, *, flat: bool = False) -> Lattice:
    """Sparse random structure; ``flat``: few values, so that many candidates are equally good."""
    reach, headings, points = int(rng.integers(1, 12)), int(rng.integers(1, 14)), 12
    field = (rng.random((64, 64)) ** 6 * 255.0).astype(np.uint8)
    root = rng.normal(size=(3, 3))
    precision = (root @ root.T + 0.1 * np.eye(3)) * float(rng.uniform(0.1, 20.0))
    if flat:
        field, precision = (field > 40).astype(np.uint8), np.zeros((3, 3))
    return Lattice(
        field=field,
        ahead=look_ahead(field, np.zeros_like(field)),
        bases=rng.integers(20, 36, (headings, points, 2)).astype(np.int32),
        turns=np.sort(rng.uniform(-0.3, 0.3, headings)),
        reach=reach,
        pitch=0.05,
        precision=precision,
        gain=0.01,
    )


def exhaustive(lattice: Lattice) -> tuple[float, list[int]]:
    """Score, heading, row and column of the first of the best of all candidates."""
    offsets = np.arange(-lattice.reach, lattice.reach + 1)
    rows, columns = offsets[:, None], offsets[None, :]
    scores = np.empty((len(lattice.turns), len(offsets), len(offsets)))
    P = lattice.precision
    for h, turn in enumerate(lattice.turns.tolist()):
        sums = np.zeros(scores.shape[1:], np.int64)
        for column, row in lattice.bases[h].tolist():
            sums += lattice.field[row + rows, column + columns]
        ex, ey = columns * lattice.pitch, rows * lattice.pitch
        square = P[0, 0] * ex * ex + P[1, 1] * ey * ey + P[2, 2] * turn * turn
        square = square + 2.0 * (P[0, 1] * ex * ey + P[0, 2] * ex * turn + P[1, 2] * ey * turn)
        scores[h] = lattice.gain * sums - 0.5 * square
    first = np.argwhere(scores >= scores.max() - 1e-12)[0]
    return float(scores.max()), (first - [0, lattice.reach, lattice.reach]).tolist()


def test_branch_and_bound_equals_exhaustive_search_in_200_of_200_cases() -> None:
    rng = np.random.default_rng(11)
    for case in range(200):
        lattice = random_lattice(rng, flat=case % 10 == 9)
        found, (score, place) = best_of(lattice), exhaustive(lattice)
        assert found.score == pytest.approx(score, abs=1e-9)
        assert [found.heading, found.row, found.column] == place

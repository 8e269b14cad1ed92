# SPDX-License-Identifier: Apache-2.0
"""The sparse solver against a dense one."""

import numpy as np
import pytest

from slam.block_cholesky import Pattern, solve


@pytest.mark.parametrize("seed", range(3))
def test_it_solves_as_a_dense_solver_does(seed: int) -> None:
    """A chain with random loops, one of them twice, and blocks that are not symmetric."""
    n, rng = 30, np.random.default_rng(seed)
    loops = [sorted(rng.choice(n, 2, replace=False).tolist()) for _ in range(20)]
    ends = np.array([(k, k + 1) for k in range(n - 1)] + loops + loops[:1])
    pattern = Pattern(n, ends)
    blocks, dense = np.zeros((len(pattern.rows), 3, 3)), np.zeros((3 * n, 3 * n))
    for pair, own in zip(ends, pattern.blocks, strict=True):
        J = rng.normal(size=(3, 6))
        H = J.T @ J + 0.1 * np.eye(6)
        at = np.concatenate([3 * end + np.arange(3) for end in pair])
        dense[np.ix_(at, at)] += H
        places = pattern.place[pair]
        for k in range(2):
            if places[k] >= 0:
                blocks[pattern.starts[places[k]]] += H[3 * k : 3 * k + 3, 3 * k : 3 * k + 3]
        if own >= 0:
            blocks[own] += H[3:, :3] if places[1] > places[0] else H[:3, 3:]
    right = rng.normal(size=(n, 3))
    x = np.empty((n - 1, 3))
    x[pattern.place[1:]] = right[1:]
    solve(pattern.starts, pattern.rows, blocks, x)
    expected = np.linalg.solve(dense[3:, 3:], right[1:].ravel()).reshape(-1, 3)
    np.testing.assert_allclose(x[pattern.place[1:]], expected, rtol=1e-6)


@pytest.mark.parametrize("n", [300, 2000])
def test_a_long_chain_that_closes_is_solved_at_once(n: int) -> None:
    """One loop, all poses along it eliminated: what fills the factor must all have its place."""
    pattern = Pattern(n, np.array([(k, k + 1) for k in range(n - 1)] + [(1, n - 1)]))
    below: list[set[int]] = [set() for _ in range(n - 1)]
    for a, b in [(k, k + 1) for k in range(1, n - 1)] + [(1, n - 1)]:
        first, last = sorted(pattern.place[[a, b]].tolist())
        below[first].add(last)
    for k, column in enumerate(below):
        rows = pattern.rows[pattern.starts[k] : pattern.starts[k + 1]].tolist()
        assert rows == [k, *sorted(column)]
        if column:
            below[min(column)] |= column - {min(column)}

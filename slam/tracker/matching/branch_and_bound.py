# SPDX-License-Identifier: Apache-2.0
"""Branch and bound over headings and offsets on a lattice, on one thread or several.

Of equally good candidates the one of the lowest heading, then row, then column is taken, and the
work is split in the same parts whatever the number of threads: so is the result always the same.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from slam._jit import inner, njit
from slam.frames import Float

SPAN = 8  # a block of 8 x 8 offsets is scored at once
LEVEL = 3  # of such a block
PARTS = 8  # the headings are dealt out to so many searches
WORTH_THREADS = 3_000_000  # look-ups, some ms; fewer are done before the threads have started
S = TypeVar("S")
T = TypeVar("T")
NOTHING_TAKEN = np.zeros((0, 3))


@dataclass(frozen=True, kw_only=True, eq=False)
class Lattice:
    """What is searched.

    levels     (L + 1, rows, columns) uint8; level l holds maxima over 2^l x 2^l forward neighbours
    bases      (headings, n, 2) int32 columns and rows of the points at offset (0, 0)
    turns      (headings,) rad from the prediction
    reach      offsets go from -reach to reach, cells
    pitch      m between two offsets
    precision  (3, 3) of the prior
    gain       score of a sum of 1
    apart      cells and rad: a candidate must differ from those taken by one of them
    """

    levels: NDArray[np.uint8]
    bases: NDArray[np.int32]
    turns: Float
    reach: int
    pitch: float
    precision: Float
    gain: float
    apart: tuple[float, float] = (0.0, 0.0)


@dataclass(frozen=True, kw_only=True)
class Found:
    """The best candidate; ``heading`` -1 where none scores above the floor."""

    score: float
    heading: int = -1
    column: int = 0
    row: int = 0
    evaluations: int = 0

    def better_than(self, other: Found) -> bool:
        """Higher, or as high and first."""
        if self.heading < 0 or self.score != other.score:
            return self.heading >= 0 and self.score > other.score
        mine = (self.heading, self.row, self.column)
        return other.heading < 0 or mine < (other.heading, other.row, other.column)


def levels_of(field: NDArray[np.uint8], depth: int) -> NDArray[np.uint8]:
    """(depth + 1, rows, columns): level l is the maximum over l's 2^l x 2^l forward neighbours."""
    levels = np.empty((depth + 1, *field.shape), np.uint8)
    levels[0] = field
    for level in range(depth):
        span = 1 << level
        before, after = levels[level], levels[level + 1]
        wide = np.empty_like(before)
        np.maximum(before[:, :-span], before[:, span:], out=wide[:, :-span])
        wide[:, -span:] = before[:, -span:]
        np.maximum(wide[:-span], wide[span:], out=after[:-span])
        after[-span:] = wide[-span:]
    return levels


@inner
def _sum(level: NDArray[np.uint8], base: NDArray[np.int32], di: int, dj: int) -> int:
    """Sum of the level's values under the points (n, 2: column, row) shifted by (di, dj)."""
    total = 0
    for k in range(len(base)):
        total += level[base[k, 1] + dj, base[k, 0] + di]
    return total


@inner
def open_block(
    field: NDArray[np.uint8], flat: NDArray[np.uint64], first: int, columns: int,
    sums: NDArray[np.int64],
) -> None:  # fmt: skip
    """``sums`` (8, 8) of ``field``, which is flat and has so many ``columns``, under the points.

    ``flat`` (n,) their places in it, to which ``first`` is added, and the offsets from 0 to 7 each
    way. Places are unsigned, so that no index can be negative: eight at once then take the time of
    three.
    """
    for a in range(SPAN):
        down = np.uint64(first + a * columns)
        s0 = s1 = s2 = s3 = s4 = s5 = s6 = s7 = np.int32(0)
        for k in range(len(flat)):
            at = flat[k] + down
            s0 += np.int32(field[at])
            s1 += np.int32(field[at + np.uint64(1)])
            s2 += np.int32(field[at + np.uint64(2)])
            s3 += np.int32(field[at + np.uint64(3)])
            s4 += np.int32(field[at + np.uint64(4)])
            s5 += np.int32(field[at + np.uint64(5)])
            s6 += np.int32(field[at + np.uint64(6)])
            s7 += np.int32(field[at + np.uint64(7)])
        sums[a, 0], sums[a, 1], sums[a, 2], sums[a, 3] = s0, s1, s2, s3
        sums[a, 4], sums[a, 5], sums[a, 6], sums[a, 7] = s4, s5, s6, s7


@njit
def _bound(  # noqa: PLR0913 (kernel)
    level: NDArray[np.uint8],
    bases: NDArray[np.int32],
    costs: NDArray[np.float64],
    reach: int,
    width: int,
    gain: float,
    bounds: NDArray[np.float64],
) -> None:
    """Upper bounds (headings, rows, columns) of the coarsest blocks of offsets."""
    for h in range(bounds.shape[0]):
        for a in range(bounds.shape[1]):
            for b in range(bounds.shape[2]):
                total = _sum(level, bases[h], b * width - reach, a * width - reach)
                bounds[h, a, b] = gain * total - costs[h]


@inner
def is_apart(
    taken: NDArray[np.float64], apart: tuple[float, float], column: int, row: int, turn: float
) -> bool:
    """Whether a candidate differs from all that were taken, (n, 3) by column, row and turn."""
    for k in range(len(taken)):
        off = turn - taken[k, 2]
        off -= math.tau * math.floor(off / math.tau + 0.5)
        di, dj = column - taken[k, 0], row - taken[k, 1]
        if abs(off) < apart[1] and di * di + dj * dj < apart[0] * apart[0]:
            return False
    return True


@inner
def _first(index: NDArray[np.int64], heading: int, row: int, column: int) -> bool:
    """Whether a candidate comes before that of the index; False where there is none."""
    if heading != index[0]:
        return bool(heading < index[0])
    return bool(row < index[1] or (row == index[1] and column < index[2]))


@inner
def _cost(
    precision: NDArray[np.float64], pitch: float, column: int, row: int, turn: float
) -> float:
    """1/2 e' P^-1 e of a candidate."""
    ex, ey, et = column * pitch, row * pitch, turn
    cross = precision[0, 1] * ex * ey
    cross += precision[0, 2] * ex * et + precision[1, 2] * ey * et
    square = precision[0, 0] * ex * ex + precision[1, 1] * ey * ey
    square += precision[2, 2] * et * et
    return float(0.5 * (square + 2.0 * cross))


@njit
def _descend(  # noqa: C901, PLR0912, PLR0913, PLR0915 (kernel)
    levels: NDArray[np.uint8],
    bases: NDArray[np.int32],
    turns: NDArray[np.float64],
    costs: NDArray[np.float64],
    reach: int,
    pitch: float,
    precision: NDArray[np.float64],
    gain: float,
    taken: NDArray[np.float64],
    apart: tuple[float, float],
    bounds: NDArray[np.float64],
    order: NDArray[np.int64],
    best: float,
    index: NDArray[np.int64],
) -> tuple[float, int]:
    """Depth first through the blocks in falling ``order`` of their bounds.

    ``best`` and ``index`` (heading, row, column; heading -1: none yet) are what must be beaten; the
    index is changed in place. Returns the score and how many candidates were scored.
    """
    top = len(levels) - 1
    across = bounds.shape[1]
    evaluations = 0
    stack = np.empty((4 * (top + 1) + 4, 3), np.int64)  # di, dj, level
    stack_bound = np.empty(4 * (top + 1) + 4)
    children = np.empty(4)
    field, columns = levels[0].ravel(), levels.shape[2]
    flat, sums = np.empty(bases.shape[1], np.uint64), np.empty((SPAN, SPAN), np.int64)
    for entry in order:
        h, rest = entry // (across * across), entry % (across * across)
        bound = bounds[h, rest // across, rest % across]
        if bound < best or (bound == best and index[0] < 0):
            break
        depth = 1
        stack[0, 0] = (rest % across) * (1 << top) - reach
        stack[0, 1] = (rest // across) * (1 << top) - reach
        stack[0, 2] = top
        stack_bound[0] = bound
        while depth > 0:
            depth -= 1
            di, dj, level = stack[depth, 0], stack[depth, 1], stack[depth, 2]
            score = stack_bound[depth]
            if score < best or (score == best and index[0] < 0):
                continue
            if level == LEVEL:
                for k in range(bases.shape[1]):
                    flat[k] = bases[h, k, 1] * columns + bases[h, k, 0]
                open_block(field, flat, dj * columns + di, columns, sums)
                evaluations += SPAN * SPAN
                for a in range(min(SPAN, reach - dj + 1)):
                    for b in range(min(SPAN, reach - di + 1)):
                        i, j = di + b, dj + a
                        score = gain * sums[a, b] - _cost(precision, pitch, i, j, turns[h])
                        if (score > best or (score == best and _first(index, h, j, i))) and (
                            is_apart(taken, apart, i, j, turns[h])
                        ):
                            best = score
                            index[0], index[1], index[2] = h, j, i
                continue
            if level == 0:
                if (score > best or _first(index, h, dj, di)) and (
                    is_apart(taken, apart, di, dj, turns[h])
                ):
                    best = score
                    index[0], index[1], index[2] = h, dj, di
                continue
            span = 1 << (level - 1)
            for q in range(4):
                i, j = di + (q & 1) * span, dj + (q >> 1) * span
                children[q] = -math.inf
                if i > reach or j > reach:
                    continue
                evaluations += 1
                value = gain * _sum(levels[level - 1], bases[h], i, j)
                if level == 1:
                    children[q] = value - _cost(precision, pitch, i, j, turns[h])
                else:
                    children[q] = value - costs[h]
            for _ in range(4):  # the best is pushed last
                least = 0
                for q in range(1, 4):
                    if children[q] < children[least]:
                        least = q
                if best <= children[least] < math.inf:
                    stack[depth, 0] = di + (least & 1) * span
                    stack[depth, 1] = dj + (least >> 1) * span
                    stack[depth, 2] = level - 1
                    stack_bound[depth] = children[least]
                    depth += 1
                children[least] = math.inf
    return best, evaluations


def _heading_costs(precision: Float, turns: Float) -> Float:
    """The least 1/2 e' P^-1 e of each heading, whatever the offset."""
    (xx, xy, xt), (_, yy, yt), (_, _, tt) = precision.tolist()
    det = xx * yy - xy * xy
    if det <= 0.0:  # no prior
        return np.zeros(len(turns))
    bx, by = (xy * yt - yy * xt) / det, (xy * xt - xx * yt) / det
    square = xx * bx * bx + yy * by * by + tt + 2.0 * (xy * bx * by + xt * bx + yt * by)
    costs: Float = 0.5 * max(square, 0.0) * turns * turns * (1.0 - 1e-9)
    return costs


class Search:
    """Bounds of one lattice, and searches in it, on at most so many threads (None: processors)."""

    def __init__(self, lattice: Lattice, threads: int | None = None) -> None:
        self.lattice = lattice
        width = 1 << (len(lattice.levels) - 1)
        across = (2 * lattice.reach) // width + 1
        headings, points, _ = lattice.bases.shape
        worth = headings * across * across * points >= WORTH_THREADS
        self._parts = PARTS if worth else 1
        self._threads = min(_processors() if threads is None else threads, self._parts)
        self._costs = _heading_costs(lattice.precision, lattice.turns)
        self._bounds = np.empty((headings, across, across))
        edges = [k * headings // self._parts for k in range(self._parts + 1)]

        def bound(part: slice) -> None:
            _bound(lattice.levels[-1], lattice.bases[part], self._costs[part], lattice.reach, width,
                   lattice.gain, self._bounds[part])  # fmt: skip

        _each(bound, [slice(*edge) for edge in pairwise(edges)], self._threads)
        self._order = np.argsort(-self._bounds.ravel(), kind="stable")

    def best(self, floor: float = -math.inf, taken: Float = NOTHING_TAKEN) -> Found:
        """The best candidate above ``floor`` that is apart from those ``taken``."""
        seed = self._descended(self._order[:1], Found(score=floor), taken)
        across = self._bounds.shape[1]
        of_part = (self._order // (across * across)) % self._parts
        parts = [self._order[of_part == k] for k in range(self._parts)]
        found = _each(partial(self._descended, start=seed, taken=taken), parts, self._threads)
        best = seed
        for one in found:
            best = one if one.better_than(best) else best
        total = self._bounds.size + seed.evaluations + sum(one.evaluations for one in found)
        return replace(best, evaluations=total)

    def _descended(self, order: NDArray[np.int64], start: Found, taken: Float) -> Found:
        of, index = self.lattice, np.array([start.heading, start.row, start.column])
        score, evaluations = _descend(
            of.levels, of.bases, of.turns, self._costs, of.reach, of.pitch, of.precision, of.gain,
            taken, of.apart, self._bounds, order, start.score, index,
        )  # fmt: skip
        h, row, column = index.tolist()
        return Found(score=score, heading=h, row=row, column=column, evaluations=evaluations)


def _processors() -> int:
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def _each(work: Callable[[S], T], parts: Iterable[S], threads: int) -> list[T]:
    """``work`` done on each part, in order; the kernels release the interpreter's lock."""
    if threads == 1:
        return [work(part) for part in parts]
    with ThreadPoolExecutor(threads) as pool:  # made anew: one would not survive a fork
        return list(pool.map(work, parts))

# SPDX-License-Identifier: Apache-2.0
"""Lines of a picture one cell wide, and the polylines that they are."""

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from slam._jit import njit

Cell = tuple[int, int]
Chain = list[Cell]

SPUR_CELLS = 5  # a side branch that is shorter is the roughness of a wall
BEND_RAD = math.radians(40.0)  # two branches that meet straighter than this are one line
LOOK_CELLS = 8  # along a branch, where its direction is taken

# Around a cell, clockwise from the one above: row, column.
_AROUND = ((-1, 0), (-1, 1), (0, 1), (1, 1), (1, 0), (1, -1), (0, -1), (-1, -1))
_ROWS = np.array([d[0] for d in _AROUND])
_COLUMNS = np.array([d[1] for d in _AROUND])


@njit
def _thinned(mask: NDArray[np.uint8], rows: NDArray[np.int64], columns: NDArray[np.int64]) -> None:
    going = np.zeros(len(rows), dtype=np.bool_)
    changed = True
    while changed:
        changed = False
        for half in range(2):
            for k in range(len(rows)):
                i, j = rows[k], columns[k]
                going[k] = False
                if mask[i, j] == 0:
                    continue
                n, turns = 0, 0
                before = mask[i + _ROWS[7], j + _COLUMNS[7]]
                for d in range(8):
                    here = mask[i + _ROWS[d], j + _COLUMNS[d]]
                    n += here
                    turns += before == 0 and here == 1
                    before = here
                north, east = mask[i - 1, j], mask[i, j + 1]
                south, west = mask[i + 1, j], mask[i, j - 1]
                if half == 0:
                    open_side = north * east * south == 0 and east * south * west == 0
                else:
                    open_side = north * east * west == 0 and north * south * west == 0
                going[k] = 2 <= n <= 6 and turns == 1 and open_side
            for k in range(len(rows)):
                if going[k]:
                    mask[rows[k], columns[k]] = 0
                    changed = True


def thinned(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """The middle line of what is set, one cell wide (Zhang and Suen 1984)."""
    padded = np.pad(mask.astype(np.uint8), 1)
    rows, columns = np.nonzero(padded)
    _thinned(padded, rows, columns)
    return padded[1:-1, 1:-1].astype(bool)


def chains(skeleton: NDArray[np.bool_]) -> list[Chain]:
    """Its lines as (row, column) cells in order; branches that go straight on are joined."""
    near = _neighbours(skeleton)
    branches = [c for c in _branches(near) if not _is_spur(c, near)]
    return _joined(branches)


def _neighbours(skeleton: NDArray[np.bool_]) -> dict[Cell, list[Cell]]:
    """Next cells of each; none across a corner that a cell beside both already connects."""
    padded = np.pad(skeleton, 1)
    rows, columns = np.nonzero(skeleton)
    bits = [padded[rows + 1 + di, columns + 1 + dj].astype(int) << k
            for k, (di, dj) in enumerate(_AROUND)]  # fmt: skip
    sorts = np.sum(bits, axis=0).tolist()
    return {
        (i, j): [(i + di, j + dj) for di, dj in _NEXT[sort]]
        for i, j, sort in zip(rows.tolist(), columns.tolist(), sorts, strict=True)
    }


def _next(sort: int) -> list[Cell]:
    """Of a cell with those bits of ``_AROUND`` set."""
    there = [d for k, d in enumerate(_AROUND) if sort >> k & 1]
    found = [d for d in there if 0 in d]
    beside = set(found)
    corners = [d for d in there if 0 not in d]
    return found + [(i, j) for i, j in corners if not {(i, 0), (0, j)} & beside]


_NEXT = [_next(sort) for sort in range(256)]


def _branches(near: dict[Cell, list[Cell]]) -> Iterator[Chain]:
    """Lines between cells that have other than two neighbours, then closed lines."""
    done: set[frozenset[Cell]] = set()
    ends = [cell for cell, around in near.items() if len(around) != 2]
    for begin in (*ends, *near):
        if len(near[begin]) == 0:
            yield [begin]
        for first in near[begin]:
            if frozenset((begin, first)) in done:
                continue
            line = [begin, first]
            done.add(frozenset((begin, first)))
            while len(near[line[-1]]) == 2 and line[-1] != begin:
                a, b = near[line[-1]]
                line.append(b if a == line[-2] else a)
                done.add(frozenset(line[-2:]))
            yield line


def _is_spur(line: Chain, near: dict[Cell, list[Cell]]) -> bool:
    degrees = sorted((len(near[line[0]]), len(near[line[-1]])))
    return len(line) <= SPUR_CELLS and degrees[0] == 1 and degrees[1] > 2


def _heading(line: Chain, at_end: bool) -> float:
    """Direction out of the line at one of its ends, rad."""
    inner, outer = (
        (line[-min(LOOK_CELLS, len(line))], line[-1])
        if at_end
        else (line[min(LOOK_CELLS, len(line)) - 1], line[0])
    )
    return math.atan2(outer[0] - inner[0], outer[1] - inner[1])


def _joined(branches: list[Chain]) -> list[Chain]:
    """Branches put end to end where two of those that meet at a cell go straight on."""
    at: dict[Cell, list[tuple[int, bool]]] = {}
    for k, line in enumerate(branches):
        if line[0] != line[-1]:
            at.setdefault(line[0], []).append((k, False))
            at.setdefault(line[-1], []).append((k, True))
    partner = _straight_on(branches, at)
    used: set[int] = set()
    found = []
    for k in range(len(branches)):
        if k in used:
            continue
        first, seen = (k, False), {k}  # walk back to where the whole line begins
        while first in partner and partner[first][0] not in seen:
            j, at_end = partner[first]
            seen.add(j)
            first = (j, not at_end)
        whole: Chain = []
        step: tuple[int, bool] | None = first
        while step is not None and step[0] not in used:
            j, from_end = step
            used.add(j)
            piece = branches[j][::-1] if from_end else branches[j]
            whole += piece[1:] if whole else piece
            step = partner.get((j, not from_end))
        found.append(whole)
    return found


def _straight_on(
    branches: list[Chain], at: dict[Cell, list[tuple[int, bool]]]
) -> dict[tuple[int, bool], tuple[int, bool]]:
    """Which end of a branch goes on in which other: of those that meet, the straightest first."""
    partner: dict[tuple[int, bool], tuple[int, bool]] = {}
    for ends in at.values():
        pairs = []
        for m, one in enumerate(ends):
            for other in ends[m + 1 :]:
                out, back = (
                    _heading(branches[one[0]], one[1]),
                    _heading(branches[other[0]], other[1]),
                )
                bend = abs(math.remainder(out - back - math.pi, math.tau))
                if one[0] != other[0] and (bend < BEND_RAD or len(ends) == 2):
                    pairs.append((bend, one, other))
        for _, one, other in sorted(pairs):
            if one not in partner and other not in partner:
                partner[one], partner[other] = other, one
    return partner

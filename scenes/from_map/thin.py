# SPDX-License-Identifier: Apache-2.0
"""Lines of a picture one cell wide, and the polylines that they are."""

import math
from collections.abc import Iterator
from itertools import combinations

import cv2
import numpy as np
from numpy.typing import NDArray

Cell = tuple[int, int]
Chain = list[Cell]
End = tuple[int, bool]  # number of a branch, and whether it is its last cell
SPUR_CELLS = 5  # a side branch that is shorter is the roughness of a wall
BEND_RAD = math.radians(40.0)  # two branches that meet straighter than this are one line
LOOK_CELLS = 8  # along a branch, where its direction is taken

# Around a cell, clockwise from the one above: row, column. Its sort has a bit for each that is set.
_AROUND = ((-1, 0), (-1, 1), (0, 1), (1, 1), (1, 0), (1, -1), (0, -1), (-1, -1))
_BITS = np.zeros((3, 3), dtype=np.float32)
for _k, (_i, _j) in enumerate(_AROUND):
    _BITS[1 + _i, 1 + _j] = 1 << _k


def _sorts(mask: NDArray[np.uint8]) -> NDArray[np.uint8]:
    found = cv2.filter2D(mask, cv2.CV_32F, _BITS, borderType=cv2.BORDER_CONSTANT)
    return np.asarray(found, dtype=np.uint8)


def _stays(sort: int, half: int) -> bool:
    """Whether a cell stays in one of the two halves of a round (Zhang and Suen 1984)."""
    near = [sort >> k & 1 for k in range(8)]
    turns = sum(not a and b for a, b in zip(near, [*near[1:], near[0]], strict=True))
    north, east, south, west = map(bool, near[::2])
    open_side = not (east and south and (north or west))
    if half:
        open_side = not (north and west and (east or south))
    return not (2 <= sum(near) <= 6 and turns == 1 and open_side)


_STAY = [np.array([_stays(s, half) for s in range(256)], dtype=np.uint8) for half in (0, 1)]


def thinned(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """The middle line of what is set, one cell wide."""
    line, before = mask.astype(np.uint8), -1
    while (left := int(line.sum())) != before:
        before = left
        for stay in _STAY:
            line &= cv2.LUT(_sorts(line), stay)
    return line > 0


def chains(skeleton: NDArray[np.bool_]) -> list[Chain]:
    """Its lines as (row, column) cells in order; branches that go straight on are joined.

    No step leads across a corner that a cell beside both already connects.
    """
    rows, columns = np.nonzero(skeleton)
    sorts = _sorts(skeleton.astype(np.uint8))[rows, columns]
    near = {
        (i, j): [(i + di, j + dj) for di, dj in _NEXT[sort]]
        for i, j, sort in zip(rows.tolist(), columns.tolist(), sorts.tolist(), strict=True)
    }
    return _joined([line for line in _branches(near) if not _is_spur(line, near)])


def _is_spur(line: Chain, near: dict[Cell, list[Cell]]) -> bool:
    degrees = sorted((len(near[line[0]]), len(near[line[-1]])))
    return len(line) <= SPUR_CELLS and degrees[0] == 1 and degrees[1] > 2


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


def _heading(line: Chain, at_end: bool) -> float:
    """Direction out of the line at one of its ends, rad."""
    ahead = line if at_end else line[::-1]
    inner, outer = ahead[-min(LOOK_CELLS, len(line))], ahead[-1]
    return math.atan2(outer[0] - inner[0], outer[1] - inner[1])


def _joined(branches: list[Chain]) -> list[Chain]:
    """Branches put end to end where two of those that meet at a cell go straight on."""
    at: dict[Cell, list[End]] = {}
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
        step: End | None = first
        while step is not None and step[0] not in used:
            j, from_end = step
            used.add(j)
            piece = branches[j][::-1] if from_end else branches[j]
            whole += piece[1:] if whole else piece
            step = partner.get((j, not from_end))
        found.append(whole)
    return found


def _straight_on(branches: list[Chain], at: dict[Cell, list[End]]) -> dict[End, End]:
    """Which end of a branch goes on in which other: of those that meet, the straightest first."""
    partner: dict[End, End] = {}
    for ends in at.values():
        pairs = []
        for one, other in combinations(ends, 2):
            out, back = (_heading(branches[k], at_end) for k, at_end in (one, other))
            bend = abs(math.remainder(out - back - math.pi, math.tau))
            if one[0] != other[0] and (bend < BEND_RAD or len(ends) == 2):
                pairs.append((bend, one, other))
        for _, one, other in sorted(pairs):
            if one not in partner and other not in partner:
                partner[one], partner[other] = other, one
    return partner

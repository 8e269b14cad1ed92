# SPDX-License-Identifier: Apache-2.0
"""Kernels of the search of the whole map, which may stop after any node and go on later.

Blocks of offsets are bounded as in ``branch_and_bound``, but best first, and 8 x 8 at once. For
that the maxima over w x w neighbours are laid out so that offsets w cells apart lie side by side:
a plane (w, w, rows / w, columns / w) holds at [r % w, c % w, r // w, c // w] the largest of the
w x w values from (r, c) on.
"""

import math
from typing import NamedTuple

import numpy as np

from slam._jit import inner, njit
from slam.arrays import Bytes, Float, Int32, Ints, Words
from slam.tracker.matching.branch_and_bound import SPAN as SPAN
from slam.tracker.matching.branch_and_bound import open_block

LEAF = 3  # kinds of a node in the order in which they are opened; 0: 64 x 64 offsets, 1: 8 x 8
KINDS = 4
ROOM = SPAN * SPAN + 1  # nodes that one may bring into the heap
CURSOR, SIZE, TAKEN, BEST, OPENED = 0, 1, 2, 3, 4  # places in ``Queue.counts``


class Queue(NamedTuple):
    """What is still to be opened, and what was found.

    blocks   (b,) int64 nodes of coarsest blocks, (b,) int64 ``keys`` of theirs, rising
    heap     (m, 2) int64 key and node of the others
    taken    (most, 3) column, row, turn of the answers; ``scores`` (most,) sums of the field there
    counts   (5,) int64: blocks that were opened, size of the heap, answers, best sum seen, nodes
             opened

    A key is 4 (LARGE - sum) + kind: the best comes first, blocks before leaves. A node is
    (heading rows + row) columns + column, of offsets counted from the lowest.
    """

    blocks: Ints
    keys: Ints
    heap: Ints
    taken: Float
    scores: Ints
    counts: Ints


LARGE = 1 << 40  # above every sum
MORE, DONE, NEXT = 0, 1, 2


@njit
def flatten(
    bases: Int32, low: tuple[int, int], shape: tuple[int, int], width: int,
    out: Words
) -> None:  # fmt: skip
    """Places (headings, n) in a plane of ``width``, flat, of the points at the lowest offset.

    ``bases`` (headings, n, 2) columns and rows at offset (0, 0), ``low`` the lowest (column, row),
    ``shape`` (rows, columns) of one phase of the plane.
    """
    for h in range(out.shape[0]):
        for k in range(out.shape[1]):
            c, r = bases[h, k, 0] + low[0], bases[h, k, 1] + low[1]
            phase = r % width * width + c % width
            out[h, k] = np.uint64((phase * shape[0] + r // width) * shape[1] + c // width)


@njit
def bound_blocks(plane: Bytes, flat: Words, columns: int, out: Int32) -> None:
    """Bounds (headings, rows, columns) of the coarsest blocks; ``plane`` is theirs, flat.

    ``flat`` as ``flatten`` gives it; a phase of the plane has so many ``columns``.
    """
    for h in range(out.shape[0]):
        for a in range(out.shape[1]):
            into = out[h, a]
            into[:] = 0
            down = np.uint64(a * columns)
            for k in range(flat.shape[1]):
                at = flat[h, k] + down
                row = plane[at : at + np.uint64(len(into))]
                for b in range(len(into)):
                    into[b] += row[b]


@inner
def _push(heap: Ints, size: int, key: int, node: int) -> None:
    """Into a heap of ``size``, which has room."""
    at = size
    while at > 0:
        up = (at - 1) >> 1
        if heap[up, 0] < key or (heap[up, 0] == key and heap[up, 1] <= node):
            break
        heap[at, 0], heap[at, 1] = heap[up, 0], heap[up, 1]
        at = up
    heap[at, 0], heap[at, 1] = key, node


@inner
def _drop(heap: Ints, size: int) -> None:
    """The first of a heap of ``size``."""
    last = size - 1
    key, node = heap[last, 0], heap[last, 1]
    at = 0
    while True:
        child = 2 * at + 1
        if child >= last:
            break
        other = child + 1
        if other < last and (
            heap[other, 0] < heap[child, 0]
            or (heap[other, 0] == heap[child, 0] and heap[other, 1] < heap[child, 1])
        ):
            child = other
        if key < heap[child, 0] or (key == heap[child, 0] and node <= heap[child, 1]):
            break
        heap[at, 0], heap[at, 1] = heap[child, 0], heap[child, 1]
        at = child
    heap[at, 0], heap[at, 1] = key, node


@inner
def is_apart(taken: Float, apart: tuple[float, float], column: int, row: int, turn: float) -> bool:
    """Whether a candidate differs from all that were taken, (n, 3) by column, row and turn."""
    for k in range(len(taken)):
        off = turn - taken[k, 2]
        off -= math.tau * math.floor(off / math.tau + 0.5)
        di, dj = column - taken[k, 0], row - taken[k, 1]
        if abs(off) < apart[1] and di * di + dj * dj < apart[0] * apart[0]:
            return False
    return True


@njit
def open_nodes(  # noqa: C901, PLR0912, PLR0913, PLR0915 (kernel)
    planes: tuple[Bytes, Bytes],
    flats: tuple[Words, Words],
    widths: tuple[int, int],
    turns: Float,
    low: tuple[int, int],
    across: tuple[int, int],
    queue: Queue,
    apart: tuple[float, float],
    worth: float,
    least: int,
    nodes: int,
) -> int:
    """Open up to ``nodes`` nodes, best first: ``MORE`` are left, or ``DONE``, or ``NEXT``.

    ``NEXT`` says that blocks whose bound is ``least``, or less, are wanted too.

    ``planes`` of 1 and of 8 cells, flat, with columns of a phase (``widths``); ``flats`` as
    ``flatten`` gives them; ``low`` the lowest offset (column, row), ``across`` how many there are.
    Answers differ by ``apart`` cells, or so many rad; none has less than ``worth`` of the best sum.
    Stops early, with the answer ``MORE``, where the heap may run out of room.
    """
    counts, heap = queue.counts, queue.heap
    columns, rows = across
    sums = np.empty((SPAN, SPAN), np.int64)
    for _ in range(nodes):
        if counts[TAKEN] == len(queue.taken):
            return DONE
        if counts[SIZE] + ROOM > len(heap):
            return MORE
        is_block = counts[CURSOR] < len(queue.blocks) and (
            counts[SIZE] == 0 or queue.keys[counts[CURSOR]] <= heap[0, 0]
        )
        if is_block:
            key, node = queue.keys[counts[CURSOR]], queue.blocks[counts[CURSOR]]
        elif counts[SIZE] > 0:
            key, node = heap[0, 0], heap[0, 1]
        else:
            return DONE if least <= worth * counts[BEST] else NEXT
        score, kind = LARGE - key // KINDS, key % KINDS
        if score <= worth * counts[BEST]:
            return DONE if least <= worth * counts[BEST] else NEXT
        if score <= least:
            return NEXT
        if is_block:
            counts[CURSOR] += 1
        else:
            _drop(heap, counts[SIZE])
            counts[SIZE] -= 1
        column, rest = node % columns, node // columns
        row, h = rest % rows, rest // rows
        if kind == LEAF:
            i, j = column + low[0], row + low[1]
            if is_apart(queue.taken[: counts[TAKEN]], apart, i, j, turns[h]):
                queue.taken[counts[TAKEN], 0] = i
                queue.taken[counts[TAKEN], 1] = j
                queue.taken[counts[TAKEN], 2] = turns[h]
                queue.scores[counts[TAKEN]] = score
                counts[TAKEN] += 1
            row, column = row - row % SPAN, column - column % SPAN  # what else its block has
            kind = 1
        counts[OPENED] += 1
        if kind == 1:
            open_block(planes[0], flats[0][h], row * widths[0] + column, widths[0], sums)
        else:
            first = row // SPAN * widths[1] + column // SPAN
            open_block(planes[1], flats[1][h], first, widths[1], sums)
        width = 1 if kind == 1 else SPAN
        best, best_node = -1, -1
        for a in range(SPAN):
            for b in range(SPAN):
                r, c, found = row + a * width, column + b * width, sums[a, b]
                if r >= rows or c >= columns or found <= max(worth * counts[BEST], 0.0):
                    continue
                inside = (h * rows + r) * columns + c
                if kind == 0:
                    _push(heap, counts[SIZE], KINDS * (LARGE - found) + 1, inside)
                    counts[SIZE] += 1
                elif found > best and is_apart(
                    queue.taken[: counts[TAKEN]], apart, c + low[0], r + low[1], turns[h]
                ):
                    best, best_node = found, inside
        if best > 0:
            counts[BEST] = max(counts[BEST], best)
            _push(heap, counts[SIZE], KINDS * (LARGE - best) + LEAF, best_node)
            counts[SIZE] += 1
    return MORE

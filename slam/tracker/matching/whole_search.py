# SPDX-License-Identifier: Apache-2.0
"""Search of the whole map over several scans, for the places from which one of them was seen.

The answers are the same, in the same order, however the work is divided.
"""

import math
from typing import Any

import numpy as np

from slam.arrays import Float, Ints, Words
from slam.tracker.matching import planes
from slam.tracker.matching.budget import Budget
from slam.tracker.matching.coarse_map import CoarseMap
from slam.tracker.matching.config import GlobalConfig
from slam.tracker.matching.local_search import heading_step, place
from slam.tracker.matching.planes import LARGE, SPAN, Queue, bound_blocks, flatten, open_nodes

FIRST_ROOM = 1 << 22  # nodes of the heap: 64 MiB, no memory until used; growing copies all of it
BINS = 1 << 12  # of bounds
BATCH = 1 << 13  # blocks that are queued at a time, at least
SORTED = 50  # times the price of a block that is passed over: one that is queued


class WholeSearch:
    """Branch and bound over the whole map, as far as each budget goes.

    done         whether all answers are found
    evaluations  candidates and blocks that were scored
    """

    def __init__(
        self,
        coarse: CoarseMap,
        points_robot: Float,
        most: int,
        config: GlobalConfig,
        about: tuple[Float, float, float] | None = None,
    ) -> None:
        """``points_robot`` (n, 2) of the scan; up to ``most`` answers.

        ``about`` limits them to a pose, so many m and so many rad around it, where the coarse map
        has room.
        """
        self._coarse, self._config, self._most, self._about = coarse, config, most, about
        near = points_robot[(points_robot * points_robot).sum(axis=1) < config.far_m**2]
        self._points = np.ascontiguousarray(near[:: max(1, math.ceil(len(near) / config.points))])
        self.done = len(near) == 0 or coarse.empty
        self.evaluations = 0
        self._given = 0  # answers that were handed out
        self._bounded = 0  # headings whose coarsest blocks are bounded
        self._queue: Queue | None = None
        self._state, self._least = planes.MORE, 0  # of the queue; blocks with more are in it
        self._counts, self._bin = np.zeros(BINS, np.int64), BINS  # blocks by bound; those queued
        self._flats: list[Words] = []  # of each plane

    def __getstate__(self) -> dict[str, Any]:
        """A copy without room that is not used."""
        state = vars(self).copy()
        if self._queue is not None:
            size = int(self._queue.counts[planes.SIZE])
            state["_queue"] = self._queue._replace(heap=self._queue.heap[:size])
        return state

    def advance(self, budget: Budget) -> list[Float]:
        """Search as far as the budget goes; the answers T_map_robot found thereby, best first."""
        if not self.done and not self._coarse.ready:
            self._coarse.advance(budget)
        if not self.done and self._coarse.ready and budget.left_ns > 0.0:
            if not self._flats:
                self._begin(budget)
            if self._bounded < len(self._turns):
                self._bound(budget)
            if self._bounded == len(self._turns):
                self._open(budget)
        return self._found()

    def _begin(self, budget: Budget) -> None:
        """Lay out the candidates."""
        coarse = self._coarse
        step = heading_step(self._points, coarse.pitch, coarse.pitch, self._config)
        count = math.ceil(math.tau / step)
        self._turns = np.arange(count, dtype=np.float64) * (math.tau / count)  # all round
        self._reach = tuple(math.ceil(0.5 * n) for n in coarse.shape)  # rows, columns
        i0, j0 = (c + coarse.margin for c in coarse.corner)
        rows, columns = coarse.shape
        self._middle = np.array([i0 + 0.5 * columns, j0 + 0.5 * rows, 0.0]) * coarse.pitch
        if self._about is not None:
            self._middle, reach_m, turn_rad = self._about
            step = math.tau / count
            half, reach = math.ceil(turn_rad / step), math.ceil(reach_m / coarse.pitch)
            self._turns = step * np.arange(-half, half + 1, dtype=np.float64)
            self._reach = reach, reach
        bases = np.empty((len(self._turns), len(self._points), 2), np.int32)
        place(self._points, self._middle, self._turns, coarse.pitch, *coarse.corner, bases)
        low = -self._reach[1], -self._reach[0]
        for plane in coarse.planes[: coarse.widest + 1]:
            flat = np.empty(bases.shape[:2], np.uint64)
            flatten(bases, low, plane.shape[2:], plane.shape[0], flat)
            self._flats.append(flat)
        width = coarse.planes[coarse.widest].shape[0]
        self._across = tuple(2 * reach // width + 1 for reach in self._reach)
        self._bounds = np.empty((len(self._turns), *self._across), np.int32)
        self._shift = max(0, (255 * len(self._points)).bit_length() - BINS.bit_length() + 1)
        budget.spend(budget.prices.place_ns * bases.size)

    def _bound(self, budget: Budget) -> None:
        """Bound the coarsest blocks, heading by heading, and count how many have which bound."""
        blocks = self._across[0] * self._across[1]
        price = budget.prices.bound_ns * blocks * len(self._points)
        part = slice(self._bounded, self._bounded + budget.times(price))
        plane, flat = self._coarse.planes[self._coarse.widest], self._flats[-1][part]
        bounds = self._bounds[part]
        bound_blocks(plane.ravel(), flat, plane.shape[3], bounds)
        self._counts += np.bincount(bounds.ravel() >> self._shift, minlength=BINS)
        self._bounded += len(flat)
        self.evaluations += len(flat) * blocks
        budget.spend(len(flat) * price)

    def _more_blocks(self, budget: Budget) -> None:
        """Queue the best of the blocks that are left, some thousands of them."""
        high, queued = self._bin, 0
        while self._bin > 0 and queued < BATCH:
            self._bin -= 1
            queued += int(self._counts[self._bin])
        bounds = self._bounds.ravel()
        self._least = max((self._bin << self._shift) - 1, 0)
        wanted = (bounds > self._least) & (bounds < high << self._shift)
        nodes, keys = self._nodes(np.flatnonzero(wanted))
        counts = np.zeros(5, np.int64) if self._queue is None else self._queue.counts
        counts[planes.CURSOR] = 0
        queue = self._queue or Queue(
            blocks=nodes, keys=keys, heap=np.empty((FIRST_ROOM, 2), np.int64),
            taken=np.zeros((self._most, 3)), scores=np.zeros(self._most, np.int64), counts=counts,
        )  # fmt: skip
        self._queue = queue._replace(blocks=nodes, keys=keys)
        budget.spend(budget.prices.order_ns * (bounds.size + SORTED * len(nodes)))

    def _nodes(self, flat: Ints) -> tuple[Ints, Ints]:
        """Nodes and keys of these of the coarsest blocks, by falling bound."""
        width = self._coarse.planes[self._coarse.widest].shape[0]
        (rows, columns), (_, down, along) = self._sizes(), self._bounds.shape
        keys = planes.KINDS * (LARGE - self._bounds.ravel()[flat].astype(np.int64))
        order = np.argsort(keys, kind="stable")
        flat = flat[order]
        h, a, b = flat // (down * along), flat // along % down, flat % along
        kind = 2 - self._coarse.widest
        return (h * rows + a * width) * columns + b * width, keys[order] + kind

    def _sizes(self) -> tuple[int, int]:
        """Offsets: rows, columns."""
        return 2 * self._reach[0] + 1, 2 * self._reach[1] + 1

    def _open(self, budget: Budget) -> None:
        """Open nodes, best first, as many as the budget allows."""
        price = budget.prices.node_ns * len(self._points)
        while not self.done and budget.left_ns > 0.0:
            queue = self._queue
            if queue is None or self._state == planes.NEXT:
                self._more_blocks(budget)
                self._state = planes.MORE
                continue
            before = int(queue.counts[planes.OPENED])
            self._state = self._opened(queue, budget.times(price))
            self.done = self._state == planes.DONE
            opened = int(queue.counts[planes.OPENED]) - before
            self.evaluations += SPAN * SPAN * opened
            budget.spend(max(opened, 1) * price)
            if self._state == planes.MORE and queue.counts[planes.SIZE] + planes.ROOM > len(
                queue.heap
            ):
                heap = np.empty((max(2 * len(queue.heap), FIRST_ROOM), 2), np.int64)
                heap[: len(queue.heap)] = queue.heap  # the rest is no memory until it is used
                self._queue = queue._replace(heap=heap)

    def _opened(self, queue: Queue, nodes: int) -> int:
        config, coarse = self._config, self._coarse
        rows, columns = self._sizes()
        fine, eights = coarse.planes[:2]
        return open_nodes(
            (fine.ravel(), eights.ravel()), (self._flats[0], self._flats[1]),
            (fine.shape[3], eights.shape[3]), self._turns, (-self._reach[1], -self._reach[0]),
            (columns, rows), queue, (config.apart_m / coarse.pitch, config.apart_rad),
            config.worth, self._least, nodes,
        )  # fmt: skip

    def _found(self) -> list[Float]:
        """Answers that were not handed out yet."""
        if self._queue is None:
            return []
        first, self._given = self._given, int(self._queue.counts[planes.TAKEN])
        scale = np.array([self._coarse.pitch, self._coarse.pitch, 1.0])
        return [self._middle + offset * scale for offset in self._queue.taken[first : self._given]]

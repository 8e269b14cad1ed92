# SPDX-License-Identifier: Apache-2.0
"""Key frames of one place become one, so that their number follows the area, not the way.

A key frame that loops have tied to the graph, near an older one, is left out, and the older one
stands for it (Johannsson, Kaess, Fallon, Leonard 2013: reduced pose graph). Steps to it and from it
lead to the older one instead, so that what was joined stays joined. Its closures go: the older one
has its own.
"""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import TypeVar

import numpy as np

from slam import se2
from slam.arrays import Bools, Float, Ints
from slam.frontend.odometry_prior import inverted, turned
from slam.posegraph import Edge
from slam.tracker.tracking.config import LoopsConfig

T = TypeVar("T")
MOST_KEYS = 600  # key frames, from so many on they are merged; the logs have up to 522 (Intel)
LEFT = 0.75  # share of the key frames that may be left; set by hand
SCALES = (1.0, 1.5, 2.0, 3.0)  # times key_m: the first that leaves so few; set by hand


class Merge:
    """The key frames that are left, and their new numbers.

    left  (m,) their old numbers
    into  (n,) new number of the one that stands for each
    """

    def __init__(self, stand: Ints) -> None:
        """``stand`` (n,): the key frame that stands for each, itself or an older one."""
        self.left = np.flatnonzero(stand == np.arange(len(stand)))
        self.into = np.searchsorted(self.left, stand)

    @classmethod
    def of(
        cls,
        poses: Float,
        written: Bools,
        tied: Iterable[int],
        searched: int,
        config: LoopsConfig,
    ) -> "Merge":
        """Key frames near one that is ``tied`` go where an older one is near; not the newest.

        poses    (n, 3) by the graph; so many of them were ``searched`` for closures
        written  (n,) whether the map took them in: none else stands for others
        """
        may_go = np.zeros(min(searched, len(poses) - config.recent - 2 * config.submap), np.bool_)
        for k in tied:
            may_go[max(k - config.every, 1) : k + config.every + 1] = True
        for scale in SCALES:
            near = scale * config.key_m, config.key_rad
            merge = cls(_standing(poses, written, np.flatnonzero(may_go).tolist(), *near))
            if len(merge.left) <= LEFT * MOST_KEYS:
                break
        return merge

    def number(self, k: int) -> int | None:
        """Of key frame ``k`` from now on; None: it is left out. Those that follow move up."""
        if k >= len(self.into):
            return k - len(self.into) + len(self.left)
        new = int(self.into[k])
        return new if self.left[new] == k else None

    def pair(self, pair: tuple[int, int]) -> tuple[int, int] | None:
        """The same of two; None: one of them is left out."""
        a, b = self.number(pair[0]), self.number(pair[1])
        return None if a is None or b is None else (a, b)

    def those(self, edges: Iterable[Edge]) -> list[Edge]:
        """The edges whose ends are both left."""
        pairs = ((edge, self.pair((edge.a, edge.b))) for edge in edges)
        return [replace(edge, a=pair[0], b=pair[1]) for edge, pair in pairs if pair]

    def rows(self, values: Sequence[T]) -> list[T]:
        """One for each key frame that is left, and for those that follow."""
        return [values[k] for k in self.left.tolist()] + list(values[len(self.into) :])

    def joined(self, edges: Iterable[Edge], graph: Float, loose: Float) -> list[Edge]:
        """Edges, between those that stand for their ends; of new ones, one a pair.

        New ones are as long as in the ``graph`` (n, 3), and looser by (3, 3) for each new end.
        """
        found: dict[tuple[int, int], Edge] = {}
        for edge in edges:
            a, b = sorted((int(self.into[edge.a]), int(self.into[edge.b])))
            if a == b:
                continue
            first, last = self.left[a], self.left[b]
            new = int(first not in (edge.a, edge.b)) + int(last not in (edge.a, edge.b))
            if new == 0:
                found[a, b] = replace(edge, a=a, b=b)
            elif (a, b) not in found:
                turn = float(graph[edge.a, 2] - graph[first, 2])
                covariance = turned(inverted(edge.information), turn) + new * loose
                T_a_b = se2.between(graph[first], graph[last])
                found[a, b] = replace(edge, a=a, b=b, T_a_b=T_a_b, information=inverted(covariance))
        return list(found.values())


def _standing(
    poses: Float, written: Bools, may_go: list[int], near_m: float, near_rad: float
) -> Ints:
    """(n,) the key frame that stands for each of ``poses`` (n, 3): the nearest older one."""
    stand, left = np.arange(len(poses)), written.copy()
    for k in may_go:
        off = poses[:k] - poses[k]
        squares = off[:, 0] ** 2 + off[:, 1] ** 2
        near = left[:k] & (squares < near_m**2) & (np.abs(se2.wrap_array(off[:, 2])) < near_rad)
        if near.any():
            stand[k], left[k] = np.argmin(np.where(near, squares, np.inf)), False
    return stand

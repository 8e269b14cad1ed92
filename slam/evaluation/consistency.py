# SPDX-License-Identifier: Apache-2.0
"""How well a run agrees with itself: for logs of which nobody knows the truth.

Wrong poses blur the map, and lay the walls of a place beside those of an earlier visit. Neither
number sees an error that is the same everywhere, such as a wrong scale, or a loop never driven.
"""

import math
from dataclasses import asdict, dataclass

import numpy as np
from scipy.spatial import cKDTree

from slam import se2
from slam.frames import Float, Frame
from slam.scan_points import deskewed

KEY_M, KEY_RAD = 0.3, 0.3  # between two scans that are kept
MOST_KEYS = 3000  # beyond, one in two goes, and so on: 15 MB
POINTS = 240  # of a scan
NEAR_M, NEAR_RAD = 1.0, 1.0  # two scans from there show the same things
LATER_M = 10.0  # driven between them: a revisit
MOST_PAIRS = 150
SEEN_IN_BOTH = 0.7  # share of the points, those nearest to the other scan's: the rest moved, or hid
CELL_M = 0.1  # of the map whose sharpness is judged
SEED = 20070411  # of the shuffled poses


@dataclass(frozen=True, kw_only=True)
class Consistency:
    """What a run says of itself.

    sharper_nats   entropy of where the end points lie, less than with shuffled poses
    revisits       pairs of scans from one place, ``LATER_M`` and more apart on the way
    apart_cm       median over them: how far the points of the one lie from the other's; None
                   without a revisit
    neighbours_cm  the same of scans that follow each other: what the scanner and its beams leave
    """

    sharper_nats: float
    revisits: int
    apart_cm: float | None
    neighbours_cm: float | None

    @property
    def excess_cm(self) -> float | None:
        """What revisits are apart beyond neighbours, in squares; None without a revisit."""
        if self.apart_cm is None or self.neighbours_cm is None:
            return None
        return math.sqrt(max(self.apart_cm**2 - self.neighbours_cm**2, 0.0))

    def block(self) -> dict[str, float | int | None]:
        """For ``results.json``."""
        values = asdict(self) | {"excess_cm": self.excess_cm}
        return {k: v if v is None or k == "revisits" else round(v, 3) for k, v in values.items()}


class KeptScans:
    """Scans of a run, some way apart, to be laid on each other by poses that come later.

    Of several scanners those of the first: what two see of one place is not the same.
    """

    def __init__(self) -> None:
        self._frames = 0
        self._step = 1
        self._last: Float | None = None
        self._mount: tuple[float, ...] | None = None
        self._at: list[int] = []
        self._points: list[Float] = []

    def note(self, frame: Frame, pose: Float) -> None:
        """The next frame, and where the robot is about, (3,) in any frame of reference."""
        index, self._frames = self._frames, self._frames + 1
        if frame.scan is None or not frame.scan.valid.any():
            return
        mount = self._mount = self._mount or frame.scan.spec.mount
        if frame.scan.spec.mount != mount:
            return
        if self._last is not None:
            step = se2.between(self._last, pose)
            if math.hypot(step[0], step[1]) < KEY_M * self._step and (
                abs(step[2]) < KEY_RAD * self._step
            ):
                return
        points = deskewed(frame)
        self._last = pose
        self._at.append(index)
        self._points.append(points[:: max(1, -(-len(points) // POINTS))])
        if len(self._at) > MOST_KEYS:
            self._at, self._points, self._step = self._at[::2], self._points[::2], 2 * self._step

    def judged(self, poses: Float) -> Consistency | None:
        """By poses (n, 3) of all frames; None for fewer than two scans."""
        if len(self._at) < 2 or len(poses) <= self._at[-1]:
            return None
        keys = np.asarray(poses)[self._at]
        order = np.random.default_rng(SEED).permutation(len(keys))
        pairs = _revisits(keys)
        following = [(k, k + 1) for k in range(len(keys) - 1) if _near(keys[k], keys[k + 1])]
        return Consistency(
            sharper_nats=self._entropy(keys[order]) - self._entropy(keys),
            revisits=len(pairs),
            apart_cm=self._apart_cm(keys, pairs),
            neighbours_cm=self._apart_cm(keys, following),
        )

    def _entropy(self, keys: Float) -> float:
        """Nats, of the cells in which the points lie."""
        placed = [se2.transform(T, p) for T, p in zip(keys, self._points, strict=True)]
        cells = np.floor(np.vstack(placed) / CELL_M).astype(np.int64)
        _, counts = np.unique(cells, axis=0, return_counts=True)
        shares = counts / counts.sum()
        return float(-(shares * np.log(shares)).sum())

    def _apart_cm(self, keys: Float, pairs: list[tuple[int, int]]) -> float | None:
        """Median over some of the pairs."""
        found = []
        for a, b in pairs[:: max(1, -(-len(pairs) // MOST_PAIRS))]:
            here = se2.transform(se2.between(keys[a], keys[b]), self._points[b])
            apart = np.sort(cKDTree(self._points[a]).query(here)[0])
            apart = apart[: max(1, round(SEEN_IN_BOTH * len(apart)))]
            found.append(100.0 * math.sqrt(float((apart * apart).mean())))
        return float(np.median(found)) if found else None


def _near(one: Float, other: Float) -> bool:
    off = se2.between(one, other)
    return math.hypot(off[0], off[1]) < NEAR_M and abs(float(off[2])) < NEAR_RAD


def _revisits(keys: Float) -> list[tuple[int, int]]:
    """Each key pose with the nearest one of an earlier visit."""
    way = np.concatenate([[0.0], np.hypot(*np.diff(keys[:, :2], axis=0).T).cumsum()])
    tree, pairs = cKDTree(keys[:, :2]), []
    for b in range(len(keys)):
        near = [a for a in tree.query_ball_point(keys[b, :2], NEAR_M) if way[b] - way[a] > LATER_M]
        near = [a for a in near if _near(keys[a], keys[b])]
        if near:
            off = np.hypot(*(keys[near, :2] - keys[b, :2]).T)
            pairs.append((near[int(off.argmin())], b))
    return pairs

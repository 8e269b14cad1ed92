# SPDX-License-Identifier: Apache-2.0
"""Where there is room for a disc: static boxes, discs already placed, doorways to keep clear."""

import math
from collections.abc import Sequence

import numpy as np

from slam._jit import njit
from slam.frames import Float

Rect = tuple[float, float, float, float]

MAX_BATCHES = 200
BATCH = 32


@njit
def gap_to_boxes(points: Float, boxes: Float) -> Float:
    """(n,) m from each point (n, 2) to the nearest box (m, 5); 0 inside, inf without boxes."""
    gaps = np.full(len(points), np.inf)
    for k in range(len(boxes)):
        cos, sin = math.cos(boxes[k, 4]), math.sin(boxes[k, 4])
        for i in range(len(points)):
            dx, dy = points[i, 0] - boxes[k, 0], points[i, 1] - boxes[k, 1]
            out_x = max(abs(dx * cos + dy * sin) - boxes[k, 2], 0.0)
            out_y = max(abs(dy * cos - dx * sin) - boxes[k, 3], 0.0)
            gaps[i] = min(gaps[i], math.sqrt(out_x * out_x + out_y * out_y))
    return gaps


class Floor:
    """Free floor inside ``rects``, shrinking as things are placed."""

    def __init__(self, rects: Sequence[Rect], boxes: Float) -> None:
        self.rects = tuple(rects)
        self._areas = np.cumsum([(r[2] - r[0]) * (r[3] - r[1]) for r in self.rects])
        self._boxes = np.array(boxes, order="C")  # of one type for the kernel, writable
        self._discs = np.empty((0, 3))

    def block(self, x: float, y: float, radius: float) -> None:
        """Nothing may be placed over this disc any more."""
        self._discs = np.vstack([self._discs, [x, y, radius]])

    def clearance(self, points: Float) -> Float:
        """(n,) m from each point (n, 2) to the nearest thing, negative inside a disc."""
        gaps = gap_to_boxes(points, self._boxes)
        if len(self._discs):
            dx = points[:, None, 0] - self._discs[None, :, 0]
            dy = points[:, None, 1] - self._discs[None, :, 1]
            discs = (np.sqrt(dx * dx + dy * dy) - self._discs[None, :, 2]).min(axis=1)
            gaps = np.minimum(gaps, discs)
        return gaps

    def fits(self, x: float, y: float, radius: float) -> bool:
        """Whether a disc has room here."""
        return bool(self.clearance(np.array([[x, y]]))[0] >= radius)

    def find(self, rng: np.random.Generator, radius: float) -> tuple[float, float] | None:
        """A random free place for a disc, evenly over the floor; None when none is found."""
        for _ in range(MAX_BATCHES):
            draws = rng.random((BATCH, 3))
            which = np.searchsorted(self._areas, draws[:, 0] * self._areas[-1], side="right")
            low = np.array([self.rects[i][:2] for i in which])
            high = np.array([self.rects[i][2:] for i in which])
            points = low + draws[:, 1:] * (high - low)
            free = np.flatnonzero(self.clearance(points) >= radius)
            if len(free):
                x, y = points[free[0]].tolist()
                return x, y
        return None

# SPDX-License-Identifier: Apache-2.0
"""Does what a session saw fit the days before? What always stands, stands there again.

Of the places where something stood in nearly every session before and that this one looked at, the
share that it found empty; of the places where it found something and the sessions before had a say,
the share that was never taken. Chairs and doors make few of both, a wrong place makes many.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from slam import se2
from slam.days.config import AgreementConfig, DaysConfig
from slam.days.evidence import SessionGrid, Snapshot
from slam.days.history import History, dense
from slam.frames import Float, Frame


@dataclass(frozen=True, kw_only=True)
class Agreement:
    """Counts of places.

    known, missing  that always stood and were looked at; of these those found empty
    taken, new      where something was found, of those with a say; of these those always empty
    """

    known: int = 0
    missing: int = 0
    taken: int = 0
    new: int = 0

    @property
    def disagrees(self) -> float:
        """Share of both that do not agree, in [0, 1]; 0 where nothing can be said."""
        return (self.missing + self.new) / max(self.known + self.taken, 1)


class Past:
    """The sessions of a history as one image of what always stands and what never does."""

    def __init__(self, history: History, config: AgreementConfig | None = None) -> None:
        self.config = config or DaysConfig().agreement
        self.cell_m = history.cell_m
        cells, values = history.table()
        self._low, self._standing = np.zeros(2, np.int64), np.full((0, 0), np.nan, np.float32)
        if len(cells):
            low, (image,) = dense(cells, np.nanmean(values, axis=0))
            self._low = low - self.config.slack
            self._standing = np.pad(image, self.config.slack, constant_values=np.nan)
        self._near = _highest_near(self._standing, self.config.slack)

    @property
    def known(self) -> bool:
        """Whether there is anything to agree with."""
        return bool((np.nan_to_num(self._standing) >= self.config.always).any())

    def agreement(self, snapshot: Snapshot) -> Agreement:
        """Of what a session saw; on the same places."""
        config, standing = self.config, self._standing
        inside = np.all(
            (snapshot.cells >= self._low) & (snapshot.cells < self._low + standing.shape[::-1]),
            axis=1,
        )
        at = snapshot.cells[inside] - self._low
        now = np.full(standing.shape, np.nan, np.float32)
        now[at[:, 1], at[:, 0]] = snapshot.standing[inside]
        near = _highest_near(now, config.slack)
        with np.errstate(invalid="ignore"):
            known = (standing >= config.always) & ~np.isnan(now)
            taken = (now >= config.stands) & ~np.isnan(standing)
            return Agreement(
                known=int(known.sum()),
                missing=int((known & (near < config.empty)).sum()),
                taken=int(taken.sum()),
                new=int((taken & (self._near < config.empty)).sum()),
            )


def _highest_near(image: NDArray[np.float32], slack: int) -> NDArray[np.float32]:
    """The largest share within ``slack`` places along both axes, 0 where nothing is known."""
    if not image.size:
        return image
    side = 2 * slack + 1
    return np.asarray(cv2.dilate(np.nan_to_num(image), np.ones((side, side), np.uint8)))


class Trial:
    """A place where the session may have begun, and what it saw as seen from there."""

    def __init__(self, past: Past, T_map_own: Float) -> None:
        every = replace(DaysConfig().evidence, cell_m=past.cell_m, least_looks=1, every_s=0.0)
        self._past, self._T_map_own = past, T_map_own
        self._grid, self._taken = SessionGrid(every), 0
        self._same_rad = past.config.slack * past.cell_m / every.range_m

    def is_at(self, T_map_own: Float) -> bool:
        """Whether that place is the same, as far as the slack of the comparison goes."""
        x, y, turn = se2.between(self._T_map_own, T_map_own).tolist()
        return bool(math.hypot(x, y) <= self._past.cell_m and abs(turn) <= self._same_rad)

    def agreement(self, seen: Sequence[tuple[Frame, Float]]) -> Agreement:
        """Of scans and poses in the session's own frame; only those that were added are new."""
        for frame, pose in seen[self._taken :]:
            self._grid.add(frame, se2.compose(self._T_map_own, pose))
        self._taken = len(seen)
        return self._past.agreement(self._grid.snapshot(0.0))

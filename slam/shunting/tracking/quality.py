# SPDX-License-Identifier: Apache-2.0
"""How well the map usually explains what is seen, and when it denies a frame.

A robot that was carried away, or a map that is wrong, shows as a match far below the usual and a
map in view that is contradicted. Then nothing is written until it is clear where the robot is.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from statistics import median

from slam import se2
from slam.frames import Float

LOST_AFTER, PATIENCE = 3, 30  # doubtful frames in a row: then lost; then the map is written anew
WORTH_SEARCHING = 0.6  # usual support by the map from which on a lost robot searches it,
GROWN_S, GROWN_SCANS = 10.0, 10  # once the map has been tracked on this long
KNOWN = 0.5  # of that time: from then on the map may be frozen
SUSPICIOUS, DENIED, STILL = 0.70, 0.30, 0.20  # of the usual match; share of the map in view
# contradicted that raises doubt, and that keeps it up
SUDDEN, NEAR_M, NEAR_RAD = 0.3, 0.5, 0.5  # of the usual match; so little all at once, within such
# a step, is no new place but a robot carried to where what is in view hides the map


class Doubt:
    """What frames so far were like, and whether the next one fits.

    freeze_below  share of the usual match, see ``ShuntingConfig``; 0: never in doubt
    matches       latest matched fractions; ``supports`` the same times the share of map confirmed
    tracked_s     s of tracking on this map, in ``tracked`` scans
    scans         doubtful frames in a row
    """

    def __init__(self, freeze_below: float) -> None:
        self.freeze_below = freeze_below
        self.matches: deque[float] = deque(maxlen=50)
        self.supports: deque[float] = deque(maxlen=50)
        self.tracked_s, self.tracked, self.scans = 0.0, 0, 0

    def resume(
        self, matches: Sequence[float], supports: Sequence[float], tracked_s: float, tracked: int
    ) -> None:
        """Go on with what a saved map had."""
        self.matches.extend(matches)
        self.supports.extend(supports)
        self.tracked_s, self.tracked = tracked_s, tracked

    def usual_match(self) -> float:
        """Median matched fraction."""
        return median(self.matches) if self.matches else 1.0

    def usual_support(self) -> float:
        """Median of it times the share of the map in view that is confirmed."""
        return median(self.supports) if self.supports else 1.0

    def is_worth_searching(self, share: float = 1.0) -> bool:
        """Grown (or to that share), and explains what is seen: else it cannot deny it either."""
        grown = self.tracked_s >= share * GROWN_S and self.tracked >= GROWN_SCANS
        return grown and self.usual_support() >= WORTH_SEARCHING

    @property
    def suspicious(self) -> bool:
        """Only a map that for long explained what is seen can tell where the robot is."""
        return self.freeze_below > 0.0 and self.is_worth_searching()

    def arises(self, matched: float) -> bool:
        """Whether a match is so poor that the map in view is to be asked."""
        return self._share(matched) < max(self.freeze_below, SUSPICIOUS if self.suspicious else 0.0)

    def _share(self, matched: float) -> float:
        return matched / max(self.usual_match(), 1e-9)

    def denied(self, matched: float, confirmed: float, contradicted: float, motion: Float) -> bool:
        """Whether what the frame says of the map in view, or a sudden change, denies the match.

        ``motion`` (x m, y m, theta rad) since the frame before.
        """
        share, suspicious = self._share(matched), self.suspicious
        doubtful = self.is_worth_searching(KNOWN) and contradicted > confirmed
        doubtful &= share < self.freeze_below
        denied = STILL if self.scans else DENIED
        # A corridor looked at the other way round still fits by two thirds.
        doubtful |= suspicious and contradicted > denied * (confirmed + contradicted)
        x, y, turn = motion.tolist()
        near = math.hypot(x, y) < NEAR_M and abs(se2.wrap(turn)) < NEAR_RAD
        return doubtful or (suspicious and share < SUDDEN and near)

    def count(self, doubtful: bool) -> None:
        """Another frame in doubt, or one that is not."""
        self.scans = self.scans + 1 if doubtful else 0

    def learn(self, matched: float, confirmed: float, contradicted: float, elapsed: float) -> None:
        """From a frame that was tracked, ``elapsed`` s after the one before."""
        self.matches.append(matched)
        self.tracked_s, self.tracked = self.tracked_s + elapsed, self.tracked + 1
        if confirmed + contradicted > 0.0:
            self.supports.append(matched * confirmed / (confirmed + contradicted))

    def give_up(self) -> None:
        """The next frame is written, as the first on this map."""
        self.scans = PATIENCE
        self.tracked_s, self.tracked = 0.0, 0

# SPDX-License-Identifier: Apache-2.0
"""How well the map usually explains what is seen, and when it denies a frame.

A robot that was carried away, or a map that is wrong, shows as a match far below the usual and a
map in view that is contradicted. Then nothing is written until it is clear where the robot is.
After how many such frames it is lost: ``QualityConfig.lost_after`` in ``config.py`` here.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from statistics import median

from slam import se2
from slam.frames import Float
from slam.tracker.tracking.config import QualityConfig

LEAST = 1e-9  # supports are divided by the usual one


class TrackingQuality:
    """What frames so far were like, and whether the next one fits.

    freeze_below  share of the usual match, see ``TrackerConfig``; 0: never denied
    matches       latest matched fractions; ``supports`` the same times the share of map confirmed
    wholes        as ``supports``, of the overlapped share of all returns: those of movers too
    tracked_s     s of tracking on this map, in ``tracked`` scans
    scans         frames denied in a row
    """

    def __init__(self, freeze_below: float, config: QualityConfig) -> None:
        self.freeze_below, self.config = freeze_below, config
        self.matches: deque[float] = deque(maxlen=config.remembered)
        self.supports: deque[float] = deque(maxlen=config.remembered)
        self.wholes: deque[float] = deque(maxlen=config.remembered)
        self.tracked_s, self.tracked, self.scans = 0.0, 0, 0
        self._excused, self._excuses = 0.0, 0

    def relocated(self, support: float) -> None:
        """A place was accepted that explains so much: as much cannot deny it for some scans."""
        self.count(False)
        self._excused = self.config.excused * support
        self._excuses = self.config.remembered

    def excuses(self, support: float) -> bool:
        """Whether a denied frame of this support is excused by that; counts such frames."""
        self._excuses = max(self._excuses - 1, 0)
        return self._excuses > 0 and support >= self._excused

    def resume(
        self, matches: Sequence[float], supports: Sequence[float], tracked_s: float, tracked: int
    ) -> None:
        """Go on with what a saved map had."""
        self.matches.extend(matches)
        self.supports.extend(supports)
        self.wholes.extend(supports)
        self.tracked_s, self.tracked = tracked_s, tracked

    def usual_match(self) -> float:
        """Median matched fraction."""
        return median(self.matches) if self.matches else 1.0

    def usual_support(self) -> float:
        """Median of it times the share of the map in view that is confirmed."""
        return max(median(self.supports), LEAST) if self.supports else 1.0

    def usual_whole(self) -> float:
        """As ``usual_support``, of all returns: what a place must explain to be the right one."""
        return max(median(self.wholes), LEAST) if self.wholes else 1.0

    def is_worth_searching(self, share: float = 1.0) -> bool:
        """Grown (or to that share), and explains what is seen: else it cannot deny it either."""
        return self._grown(share) and self.usual_whole() >= self.config.worth_searching

    def is_worth_searching_near(self) -> bool:
        """The same around where the robot is: what moves need not be explained there."""
        return self._grown(1.0) and self.usual_support() >= self.config.worth_searching

    def _grown(self, share: float) -> bool:
        config = self.config
        return self.tracked_s >= share * config.grown_s and self.tracked >= config.grown_scans

    @property
    def suspicious(self) -> bool:
        """Only a map that for long explained what is seen can show where the robot is.

        What has no vote need not be explained: a crowd close by does not take the doubt away.
        """
        return self.freeze_below > 0.0 and self.is_worth_searching_near()

    def arises(self, matched: float) -> bool:
        """Whether a match is so poor that the map in view is to be asked."""
        least = self.config.suspicious if self.suspicious else 0.0
        return self._share(matched) < max(self.freeze_below, least)

    def least_continuous(self) -> float:
        """Matched share below which a scan does not go on from those before it: carried."""
        return self.config.continuous * self.usual_match()

    def goes_on(self, scans: int, seconds: float) -> bool:
        """Whether so many scans in a row that agree with one another outweigh the map's denial."""
        return scans >= self.config.outdated_scans and seconds >= self.config.outdated_s

    def _share(self, matched: float) -> float:
        return matched / max(self.usual_match(), 1e-9)

    def denied(self, matched: float, confirmed: float, contradicted: float, motion: Float) -> bool:
        """Whether what the frame says of the map in view, or a sudden change, denies the match.

        ``motion`` (x m, y m, theta rad) since the frame before.
        """
        share, suspicious, config = self._share(matched), self.suspicious, self.config
        doubtful = self.is_worth_searching(config.known) and contradicted > confirmed
        doubtful &= share < self.freeze_below
        denied = config.still_denied if self.scans else config.denied
        # A corridor looked at the other way round still fits by two thirds.
        doubtful |= suspicious and contradicted > denied * (confirmed + contradicted)
        x, y, turn = motion.tolist()
        near = math.hypot(x, y) < config.sudden_m and abs(se2.wrap(turn)) < config.sudden_rad
        return doubtful or (suspicious and share < config.sudden and near)

    def count(self, denied: bool) -> None:
        """Another frame that is denied, or one that is not."""
        self.scans = self.scans + 1 if denied else 0

    def learn(
        self,
        matched: float,
        confirmed: float,
        contradicted: float,
        elapsed: float,
        overlapped: float | None = None,
    ) -> None:
        """From a frame that was tracked, ``elapsed`` s after the one before.

        ``overlapped``: of all returns; None: as ``matched``.
        """
        self.matches.append(matched)
        self.tracked_s, self.tracked = self.tracked_s + elapsed, self.tracked + 1
        if confirmed + contradicted > 0.0:
            confirming = confirmed / (confirmed + contradicted)
            self.supports.append(matched * confirmed / (confirmed + contradicted))
            self.wholes.append((matched if overlapped is None else overlapped) * confirming)

    def give_up(self) -> None:
        """The next frame is written, as the first on this map."""
        self.scans = self.config.patience
        self.tracked_s, self.tracked = 0.0, 0

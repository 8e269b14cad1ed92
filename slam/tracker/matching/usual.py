# SPDX-License-Identifier: Apache-2.0
"""What matches were like so far: by this alone it is told which scans are worth a search."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from statistics import median

from slam.frontend.observations import Observations
from slam.tracker.matching.config import UsualConfig
from slam.tracker.matching.matcher import Match

LEAST = 1e-9  # shares are divided by the usual one


class Usual:
    """Of scans that the map took in.

    matches  latest matched fractions
    """

    def __init__(self, config: UsualConfig, matches: Sequence[float] = ()) -> None:
        self._config = config
        self.matches: deque[float] = deque(matches, maxlen=config.remembered)
        self._rewarded, self._overlapped = 0.0, 0.0

    @property
    def match(self) -> float:
        """Median matched fraction."""
        return median(self.matches) if self.matches else 1.0

    def learn(self, match: Match, elapsed: float) -> None:
        """The map took in a scan, so many s after the one before."""
        self.matches.append(match.matched)
        self._rewarded += self._forgotten(elapsed) * (match.rewarded - self._rewarded)

    def follow(self, match: Match, observations: Observations, elapsed: float) -> None:
        """A scan was matched, to the map or to a local copy."""
        known = _of_known(match, observations)
        self._overlapped += self._forgotten(elapsed) * (known - self._overlapped)

    def _forgotten(self, elapsed: float) -> float:
        """Share of what is remembered of a second ago that a scan replaces."""
        return min(1.0 - math.exp(-elapsed / self._config.fallen_s), 0.3)

    def is_odd(self, match: Match, observations: Observations) -> bool:
        """Whether so little is matched, or so suddenly less, that the map in view is to be asked.

        Returns that have no vote and a reward that fell are the sign of a slip: who slipped sees
        what stands at places that were empty.
        """
        config = self._config
        if match.matched < config.odd * self.match:
            return True
        fell = match.rewarded < config.fallen * self._rewarded
        return fell and observations.mean_vote < config.outvoted

    def share(self, match: Match, observations: Observations) -> float:
        """Of what all returns, voting or not, matched in the second before: what matches now."""
        return _of_known(match, observations) / max(self._overlapped, LEAST)


def _of_known(match: Match, observations: Observations) -> float:
    """Matched share of what the scans before had in view: nothing else can go on from them."""
    return match.overlapped / max(observations.in_view, match.overlapped, LEAST)

# SPDX-License-Identifier: Apache-2.0
"""Is the robot lost, or is the map outdated where it is?

Both show as a map that explains less than usual. What stands decides: where furniture was moved,
the walls are still confirmed; to a robot that is elsewhere, nearly all of the old map in view is
denied, and there may be another place that explains what it sees. Where a wrong place looks right,
odometry does not agree with the way there.
"""

from __future__ import annotations

import math

from slam.tracker.tracking.config import VerdictConfig

TRACKING, OUTDATED, LOST, BLIND = "tracking", "map outdated here", "lost", "blind"


class Verdict:
    """The latest one.

    word    ``TRACKING``, ``OUTDATED`` (the robot is right, the room has changed), ``LOST`` or
            ``BLIND`` (nothing is in view)
    p_lost  probability in [0, 1] that the pose is wrong, and not the map
    """

    def __init__(self, config: VerdictConfig) -> None:
        self._config = config
        self.word, self.p_lost = TRACKING, 0.0

    def see_nothing(self) -> None:
        """A scan without a return: it says neither."""
        self.word = BLIND

    def trust(self) -> None:
        """The map is too young, or too little is in view, to deny a pose."""
        self.word, self.p_lost = TRACKING, 0.0

    def take(
        self, here: float, elsewhere: float = 0.0, ratio: float = 0.0, vote: float = 0.0
    ) -> None:
        """``here``: the support of the pose, over the usual one; ``elsewhere``: of the best other
        place that is known, 0 where none is; ``ratio``: see ``tracker.standing.agreement``;
        ``vote``: the mean of the returns. Where all are 1, odometry is wrong, and not the pose.

        A support is the matched share of the returns, or of those that vote, times the share of the
        old map in view that they confirm. So it counts what still stands against what is denied.
        """
        config = self._config
        odds = config.steep * (config.even - here) + config.rival * max(elsewhere - here, 0.0)
        denied = 1.5 * max(ratio - config.agreed, 0.0)  # -log of a Gaussian: 1/2 S'(V + R)^-1 S
        odds += min((1.0 - vote) * denied, config.most)
        self.p_lost = 1.0 / (1.0 + math.exp(min(max(-odds, -50.0), 50.0)))
        if self.p_lost >= 0.5:
            self.word = LOST
        else:
            self.word = OUTDATED if here < config.outdated else TRACKING

# SPDX-License-Identifier: Apache-2.0
"""Whether matches and odometry agree over seconds, not only from scan to scan.

Who is carried along by a crowd is corrected a little in each scan, always to the same side. No one
correction is more than odometry may be off, but their sum is.
"""

from __future__ import annotations

import math

import numpy as np

from slam import se2
from slam.frames import Float
from slam.frontend.odometry_prior import Prediction, upper_inverted
from slam.tracker.standing.config import StandingConfig


class Agreement:
    """Sums of what matches corrected, over two windows, against what odometry may be off.

    A window of w s forgets with exp(-t / w): S is the sum of corrections c, V that of odometry's
    covariances and of v^4 c c'. With nearly all returns of weight (mean vote v about 1) a
    correction is odometry's own error, however rare one so large is. While wheels slip, corrections
    are no sign of movers, and are left out. With R, what a match itself may be off,
    S' (V + R)^-1 S / 3 is at most about 1 where all is well.

    ratio  the larger one of the two windows
    """

    def __init__(self, config: StandingConfig) -> None:
        self._config = config
        self._windows = (config.window_s, config.long_window_s)
        own = (config.match_m, config.match_m, math.radians(config.match_deg))
        self._own = [v * v for v in own]
        self.forget()

    def forget(self) -> None:
        """The robot was set elsewhere: what was summed says nothing of it."""
        self._sums = [[0.0] * 3 for _ in self._windows]
        self._variances = [[0.0] * 6 for _ in self._windows]
        self.ratio = 0.0
        self._worst = 0
        self._elapsed_s = 0.0
        self._put_back: Float = np.zeros((3, 3))

    def take(self, prediction: Prediction, T_map_robot: Float, vote: float) -> None:
        """The robot is matched to ``T_map_robot`` by returns of that mean vote."""
        off = [0.0] * 3 if prediction.slips else prediction.off(T_map_robot).tolist()
        (xx, xy, xt), (_, yy, yt), (_, _, tt) = prediction.covariance.tolist()
        x, y, t = off
        w = vote * vote * vote * vote
        more = (
            xx + w * x * x, xy + w * x * y, xt + w * x * t,
            yy + w * y * y, yt + w * y * t, tt + w * t * t,
        )  # fmt: skip
        self.ratio, self._elapsed_s = 0.0, prediction.elapsed
        for k, window in enumerate(self._windows):
            keep = math.exp(-prediction.elapsed / window)
            square = keep * keep
            S = self._sums[k] = [keep * a + b for a, b in zip(self._sums[k], off, strict=True)]
            V = [square * a + b for a, b in zip(self._variances[k], more, strict=True)]
            self._variances[k] = V
            ratio = self._form(S, V) / 3.0
            if ratio > self.ratio:
                self.ratio, self._worst = ratio, k

    def _form(self, S: list[float], V: list[float]) -> float:
        """S' (V + R)^-1 S in a fixed order of operations; V by xx, xy, xt, yy, yt, tt."""
        (x, y, t), (xx, xy, xt, yy, yt, tt), (own_x, own_y, own_t) = S, V, self._own
        a, b, c, d, e, f = upper_inverted(xx + own_x, xy, xt, yy + own_y, yt, tt + own_t)
        return x * (a * x + 2.0 * (b * y + c * t)) + y * (d * y + 2.0 * e * t) + f * t * t

    def dragged(self, vote: float) -> float:
        """Probability in [0, 1) that the matches are wrong, and not odometry.

        ``vote`` is the mean vote of the returns: where all come from what stands, odometry is.
        """
        if self._config.disagreed == 0.0:
            return 0.0
        nats = min(1.5 * (self.ratio - self._config.disagreed), 50.0)  # of 3 numbers: 3 / 2
        return (1.0 - vote) / (1.0 + math.exp(-nats))

    def put_back(self, T_map_robot: Float) -> Float:
        """(3,) the pose without what matches corrected: where odometry leads."""
        pose: Float = T_map_robot - np.array(self._sums[self._worst])
        pose[2] = se2.wrap(float(pose[2]))
        return pose

    def undragged(self, T_map_robot: Float, vote: float) -> Float:
        """(3,) the pose put back, from which the sums begin anew.

        With the rest of the probability the matches were right: the pose is off by S now, and
        ``left_behind`` says so.
        """
        pose = self.put_back(T_map_robot)
        dragged = self.dragged(vote)
        put_back = self.covariance(dragged * (1.0 - dragged))
        self.forget()
        self._put_back = put_back
        return pose

    def covariance(self, dragged: float) -> Float:
        """(3, 3) of the pose if that is its probability: the pose is right, or off by S.

        The spread of both is ``dragged`` S S'.
        """
        x, y, turn = self._sums[self._worst]
        rows = [[x * x, x * y, x * turn], [x * y, y * y, y * turn], [x * turn, y * turn, turn**2]]
        return dragged * np.array(rows)

    def left_behind(self, dragged: float) -> Float:
        """(3, 3) the part of that which the window is about to forget: the map's from now on.

        What a pose put back leaves is in it. It is handed over once, until the next match.
        """
        keep = math.exp(-self._elapsed_s / self._windows[self._worst])
        left = (1.0 - keep * keep) * self.covariance(dragged) + self._put_back
        self._elapsed_s, self._put_back = 0.0, np.zeros((3, 3))
        return left

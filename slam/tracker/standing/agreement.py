# SPDX-License-Identifier: Apache-2.0
"""Whether movers pull the matches along, over seconds, not only from scan to scan.

Who is carried along by movers is corrected a little in each scan, always to the same side. No one
correction is more than odometry may be off, but their sum is. Where old surface is in view that
shows the direction of a correction, it is odometry's error. Where there is none, movers may have
made it.
"""

import math

import numpy as np

from slam import se2
from slam.arrays import Float
from slam.frontend.odometry_prior import Prediction, inverted, squared, turned
from slam.tracker.standing.config import StandingConfig
from slam.tracker.uncertainty.covariances import carried

HELD_S = 0.5  # s over which the old surface that scans saw is averaged; set by hand
FEW = 0.05  # share of the returns without weight with which the whole is left to movers; by hand
FAR_M = 0.05  # m: corrections that a map of a few cm tells from none; set by hand
FAR_RAD = 0.05  # rad, the same of the turn; set by hand
LEVER_M = 0.5  # m: a heading is held by old surface so far away; set by hand


class Agreement:
    """The corrections of a window, against what odometry may be off.

    A match corrects the prediction by c. A window of w s forgets with exp(-t / w): F is the sum of
    c, V that of odometry's covariances. With R, what a match itself may be off and what odometry
    may be off systematically, a share of way and turn, F' (V + R)^-1 F / 3 is at most about 1 where
    all is well. G is the information of the old surface that the scans before saw, u the share of
    the returns without weight. With H = diag(1, 1, lever^2), ``min(u / few, 1) H (H + G)^-1`` is
    the share of c that movers may have made; S is their sum.
    """

    def __init__(self, config: StandingConfig) -> None:
        self._config = config
        self.forget()

    def forget(self) -> None:
        """The robot was set elsewhere: what was summed says nothing of it."""
        self._held, self._looks = np.zeros((3, 3)), 0.0
        self._begin_window()

    def _begin_window(self) -> None:
        self._sum, self._by_movers = np.zeros(3), np.zeros(3)
        self._newest = np.zeros(3), np.zeros(3)
        self._variance, self._elapsed_s = np.zeros((3, 3)), 0.0
        self._way_m = self._turn_rad = 0.0

    def turned(self, by: float) -> None:
        """The map frame was turned by ``by`` rad, and the robot with it."""
        c, s = math.cos(by), math.sin(by)
        self._sum, self._by_movers = (
            np.array([c * x - s * y, s * x + c * y, turn])
            for x, y, turn in (self._sum.tolist(), self._by_movers.tolist())
        )
        self._variance, self._held = turned(self._variance, by), turned(self._held, by)

    def hold(self, old: Float, elapsed_s: float) -> None:
        """A scan shows so much old surface: (6,) xx, xy, xt, yy, yt, tt about the robot."""
        keep = math.exp(-elapsed_s / HELD_S)
        xx, xy, xt, yy, yt, tt = old.tolist()
        now = np.array([[xx, xy, xt], [xy, yy, yt], [xt, yt, tt]])
        self._held, self._looks = keep * self._held + now, keep * self._looks + 1.0

    def shown(self, covariance: Float, along_rad: float | None = None) -> Float:
        """(3, 3) part of an error of the pose with this covariance C that old surface shows.

        ``C - (1 / C + G / s^2)^-1``, 2 s^2 the variance of the position, G what a scan shows of old
        surface: nothing along a bare corridor, though a scan among people fits best somewhere
        there. ``along_rad``: G says nothing along this direction of the map either.
        """
        variance = 0.5 * float(covariance[0, 0] + covariance[1, 1])
        known = self._held / (variance * max(self._looks, 1.0))
        if along_rad is not None:
            across = np.empty((3, 3))
            carried(known, np.zeros(3), math.cos(along_rad), math.sin(along_rad), across)
            known = across
        return covariance - inverted(inverted(covariance) + known)

    def _left_to_movers(self, off: Float, weight: float) -> Float:
        """(3,) of a correction by returns of that mean weight."""
        share = np.array([1.0, 1.0, LEVER_M**2])
        x, y, turn = off.tolist()
        inverse = inverted(np.diag(share) + self._held / max(self._looks, 1.0))
        pulled = inverse[:, 0] * x + inverse[:, 1] * y + inverse[:, 2] * turn
        return np.asarray(min(max(1.0 - weight, 0.0) / FEW, 1.0) * share * pulled)

    def take(self, prediction: Prediction, T_map_robot: Float, weight: float) -> None:
        """The robot is matched to ``T_map_robot`` by returns of that mean weight."""
        keep = math.exp(-prediction.elapsed / self._config.window_s)
        x, y, turn = prediction.increment.tolist()
        off, self._elapsed_s = prediction.off(T_map_robot), prediction.elapsed
        self._newest = off, self._left_to_movers(off, weight)
        self._sum = keep * self._sum + off
        self._by_movers = keep * self._by_movers + self._newest[1]
        self._variance = keep * keep * self._variance + prediction.covariance
        self._way_m = keep * self._way_m + math.hypot(x, y)
        self._turn_rad = keep * self._turn_rad + abs(turn)

    def drop(self) -> None:
        """The newest match is not believed: the pose was not corrected by it."""
        off, by_movers = self._newest
        self._sum, self._by_movers = self._sum - off, self._by_movers - by_movers

    @property
    def denied(self) -> float:
        """F' (V + R)^-1 F / 3: what odometry says of the corrections of the window."""
        m, rad = self._config.scale * self._way_m, self._config.scale * self._turn_rad
        own_m, own_rad = self._config.match_m, math.radians(self._config.match_deg)
        own = np.diag([own_m**2 + m**2, own_m**2 + m**2, own_rad**2 + rad**2])
        return squared(self._sum, self._variance + own) / 3.0

    @property
    def is_far(self) -> bool:
        """Whether the corrections are so large that a map can tell both ends apart."""
        x, y, turn = self._sum.tolist()
        return math.hypot(x, y) > FAR_M or abs(turn) > FAR_RAD

    def led(self, T_map_robot: Float) -> Float:
        """(3,) the pose without the corrections of the window: where odometry leads."""
        pose: Float = T_map_robot - self._sum
        pose[2] = se2.wrap(float(pose[2]))
        return pose

    def put_back(self) -> None:
        """The pose was put back there: the window begins anew."""
        self._begin_window()

    def covariance(self) -> Float:
        """(3, 3) of the pose by what movers may have made of its corrections: S S'."""
        return np.multiply.outer(self._by_movers, self._by_movers)

    def left_behind(self) -> Float:
        """(3, 3) the part of that which the window is about to forget, and which the map keeps.

        It is handed over once, until the next match.
        """
        keep = math.exp(-self._elapsed_s / self._config.window_s)
        self._elapsed_s = 0.0
        return (1.0 - keep * keep) * self.covariance()

# SPDX-License-Identifier: Apache-2.0
"""Whether movers pull the matches along, over seconds, not only from scan to scan.

Who is carried along by a crowd is corrected a little in each scan, always to the same side. No one
correction is more than odometry may be off, but their sum is. Where old surface is in view that
shows the direction of a correction, it is odometry's error. Where there is none, movers may have
made it.
"""

import math
from typing import NamedTuple

import numpy as np

from slam import se2
from slam.frames import Float
from slam.frontend.odometry_prior import Prediction, inverted, squared, turned, upper_inverted
from slam.tracker.standing.config import StandingConfig
from slam.tracker.uncertainty.covariances import carried


class Pull(NamedTuple):
    """Which share of a correction movers may have made.

    held_s   s over which the old surface that scans saw is averaged; set by hand
    holds    weight (0.1 m each) of old surface that halves the share; ``scripts.integrity.pulls``
    few      share of the returns without weight with which the whole share is left to movers; the
             same
    lever_m  m: a heading is held by ``holds`` so far away; set by hand
    """

    held_s: float = 0.5
    holds: float = 1.0
    few: float = 0.05
    lever_m: float = 0.5


# Old surface (xx, xy, xt, yy, yt, tt; weights, times m and m^2) where the pose is in doubt. The map
# may be wrong there, so it counts for no position. Movers turn no robot. Set by hand.
IN_DOUBT = (0.0, 0.0, 0.0, 0.0, 0.0, 100.0)


class Agreement:
    """Sums of what movers may have made of the corrections, against what odometry may be off.

    A match corrects the prediction by c. G is the information of the old surface that the scans
    before it saw, u the share of its returns without weight. With H = holds diag(1, 1, lever^2),
    ``P = min(u / few, 1) H (H + G)^-1`` is the share that is left to movers. A window of w s
    forgets with exp(-t / w): S is the sum of P c, V that of odometry's covariances. With R, what a
    match itself may be off, S' (V + R)^-1 S / 3 is at most about 1 where all is well. Where it is
    not, the matches followed movers, and little old surface among them held nothing: the pose is
    put back by F, the sum of c.

    ratio   that
    denied  F' (V + R)^-1 F / 3, whatever held: old surface may be a board that now moves
    """

    def __init__(self, config: StandingConfig, pull: Pull = Pull()) -> None:  # noqa: B008 (frozen)
        self._config, self._pull = config, pull
        self.forget()

    def forget(self) -> None:
        """The robot was set elsewhere: what was summed says nothing of it."""
        self._sum, self._held = [0.0] * 3, [0.0] * 6
        self._looks = self._elapsed_s = 0.0
        self._forget_window()

    def _forget_window(self) -> None:
        self._whole, self._variance = np.zeros(3), np.zeros((3, 3))
        self._way_m = self._turn_rad = 0.0

    def turned(self, by: float) -> None:
        """The map frame was turned by ``by`` rad, and the robot with it."""
        c, s = math.cos(by), math.sin(by)
        x, y, turn = self._sum
        self._sum, self._held = [c * x - s * y, s * x + c * y, turn], _turned(self._held, by)
        x, y, turn = self._whole.tolist()
        self._whole = np.array([c * x - s * y, s * x + c * y, turn])
        self._variance = turned(self._variance, by)

    def hold(self, old: Float, elapsed_s: float) -> None:
        """A scan shows so much old surface: (6,) xx, xy, xt, yy, yt, tt about the robot."""
        keep = math.exp(-elapsed_s / self._pull.held_s)
        self._held = [keep * a + b for a, b in zip(self._held, old.tolist(), strict=True)]
        self._looks = keep * self._looks + 1.0

    def shown(self, covariance: Float, along_rad: float | None = None) -> Float:
        """(3, 3) part of an error of the pose with this covariance C that old surface shows.

        ``C - (1 / C + G / (holds s^2))^-1``, 2 s^2 the variance of the position: nothing along a
        bare corridor, though a scan among people fits best somewhere there. ``along_rad``: G says
        nothing along this direction of the map either.
        """
        variance = 0.5 * float(covariance[0, 0] + covariance[1, 1])
        times = 1.0 / (self._pull.holds * variance * max(self._looks, 1.0))
        xx, xy, xt, yy, yt, tt = (v * times for v in self._held)
        known = np.array([[xx, xy, xt], [xy, yy, yt], [xt, yt, tt]])
        if along_rad is not None:
            across = np.empty((3, 3))
            carried(known, np.zeros(3), math.cos(along_rad), math.sin(along_rad), across)
            known = across
        return covariance - inverted(inverted(covariance) + known)

    def _left_to_movers(
        self, vote: float, off: Float, in_doubt: bool
    ) -> tuple[float, float, float]:
        """P c of a correction (3,) by returns of that mean vote."""
        (x, y, t), without, pull = off.tolist(), max(1.0 - vote, 0.0), self._pull
        held = IN_DOUBT if in_doubt else [v / max(self._looks, 1.0) for v in self._held]
        xx, xy, xt, yy, yt, tt = held
        h, turn = pull.holds, pull.holds * pull.lever_m * pull.lever_m
        a, b, c, d, e, f = upper_inverted(xx + h, xy, xt, yy + h, yt, tt + turn)
        h, turn = (min(without / pull.few, 1.0) * v for v in (h, turn))
        return (
            h * (a * x + b * y + c * t),
            h * (b * x + d * y + e * t),
            turn * (c * x + e * y + f * t),
        )

    def take(
        self, prediction: Prediction, T_map_robot: Float, vote: float, in_doubt: bool = False
    ) -> None:
        """The robot is matched to ``T_map_robot`` by returns of that mean vote.

        ``in_doubt``: to the local copy, while it is not known whether the map is right there.
        """
        off = prediction.off(T_map_robot)
        pulled = self._left_to_movers(vote, off, in_doubt)
        self._elapsed_s = prediction.elapsed
        keep = math.exp(-prediction.elapsed / self._config.window_s)
        self._sum = [keep * a + b for a, b in zip(self._sum, pulled, strict=True)]
        x, y, turn = prediction.increment.tolist()
        self._whole = keep * self._whole + off
        self._variance = keep * keep * self._variance + prediction.covariance
        self._way_m = keep * self._way_m + math.hypot(x, y)
        self._turn_rad = keep * self._turn_rad + abs(turn)

    @property
    def denied(self) -> float:
        """F' (V + R)^-1 F / 3: what odometry says of the corrections of the window."""
        m, rad = self._config.scale * self._way_m, self._config.scale * self._turn_rad
        own_m, own_rad = self._config.match_m, math.radians(self._config.match_deg)
        own = np.diag([own_m**2 + m**2, own_m**2 + m**2, own_rad**2 + rad**2])
        return squared(self._whole, self._variance + own) / 3.0

    def put_back(self, T_map_robot: Float) -> Float:
        """(3,) the pose without the corrections of the window: where odometry leads."""
        pose: Float = T_map_robot - self._whole
        pose[2] = se2.wrap(float(pose[2]))
        return pose

    def give_way(self) -> None:
        """The pose was put back: the window begins anew."""
        self._forget_window()
        self._sum = [0.0] * 3

    @property
    def by_movers(self) -> Float:
        """(3,) S: what movers may have made of the corrections of the window."""
        return np.array(self._sum)

    def covariance(self) -> Float:
        """(3, 3) of the pose by what movers may have made of its corrections: S S'."""
        return np.multiply.outer(self._sum, self._sum)

    def left_behind(self) -> Float:
        """(3, 3) the part of that which the window is about to forget: the map's from now on.

        It is handed over once, until the next match.
        """
        keep = math.exp(-self._elapsed_s / self._config.window_s)
        left = (1.0 - keep * keep) * self.covariance()
        self._elapsed_s = 0.0
        return left


def _turned(upper: list[float], by: float) -> list[float]:
    """A symmetric matrix, by xx, xy, xt, yy, yt, tt, in axes turned by -``by``."""
    xx, xy, xt, yy, yt, tt = upper
    matrix = turned(np.array([[xx, xy, xt], [xy, yy, yt], [xt, yt, tt]]), by)
    (xx, xy, xt), (_, yy, yt), (_, _, tt) = matrix.tolist()
    return [xx, xy, xt, yy, yt, tt]

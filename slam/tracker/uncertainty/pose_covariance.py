# SPDX-License-Identifier: Apache-2.0
"""How sure a tracker is of its pose, in the map of the known start.

Three errors, kept apart because they grow differently:

- the map in view is off as a whole, by what it was off when its parts were first written. Grows
  with the share of the map that is new (trace gain), and turns with the robot about it;
- the scan lies off the map by what surfaces share: the scanner's errors by range and slant, and the
  lattice's. Does not grow; its size is read off the residuals (``residuals``);
- odometry, where the scan says nothing: the map's share of the pose ends, and this one grows.

Every constant is in units of what is observed, so that one set serves many scanners and rates.
Errors that surfaces share average out over the surfaces in view, so their variance is in inverse
proportion to how much of them is seen.
"""

import math
from collections.abc import Callable

import numpy as np

from slam.arrays import Float
from slam.frontend.odometry_prior import Prediction, turned
from slam.tracker.config import TrackerConfig
from slam.tracker.matching.matcher import Match
from slam.tracker.uncertainty.covariances import carried, followed
from slam.tracker.uncertainty.residuals import Residuals

LEAST = 1e-9  # m^2: numerical guard
SINGULAR = np.diag([1e-6, 1e-6, 1e-8])  # m^2, m^2, rad^2: numerical guard
TIMES_OFF = 2.0  # variances: old surface was off by so much less than the map is now; set by hand


class PoseCovariance:
    """The covariance of the pose.

    covariance    (3, 3) of (x, y, theta) in the map frame; zero at the known start
    shared_m2     m^2, variance of the residual that neighbouring points of a surface share
    newest_drift  (3, 3) what the latest frame added to the error of the map
    unobservable  directions of position (0, 1 or 2) about which the latest scans say no more than
                  the noise of their beams would
    unseen_s      s since all directions were observable, lost ones too; it fades once they are
    along_rad     direction in the map of the one that is not observable, None unless it is one
    loaded        (3, 3) by how much the first pose in a loaded map may be off; None without one
    """

    def __init__(self, config: TrackerConfig, *, of_points: bool = False) -> None:
        """``of_points``: they share no errors, so none averages out less than in a room."""
        numbers = config.uncertainty.pose
        self._config = numbers
        self.covariance: Float = np.zeros((3, 3))
        self.newest_drift: Float = np.zeros((3, 3))
        self.unobservable = 0
        self.along_rad: float | None = None
        self._whole = 0.0 if of_points else numbers.room_weight
        self._lattice = (numbers.lattice_cells * config.cell_m) ** 2
        self._products, self._pairs = numbers.at_first * numbers.usual_m**2, numbers.at_first
        self._geometry: Float = np.zeros((3, 3))
        self._recent: Float = np.zeros(7)  # ``Residuals.recent``
        self.unseen_s = 0.0
        self.shared_m2 = numbers.usual_m**2
        self._drift: Float = np.zeros((3, 3))
        self._blind: Float = np.zeros((3, 3))
        self._shared: Float = np.zeros((3, 3))
        self._window_s = config.standing.window_s
        self.loaded: Float | None = None

    def relocated(self, covariance: Float) -> None:
        """Found again somewhere in the map, to within ``covariance`` (3, 3)."""
        self._blind = covariance.copy()
        self.unseen_s = 0.0

    def resumed(self, covariance: Float, loaded: Float) -> None:
        """Going on in a map of before, which is off by ``covariance`` (3, 3) as a whole."""
        self.loaded = loaded
        self._drift = covariance.copy()
        self.covariance = covariance.copy()

    def known(self, covariance: Float) -> None:
        """A loop says that the map in view is off by ``covariance`` (3, 3), and no more."""
        self._drift = covariance.copy()
        self.covariance = self._drift + self._blind + self._shared

    def odometry_part(self, motion: Float) -> Float:
        """Covariance (3, 3), after ``motion`` in the map, of odometry's own part of late.

        The robot may be off the map in view by this; the map's own error is not in it. Nor is
        what adds up along a corridor: a match that may correct it there would follow noise.
        """
        x, y = 0.0, 0.0
        if self.along_rad is not None:
            x, y = math.cos(self.along_rad), math.sin(self.along_rad)
        out = np.empty((3, 3))
        carried(self._blind, motion, x, y, out)
        return out

    def update(
        self, T_map_before: Float, prediction: Prediction, match: Match, residuals: Residuals | None
    ) -> None:
        """Take the motion from ``T_map_before`` and the match at its end in.

        Without ``residuals`` the match was not used: odometry alone moved the robot.
        """
        config, elapsed = self._config, prediction.elapsed
        strength, new, times = 0.0, 0.0, 0.0
        if residuals is not None:
            self._learn(residuals, elapsed)
            (xx, _, _), (_, yy, _), _ = match.information.tolist()
            strength = match.tau * (xx + yy)
            new = residuals.new / max(residuals.weighed, 1e-9)
            times = config.written
        new_xx, new_xy, new_yy, feigned, weighed, in_view, looks = self._recent.tolist()
        used = strength > 0.0 and weighed > config.forgotten
        weight = 1.0 / weighed if used else 0.0
        feigned = feigned / weighed if used else 0.0
        # the usual one where nothing was seen for so long that the sums are used up
        shared = max(self._products, 0.0) + config.forgotten * config.usual_m**2
        self.shared_m2 = shared / (self._pairs + config.forgotten)
        # by how much shared errors of surfaces average out less than in a whole room
        seen = in_view / max(looks, config.forgotten)
        fewer = max(self._whole / max(seen, config.least_share * config.room_weight), 1.0)
        variance = (self._lattice + config.shared_times**2 * self.shared_m2) * fewer
        frames = max(1.0, config.correlated_s / max(elapsed, 1e-3))
        of_new = config.new_times**2 * new * variance * strength
        self.unobservable, along = followed(
            self._drift, self._blind, self._shared, self.newest_drift,
            prediction.T_map_robot - T_map_before, prediction.covariance, self._geometry,
            (new_xx, new_xy, new_yy, times, new),
            (strength if used else 0.0, weight, feigned, config.noisy),
            (variance * strength, of_new, frames, config.turn_times),
        )  # fmt: skip
        self.covariance = self._drift + self._blind + self._shared
        self.along_rad = along if self.unobservable == 1 else None
        faded = math.exp(-elapsed / config.view_s)
        self.unseen_s = self.unseen_s + elapsed if self.unobservable else self.unseen_s * faded

    def dragged(self, covariance: Float, now: Float) -> None:
        """The map is off by ``covariance`` (3, 3) more: movers may have carried the robot.

        ``now``: (3, 3) that the pose alone is off by more, until the next frame.
        """
        self._drift = self._drift + covariance
        self.newest_drift = self.newest_drift + covariance
        self.covariance = self.covariance + covariance + now

    @property
    def off_m(self) -> float:
        """Deviation by which what is written now is off: the map's as a whole, and odometry's."""
        return _far(self._drift + self._blind)

    def held(self, shown: Callable[..., Float], off_m2: float, elapsed: float) -> None:
        """Old surface in view is off by what the map was off when it became long known, and so is
        the robot that is matched to it: ``off_m2``, the mean of the squares.

        ``shown`` as of ``Agreement``. Only where the map was off by far less: driving on, what
        comes into view is off by more than what is still there.
        """
        share = 1.0 - TIMES_OFF * off_m2 / max(_far(self._drift) ** 2, LEAST)
        share *= 1.0 - math.exp(-elapsed / self._window_s)
        if share <= 0.0 or self.unobservable == 2:
            return
        shown_of = shown(self._drift + SINGULAR, self.along_rad)
        self._drift = self._drift + share * (SINGULAR - shown_of)
        self.covariance = self._drift + self._blind + self._shared

    def turned(self, by: float) -> None:
        """The map frame was turned by ``by`` rad, and the robot with it."""
        self._drift, self._blind = turned(self._drift, by), turned(self._blind, by)
        self._shared, self._geometry = turned(self._shared, by), turned(self._geometry, by)
        xx, xy, yy = self._recent[:3].tolist()
        part = turned(np.array([[xx, xy, 0.0], [xy, yy, 0.0], [0.0, 0.0, 0.0]]), by)
        self._recent[:3] = part[0, 0], part[0, 1], part[1, 1]
        self.along_rad = None if self.along_rad is None else self.along_rad + by
        self.covariance = self._drift + self._blind + self._shared

    def _learn(self, residuals: Residuals, elapsed: float) -> None:
        keep = math.exp(-elapsed / self._config.shared_s)
        self._products = keep * self._products + residuals.shared
        self._pairs = keep * self._pairs + residuals.paired
        keep = math.exp(-elapsed / self._config.view_s)
        self._geometry = keep * self._geometry + residuals.geometry
        self._recent = keep * self._recent + residuals.recent


def _far(covariance: Float) -> float:
    """m, deviation of a position; rounding may leave a little less than nothing of it."""
    return math.sqrt(max(float(covariance[0, 0] + covariance[1, 1]), 0.0))

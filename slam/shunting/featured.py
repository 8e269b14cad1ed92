# SPDX-License-Identifier: Apache-2.0
"""The shunting SLAM on point features, as the paper ran it: corners, IPJC, then Eq. (13).

"We use a general-purpose feature extractor to achieve positions and uncertainties of features, and
use IPJC to perform data association" (section 4.3). Features are associated with the peaks of the
map's activity; the pose that the accepted pairs agree on is where climbing starts, and only they
pull. What was not accepted still writes to the map: nothing is classified.
"""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

from slam import se2
from slam.ekf.association import ipjc
from slam.ekf.corners import corners
from slam.ekf.filter import EkfFilter
from slam.ekf.hypotheses import Gates
from slam.errors import InvalidValueError
from slam.frames import Float, Frame
from slam.shunting.config import ShuntingConfig
from slam.shunting.impressions import Observations
from slam.shunting.matching import Match
from slam.shunting.motion import Prediction, inverted, turned
from slam.shunting.peaks import peaks
from slam.shunting.slam import ShuntingSlam
from slam.system import Estimate, register

LEAST_PEAK = 0.1  # lower activities are no landmark to associate with
PEAK_CELLS = 0.25  # standard deviation of a peak's place beside its observations' own
ENOUGH_PAIRS = 2  # fewer do not say where the robot is: then the whole map is matched
GATES = Gates()


@register("shunting-features")
class FeaturedShuntingSlam(ShuntingSlam):
    """The shunting SLAM on point features (corners of scans), associated by IPJC.

    ``config`` as for "shunting". Uses ``frame.features``; corners where a frame has only a scan.
    """

    def __init__(self, config: ShuntingConfig | str = "robust", **options: Any) -> None:
        """``options`` replace fields of the preset."""
        if options and isinstance(config, str):
            presets = {"robust": ShuntingConfig.robust, "paper": ShuntingConfig.paper}
            unknown = sorted(set(options) - set(ShuntingConfig.__dataclass_fields__))
            if config not in presets or unknown:
                raise InvalidValueError(
                    f"FeaturedShuntingSlam knows no preset {config!r} or option {unknown}"
                )
            config = presets[config](**options)
        super().__init__(config)

    def update(self, frame: Frame) -> Estimate:
        """As for the scans, with corners in their place."""
        if frame.features is None and frame.scan is not None:
            features = corners(frame.scan, twist=frame.odometry.twist)
            frame = dataclasses.replace(frame, scan=None, features=features)
        return super().update(frame)

    def _match(self, observations: Observations, prediction: Prediction) -> Match:
        start, accepted = self._agreed(observations, prediction)
        if int(accepted.sum()) < ENOUGH_PAIRS:
            return super()._match(observations, prediction)
        pulling = dataclasses.replace(observations, weights=accepted.astype(np.float64))
        precision = inverted(prediction.covariance)
        match = self._matcher.climb(self.network, pulling, start, prediction.T_map_robot, precision)
        share = float(accepted.mean())
        return dataclasses.replace(match, matched=match.matched * share, searched=True)

    def _agreed(self, observations: Observations, prediction: Prediction) -> tuple[Float, Any]:
        """The pose (3,) after IPJC between features and peaks, and which features (n,) it took."""
        points = observations.points_robot
        accepted = np.zeros(len(points), dtype=np.bool_)
        before = self._T_map_robot
        reach = self.config.range_m + 1.0
        marks, _ = peaks(self.network, LEAST_PEAK, centre=before[:2], reach_m=reach)
        if len(points) == 0 or len(marks) == 0:
            return prediction.T_map_robot, accepted
        lattice = (PEAK_CELLS * self.config.cell_m) ** 2 * np.eye(2)
        state = EkfFilter()
        state.pose = before.copy()
        state.add(
            se2.transform(se2.inverse(before), marks), np.repeat(lattice[None], len(marks), axis=0)
        )
        in_robot = turned(prediction.covariance, -float(before[2]))
        state.predict(prediction.increment, in_robot)
        (xx, xy, yy) = self._sensed(observations).T
        covariances = np.stack([np.stack([xx, xy], -1), np.stack([xy, yy], -1)], -1)
        found = ipjc(state, np.arange(len(marks)), points, covariances, GATES)
        accepted = found.landmarks >= 0
        state.update(found.landmarks[accepted], points[accepted], covariances[accepted])
        return state.pose.copy(), accepted

    def _sensed(self, observations: Observations) -> Float:
        """(n, 3) the features' own covariances: without the width that the lattice needs, and twice
        the sensor's share, because peaks were seen with the same sensor."""
        floor = (0.8 * self.config.cell_m) ** 2
        own = observations.covariances - np.array([floor, 0.0, floor])
        out: Float = 2.0 * own + np.array([1e-6, 0.0, 1e-6])
        return out

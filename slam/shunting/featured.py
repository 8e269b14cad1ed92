# SPDX-License-Identifier: Apache-2.0
"""The shunting SLAM on point features, as the paper ran it: corners, IPJC, then Eq. (13).

"We use a general-purpose feature extractor to achieve positions and uncertainties of features, and
use IPJC to perform data association" (section 4.3). Features are associated with the peaks of the
map's activity, those looked at more than once first. Then Eq. (13):

- preset `paper`, as printed: the sum of the logarithms of overlaps is climbed, over the features
  that were paired, from where the pairs lead;
- preset `robust`: for pairs of Gaussians these logarithms are squares, so the best pose is that of
  least squares, found by iterated updates of an `EkfFilter` that knows the peaks as landmarks.
  Each feature and each peak has a covariance of its own; a peak's is read off the shape of its bell
  and the time it was looked at.

Whatever is seen is written to the map, paired or not.
"""

import dataclasses
from collections import deque
from collections.abc import Mapping
from statistics import median
from typing import Any

import numpy as np

from slam import se2
from slam.arrays import Bools, Float
from slam.errors import InvalidValueError
from slam.estimate import Estimate
from slam.frames import Frame
from slam.frontend.corners import corners
from slam.frontend.observations import Observations
from slam.frontend.odometry_prior import Prediction, inverted, turned
from slam.landmarks.association import ipjc
from slam.landmarks.filter import EkfFilter
from slam.shunting.map.peaks import Peaks, peaks
from slam.shunting.slam import ShuntingConfig, ShuntingSlam
from slam.tracker.cell_map import CellMap
from slam.tracker.matching.matcher import Match, seen_by
from slam.tracker.matching.score import evaluate
from slam.tracker.uncertainty.odometry_noise import OdometryNoise
from slam.tracker.uncertainty.pose_covariance import PoseCovariance

# Weight of a logarithm of overlap, preset ``paper``. Features are independent, unlike beams (0.3);
# and the lattice widens the bells of feature and peak to some three times their variances, which
# takes two thirds of what their overlap says of the pose. 2 to 5 does as well.
PAPER_REWARD = 3.0
PRESETS = {"robust": ShuntingConfig.robust, "paper": ShuntingConfig.paper}


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class _Agreed:
    """What features and peaks agree on: the pose (3,), which features (n,) were paired with a peak,
    and the information (3, 3) on the pose that these pairs are."""

    T_map_robot: Float
    accepted: Bools
    information: Float


class FeaturedShuntingSlam(ShuntingSlam):
    """The shunting SLAM on point features (corners of scans), associated by IPJC.

    ``config`` as for "shunting". Uses ``frame.features``; corners where a frame has only a scan.
    """

    map_moves = False  # a map of few points gains nothing by it

    def __init__(
        self, config: ShuntingConfig | str | Mapping[str, Any] = "robust", **options: Any
    ) -> None:
        """``options`` replace fields of the preset; ``paper`` has ``PAPER_REWARD`` here."""
        if isinstance(config, (ShuntingConfig, Mapping)):
            if isinstance(config, Mapping) and "preset" in config:  # its paper has another reward
                raise InvalidValueError("FeaturedShuntingSlam takes a preset as its config alone")
            if options:
                raise InvalidValueError("FeaturedShuntingSlam takes a config, or options, not both")
        elif config in PRESETS and set(options) <= set(ShuntingConfig.__dataclass_fields__):
            own = {"reward": PAPER_REWARD} if config == "paper" else {}
            config = PRESETS[config](**(own | options))
        else:
            raise InvalidValueError(
                "FeaturedShuntingSlam takes a ShuntingConfig, or one of the presets "
                f"{list(PRESETS)} and its options, got {config!r} and {sorted(options)}"
            )
        super().__init__(config)

    def update(self, frame: Frame) -> Estimate:
        """As for the scans, with corners in their place."""
        self._gates = self.config.features.gates
        if frame.scan is not None:  # its beams are no features
            features = frame.features
            if features is None:
                features = corners(frame.scan, twist=frame.odometry.twist)
                self._gates = self.config.features.corner_gates
            frame = dataclasses.replace(frame, scan=None, labels=None, features=features)
        return super().update(frame)

    def reset(self) -> None:
        """Forget everything; the next frame is the origin."""
        super().reset()
        self._gates = self.config.features.gates
        self._steps_s: deque[float] = deque(maxlen=self.config.features.steps)
        self._first_counts_s = 0.0
        self._believe(self._match)
        self._pose_covariance = PoseCovariance(self.config, of_points=True)
        overlaps = self.config.objective == "log"
        self._odometry_noise = OdometryNoise.of_points(self.config, overlaps=overlaps)

    def _first(self, frame: Frame) -> Estimate:
        self._first_counts_s = self.config.map.first_look_s
        return super()._first(frame)

    def _match(
        self, observations: Observations, prediction: Prediction, cell_map: CellMap
    ) -> Match:
        step = min(max(prediction.look, 1e-3), self.config.map.longest_look_s)
        self._steps_s.append(step)
        if self._first_counts_s > 0.0:  # however long it acted, it was one look
            age = self.network.cells.age
            age *= np.float32(step / self._first_counts_s)
            self._first_counts_s = 0.0
        agreed = self._agreed(observations, prediction)
        if int(agreed.accepted.sum()) < self.config.features.enough_pairs:
            return self._matcher.match(observations, prediction, cell_map)
        pulling = dataclasses.replace(observations, shares=agreed.accepted.astype(np.float64))
        if self.config.objective == "log":
            # Eq. (13) as printed, from where the pairs lead: the sum of the logarithms of overlaps
            match = self._matcher.climb(
                self.network, pulling, agreed.T_map_robot, prediction.T_map_robot,
                inverted(prediction.prior),
            )  # fmt: skip
            matched = match.matched * float(agreed.accepted.mean())
            return dataclasses.replace(match, matched=matched, overlapped=matched, searched=True)
        score, *_ = evaluate(
            self.network.cells, self._matcher.reward, seen_by(pulling), agreed.T_map_robot,
            np.zeros(3), np.zeros(3), np.zeros((3, 3)),
        )  # fmt: skip
        return Match(
            T_map_robot=agreed.T_map_robot,
            information=agreed.information,
            matched=float(agreed.accepted.mean()),
            overlapped=float(agreed.accepted.mean()),
            score=self.config.reward * score,
            tau=1.0,
            searched=True,
        )

    def _agreed(self, observations: Observations, prediction: Prediction) -> _Agreed:
        """IPJC between features and peaks, those looked at more than once first, as in a filter
        that confirms landmarks: what moves leaves peaks behind that were looked at once.
        """
        points, covariances = observations.points_robot, self._sensed(observations)
        accepted = np.zeros(len(points), dtype=np.bool_)
        before = self._T_map_robot
        reach = self.config.range_m + 1.0
        least = self.config.features.least_peak
        marks = peaks(self.network, least, centre=before[:2], reach_m=reach)
        looks = np.maximum(marks.ages_s / median(self._steps_s), 1.0)
        state = EkfFilter()
        state.pose = before.copy()
        state.add(
            se2.transform(se2.inverse(before), marks.points_map),
            self._places(marks, looks),
        )
        state.predict(prediction.increment, turned(prediction.prior, -float(before[2])))
        prior = state.pose_covariance()
        again = looks > self.config.features.looks_twice
        for chosen in (np.flatnonzero(again), np.flatnonzero(~again)):
            free = np.flatnonzero(~accepted)
            if len(chosen) == 0 or len(free) == 0:
                continue
            found = ipjc(state, chosen, points[free], covariances[free], self._gates).landmarks
            pairs = free[found >= 0]
            state.update(found[found >= 0], points[pairs], covariances[pairs])
            accepted[pairs] = True
        return _Agreed(
            T_map_robot=state.pose.copy(),
            accepted=accepted,
            information=inverted(state.pose_covariance()) - inverted(prior),
        )

    def _places(self, marks: Peaks, looks: Float) -> Float:
        """(n, 2, 2) how sure the peaks' places are, robot frame: one look's, over their number."""
        R = se2.rotation(-float(self._T_map_robot[2]))
        out: Float = np.einsum("ij,njk,lk->nil", R, marks.spreads / looks[:, None, None], R)
        own = self.config.features.peak_cells
        lattice = (own * self.config.cell_m) ** 2 * np.eye(2)
        return 0.5 * (out + out.transpose(0, 2, 1)) + lattice

    def _sensed(self, observations: Observations) -> Float:
        """(n, 2, 2) the features' own covariances: without the width that the lattice needs."""
        sigma = self.config.frontend.sigma_cells
        floor = (sigma * self.config.cell_m) ** 2 - self.config.features.least_m2
        own = observations.covariances - np.array([floor, 0.0, floor])
        out: Float = own[:, [0, 1, 1, 2]].reshape(-1, 2, 2)
        return out

# SPDX-License-Identifier: Apache-2.0
"""The classification-based EKF-SLAM that the paper compares itself with, as strong as we can.

Which objects are landmarks is the classification of the paper's section 4.1: "Every time an object
was re-observed, it was added as a state variable; landmarks are deleted if they cannot be observed
again." An object seen once is a *candidate*: it has its rows in the covariance, so that what its
first observation said is not lost, but nothing is associated with it until all confirmed landmarks
have had their say. Existence is a log-odds: a look that sees the object adds log(d / c), one that
should and does not adds log((1 - d) / (1 - c)), with d the probability of detection and c that of
seeing something else there. At zero the object goes.
"""

import math
from collections.abc import Callable, Mapping
from typing import Any, ClassVar

import numpy as np

from slam import se2
from slam.arrays import Bools, Float, Ints
from slam.ekf.config import EkfConfig
from slam.errors import InvalidValueError
from slam.estimate import Estimate, Landmarks
from slam.frames import Features, Frame, Odometry, Scan
from slam.frontend import odometry_prior
from slam.frontend.corners import answered, corners
from slam.frontend.odometry_prior import assumed_covariance
from slam.frontend.polar import hidden, polar
from slam.landmarks.association import ipjc
from slam.landmarks.filter import MOST_STD_M, EkfFilter
from slam.landmarks.hypotheses import Association
from slam.path import OnPath, PosePath

CHANCE = 0.05  # probability of something else where a landmark was; set by hand
WITHIN = 0.95  # share of range and field of view: surely in view
BEYOND = 1.1  # share of range and field of view: surely not in view
BEHIND_M = 0.15  # m; a beam that ends so far off a landmark decides
LOST_AFTER = 10  # frames in a row without an expected match: lost
SINGULAR_M2 = 1e-12  # m^2, least eigenvalue of a measured covariance; numerical guard: (1 um)^2
LEAST_M2 = 1e-6  # m^2, variance taken in the place of a singular one: (1 mm)^2
REACH_SIGMAS = 3.0  # deviations of the pose, for what is in reach


class Lifecycle:
    """What is known of each landmark of the filter, in the filter's order.

    keys       (n,) int64, never used twice: names that outlive deletions
    looks      (n,) int64 times seen
    existence  (n,) log-odds
    """

    def __init__(self, config: EkfConfig) -> None:
        self._config = config
        self._seen_adds = math.log(config.detection / CHANCE)
        self._missed_adds = math.log((1.0 - config.detection) / (1.0 - CHANCE))
        self._next_key = 0
        self.keys: Ints = np.zeros(0, dtype=np.int64)
        self.looks: Ints = np.zeros(0, dtype=np.int64)
        self.existence: Float = np.zeros(0)
        self.deleted = 0

    @property
    def confirmed(self) -> Bools:
        """(n,) bool: seen often enough to be a landmark."""
        return self.looks >= self._config.confirm_looks

    def add(self, n: int) -> None:
        """n objects seen for the first time, at the end of the order."""
        self.keys = np.concatenate([self.keys, np.arange(self._next_key, self._next_key + n)])
        self.looks = np.concatenate([self.looks, np.ones(n, dtype=np.int64)])
        self.existence = np.concatenate([self.existence, np.full(n, self._seen_adds)])
        self._next_key += n

    def judge(
        self,
        seen: Ints,
        expected: Bools,
        left_behind: Bools,
    ) -> Ints:
        """Count one frame; the indices that can go.

        expected     (n,) should have been seen
        left_behind  (n,) out of view: candidates there go, else every thing that ever moved would
                     stay in the state
        """
        missed = expected.copy()
        missed[seen] = False
        self.looks[seen] += 1
        self.existence[seen] += self._seen_adds
        self.existence[missed] += self._missed_adds
        ceiling = self._config.memory_looks * self._seen_adds
        self.existence = np.minimum(self.existence, ceiling)
        return np.flatnonzero((self.existence <= 0.0) | (left_behind & ~self.confirmed))

    def remove(self, gone: Ints) -> None:
        """Forget these; counts how many of them were confirmed."""
        self.deleted += int(self.confirmed[gone].sum())
        self.keys = np.delete(self.keys, gone)
        self.looks = np.delete(self.looks, gone)
        self.existence = np.delete(self.existence, gone)


def in_view(landmarks_robot: Float, config: EkfConfig, rim: float = WITHIN) -> Bools:
    """(n,) landmarks (n, 2), robot frame, within the share ``rim`` of range and field of view."""
    distance, bearing = polar(landmarks_robot)
    half = math.radians(config.fov_deg) / 2.0
    inside: Bools = (np.abs(bearing) < rim * half) | (config.fov_deg >= 360.0)
    return inside & (distance < rim * config.range_m)


def unhidden_by_features(landmarks_robot: Float, points_robot: Float, config: EkfConfig) -> Bools:
    """(n,) False where an observed thing stands before the landmark: within the angle that
    ``occluder_m`` fills at its distance, and nearer than the landmark by as much."""
    if config.occluder_m == 0.0:
        return np.ones(len(landmarks_robot), dtype=np.bool_)
    return ~hidden(landmarks_robot, points_robot, config.occluder_m)


def unhidden_by_beams(landmarks_laser: Float, scan: Scan) -> Bools:
    """(n,) True where every beam at the landmark (laser frame) passes beyond it: it is gone.

    A beam that ends before it says that it is hidden; one that ends at it, that something is there
    although no feature was found. Neither is a miss. Takes the three beams nearest in direction.
    """
    spec = scan.spec
    distance, bearing = polar(landmarks_laser)
    beam = np.round((bearing - spec.angle_min) / spec.angle_increment).astype(np.int64)
    inside = (beam >= 1) & (beam < spec.n_beams - 1)
    beam = np.clip(beam, 1, max(spec.n_beams - 2, 1))
    ranges = answered(scan)
    if spec.n_beams < 3:
        return np.zeros(len(landmarks_laser), dtype=np.bool_)
    shortest = np.minimum(np.minimum(ranges[beam - 1], ranges[beam]), ranges[beam + 1])
    return inside & (shortest > distance + BEHIND_M)


PRESETS: dict[str, Callable[..., EkfConfig]] = {
    name: getattr(EkfConfig, name) for name in EkfConfig.presets
}


class EkfSlam(OnPath):
    """EKF-SLAM on point landmarks: IPJC association, landmarks that are confirmed and deleted.

    Takes ``frame.features``; where a frame has only a scan, corners are extracted from it. Options
    are those of ``EkfConfig``; ``preset`` is "points" (the default of ``EkfConfig``), "corners" or
    "victoria_park"; without it the first frame decides between the first two. ``config`` may be
    numbers by their path instead, which change that preset, and name it: ``{"preset": "corners"}``.
    """

    config_class: ClassVar[type[EkfConfig]] = EkfConfig

    def __init__(
        self,
        config: EkfConfig | Mapping[str, Any] | None = None,
        *,
        preset: str | None = None,
        **options: Any,
    ) -> None:
        self._changes = dict(config) if isinstance(config, Mapping) else {}
        if isinstance(config, Mapping):
            preset, config = self._changes.pop("preset", preset), None
        if preset is not None and preset not in PRESETS:
            raise InvalidValueError(f"EkfSlam.preset must be of {list(PRESETS)}, got {preset!r}")
        if config is not None and (preset is not None or options):
            raise InvalidValueError("EkfSlam takes a config, or a preset and options, not both")
        known = list(EkfConfig.__dataclass_fields__)
        unknown = sorted(set(options) - set(known))
        if unknown:
            raise InvalidValueError(f"EkfSlam has no option {unknown[0]!r}; it has {known}")
        self._options = options
        self._is_given = config is not None or preset is not None
        self._configure(config or PRESETS[preset or "points"](**options))
        self.reset()

    def _configure(self, config: EkfConfig) -> None:
        self.config = config.changed(self._changes)
        self._gates = config.gates

    def reset(self) -> None:
        """Forget everything; the next frame is the origin."""
        self.filter = EkfFilter()
        self.lifecycle = Lifecycle(self.config)
        self._before: Odometry | None = None
        self._unmatched = 0
        self._path = PosePath()

    def update(self, frame: Frame) -> Estimate:
        """One frame in six steps: from odometry and points to pose, covariance and landmarks."""
        self._begin(frame)
        points, covariances = self._observe(frame)  # 1 corners, or features as given
        self._predict(frame.odometry)  # 2 odometry
        confirmed = self.lifecycle.confirmed
        pairs = self._correct(points, covariances, confirmed)  # 3 data association and update
        expected = self._expected(frame, points)  # 4 what should have been seen
        self._judge(pairs, expected, confirmed)  # 5 lost or not; landmarks that are deleted
        self._add(points[~pairs.plausible], covariances[~pairs.plausible])  # 6 new candidates
        return self._report(frame, pairs.matched, len(points))

    def _begin(self, frame: Frame) -> None:
        """Refuse a frame out of order; the first one decides which preset is meant."""
        self._path.check_order(frame.stamp_ns)
        if not len(self._path) and not self._is_given:
            name = "points" if frame.features is not None else "corners"
            self._configure(PRESETS[name](**self._options))
            self.lifecycle = Lifecycle(self.config)

    def _observe(self, frame: Frame) -> tuple[Float, Float]:
        features = frame.features
        if features is None:
            if frame.scan is None:
                raise InvalidValueError("the EKF needs a scan or features in every frame")
            features = corners(frame.scan, twist=frame.odometry.twist)
        return self._used(features)

    def _used(self, features: Features) -> tuple[Float, Float]:
        """Features within range and field of view, their rim included: a thing beyond it would be
        left behind in the next frame; without those that are known to ``MOST_STD_M`` only. Their
        covariances, none of them singular."""
        points, config = features.points_robot, self.config
        distance, bearing = polar(points)
        used = distance <= config.range_m
        variances = features.covariances.diagonal(axis1=1, axis2=2)
        used &= variances.max(axis=1, initial=0.0) <= MOST_STD_M**2
        if config.fov_deg < 360.0:
            used &= np.abs(bearing) < BEYOND * math.radians(config.fov_deg) / 2.0
        return points[used], _regular(features.covariances[used] * config.noise_scale**2)

    def _predict(self, odometry: Odometry) -> None:
        if self._before is not None:
            increment = odometry_prior.motion(self._before, odometry)
            covariance = odometry.increment_covariance
            if covariance is None:
                covariance = assumed_covariance(increment)
            self.filter.predict(increment, covariance)
        self._before = odometry

    def _correct(self, points: Float, covariances: Float, confirmed: Bools) -> Association:
        """Pair points with confirmed landmarks, then with candidates; update with each."""
        landmarks = np.full(len(points), -1)
        plausible, cost = np.zeros(len(points), dtype=np.bool_), 0.0
        for stage in (confirmed, ~confirmed):
            chosen = np.flatnonzero(stage)
            near = chosen[self._within_reach(chosen)]
            free = np.flatnonzero(landmarks < 0)
            if len(near) == 0 or len(free) == 0:
                continue
            found = ipjc(self.filter, near, points[free], covariances[free], self._gates)
            landmarks[free] = found.landmarks
            plausible[free] |= found.plausible
            cost += found.cost
            pairs = free[found.landmarks >= 0]
            self.filter.update(landmarks[pairs], points[pairs], covariances[pairs])
        return Association(landmarks=landmarks, cost=cost, plausible=plausible)

    def _within_reach(self, chosen: Ints) -> Bools:
        """What could be seen if the pose is off by three standard deviations."""
        P = self.filter.pose_covariance()
        reach = self.config.range_m * (1.0 + REACH_SIGMAS * math.sqrt(max(P[2, 2], 0.0)))
        reach += REACH_SIGMAS * math.sqrt(max(P[0, 0] + P[1, 1], 0.0))
        away = self.filter.landmarks[chosen] - self.filter.pose[:2]
        near: Bools = polar(away)[0] < reach
        return near

    def _expected(self, frame: Frame, points: Float) -> Bools:
        """(n,) which landmarks this frame should show."""
        T_robot_map = se2.inverse(self.filter.pose)
        landmarks_robot = se2.transform(T_robot_map, self.filter.landmarks)
        expected = in_view(landmarks_robot, self.config)
        if frame.features is None and frame.scan is not None:
            T_laser_robot = se2.inverse(frame.scan.spec.T_robot_laser)
            landmarks_laser = se2.transform(T_laser_robot, landmarks_robot)
            return expected & unhidden_by_beams(landmarks_laser, frame.scan)
        return expected & unhidden_by_features(landmarks_robot, points, self.config)

    def _judge(self, pairs: Association, expected: Bools, confirmed: Bools) -> None:
        """Count frames in which nothing expected was met; delete what is gone or left behind."""
        if pairs.matched:
            self._unmatched = 0
        elif (expected & confirmed).any():
            self._unmatched += 1
        seen = pairs.landmarks[pairs.landmarks >= 0]
        landmarks_robot = se2.transform(se2.inverse(self.filter.pose), self.filter.landmarks)
        left_behind = ~in_view(landmarks_robot, self.config, BEYOND)
        gone = self.lifecycle.judge(seen, expected, left_behind)
        self.lifecycle.remove(gone)
        self.filter.remove(gone)

    def _add(self, points: Float, covariances: Float) -> None:
        """Candidates from points that no landmark explains, apart from each other and the rest."""
        taken = se2.transform(se2.inverse(self.filter.pose), self.filter.landmarks)
        least = self.config.separation_m
        new: list[int] = []
        for k, point in enumerate(points):
            away = np.concatenate([taken, points[new]]) - point
            if not len(away) or (away * away).sum(axis=1).min() >= least * least:
                new.append(k)
        self.filter.add(points[new], covariances[new])
        self.lifecycle.add(len(new))

    def _report(self, frame: Frame, matched: int, observed: int) -> Estimate:
        lost = self._unmatched >= LOST_AFTER
        self._path.add(frame.stamp_ns, self.filter.pose)
        return Estimate(
            stamp_ns=frame.stamp_ns,
            T_map_robot=self.filter.pose,
            covariance=self.filter.pose_covariance(),
            converged=not lost,
            diagnostics={
                "state": "lost" if lost else "tracking",
                "observed": observed,
                "matched": matched,
                "landmarks": int(self.lifecycle.confirmed.sum()),
                "deleted": self.lifecycle.deleted,
            },
        )

    def landmarks(self) -> Landmarks:
        """The confirmed landmarks; ``.ellipses()`` for the 3 sigma ellipses of the figures."""
        confirmed = np.flatnonzero(self.lifecycle.confirmed)
        return Landmarks(
            keys=self.lifecycle.keys[confirmed],
            points_map=self.filter.landmarks[confirmed].copy(),
            covariances=self.filter.landmark_covariances()[confirmed],
            looks=self.lifecycle.looks[confirmed],
        )


def _regular(covariances: Float) -> Float:
    """(k, 2, 2) with more on the diagonal where they are singular, the others bit for bit: exact
    features, or features exact in one direction, must not end a run."""
    xx, yy, xy = covariances[:, 0, 0], covariances[:, 1, 1], covariances[:, 0, 1]
    half, apart = 0.5 * (xx + yy), 0.5 * (xx - yy)
    scale = np.maximum(half, 1.0)
    flat = half - np.sqrt(apart * apart + xy * xy) < SINGULAR_M2 * scale
    out = covariances.copy()
    out[flat] += LEAST_M2 * scale[flat, None, None] * np.eye(2)
    return out

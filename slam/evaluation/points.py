# SPDX-License-Identifier: Apache-2.0
"""A world of points, some of which move, seen by a robot that drives round it (paper, 4.2).

Static points lie uniformly over a square; the moving ones walk through it, each with a speed of its
own and a heading that wanders. The robot drives a closed loop. Noise is Gaussian and white, Eq. 14:
range and bearing of each point, distance and heading of each step. The paper gives its numbers the
units of variances; as variances they would be steps with errors of 0.32 m and 10 degrees, so they
are read as what the text calls them, standard deviations.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, fields
from itertools import pairwise
from typing import Annotated

import numpy as np
from msgspec import Meta

from slam import se2
from slam.errors import InvalidValueError
from slam.frames import Features, Float, Frame, Odometry, Stream, StreamMetadata, to_ns
from slam.landmarks.filter import from_range_bearing
from slam.shaped import NotNegative, Positive, Share, check

TURNING = 0.3  # rad per square root of a second: how a moving point's heading wanders


@dataclass(frozen=True, kw_only=True)
class PointWorldConfig:
    """What the world is like; the noise is the paper's Eq. (14).

    side_m          edge of the square, m
    n_points        points in it, static and moving
    moving          share of them that moves, 0..1
    speed_m_s       moving points: uniform between a quarter of this and this, m/s
    n_steps         steps of 1 s; the loop is a rounded square ``side_m / 5`` inside the edge
    step_m          distance driven in a step, m
    range_m         farther points are not seen, m
    fov_deg         field of view, centred straight ahead
    odometry_std    m and rad per step
    sensor_std      m and rad per point
    """

    side_m: Annotated[float, Meta(ge=5.0, le=1e4)] = 44.0
    n_points: Annotated[int, Meta(ge=0, le=100_000)] = 130
    moving: Share = 0.0
    speed_m_s: Annotated[float, Meta(ge=0.0, le=100.0)] = 0.6
    n_steps: Annotated[int, Meta(ge=1, le=10_000_000)] = 220
    step_m: NotNegative = 0.5
    range_m: Annotated[float, Meta(ge=1e-3, le=1e4)] = 12.0
    fov_deg: Annotated[float, Meta(ge=1.0, le=360.0)] = 180.0
    odometry_std: tuple[Positive, Positive] = (0.1, 0.03)
    sensor_std: tuple[Positive, Positive] = (0.001, 0.001)

    def __post_init__(self) -> None:
        check(self)
        if self.step_m > self.side_m / 20.0:
            raise InvalidValueError(
                f"PointWorldConfig.step_m must be at most side_m / 20, got {self.step_m}"
            )


class PointWorld:
    """The truth of one run; ``stream()`` is what the robot gets of it.

    path     (n_steps + 1, 3) T_world_robot
    points   (n_steps + 1, n_points, 2) m in the world frame
    moving   (n_points,) bool
    """

    def __init__(self, config: PointWorldConfig | None = None, *, seed: int = 0) -> None:
        self.config = config or PointWorldConfig()
        self.seed = seed
        layout, walk, self._noise_seed = np.random.SeedSequence(seed).spawn(3)
        self.path = _loop(self.config)
        self.moving = np.arange(self.config.n_points) < round(
            self.config.moving * self.config.n_points
        )
        self.points = self._walk(np.random.default_rng(layout), np.random.default_rng(walk))

    def _walk(self, layout: np.random.Generator, walk: np.random.Generator) -> Float:
        c = self.config
        half = c.side_m / 2.0
        points = np.empty((c.n_steps + 1, c.n_points, 2))
        points[0] = layout.uniform(-half, half, (c.n_points, 2))
        headings = layout.uniform(-math.pi, math.pi, c.n_points).tolist()
        speeds = layout.uniform(c.speed_m_s / 4.0, c.speed_m_s, c.n_points).tolist()
        for k in range(1, c.n_steps + 1):
            points[k] = points[k - 1]
            turns = walk.normal(0.0, TURNING, c.n_points).tolist()
            for i in np.flatnonzero(self.moving).tolist():
                headings[i] += turns[i]
                x = points[k, i, 0] + speeds[i] * math.cos(headings[i])
                y = points[k, i, 1] + speeds[i] * math.sin(headings[i])
                if abs(x) > half or abs(y) > half:  # turn back at the edge
                    headings[i] += math.pi
                else:
                    points[k, i] = x, y
        return points

    def stream(self) -> Stream:
        """The frames: odometry with its covariance, features with theirs, identities and truth."""
        values = {f.name: getattr(self.config, f.name) for f in fields(self.config)}
        metadata = StreamMetadata(
            source="points", seed=self.seed, truth="simulator", extra={"config": values}
        )
        return Stream(metadata=metadata, frames=self._frames, length=self.config.n_steps + 1)

    def _frames(self) -> Iterator[Frame]:
        rng = np.random.default_rng(self._noise_seed)
        T_odom_robot = np.zeros(3)
        yield self._frame(0, T_odom_robot, None, rng)
        for k, (before, now) in enumerate(pairwise(self.path), 1):
            increment, covariance = self._increment(before, now, rng)
            T_odom_robot = se2.compose(T_odom_robot, increment)
            yield self._frame(k, T_odom_robot, covariance, rng)

    def _increment(
        self, before: Float, now: Float, rng: np.random.Generator
    ) -> tuple[Float, Float]:
        """What the wheels say of a step: its distance and its turn, each with an error."""
        true = se2.between(before, now)
        std_m, std_rad = self.config.odometry_std
        distance_error, turn_error = rng.normal(0.0, [std_m, std_rad]).tolist()
        along = math.atan2(true[1], true[0]) if true[0] or true[1] else 0.0
        c, s = math.cos(along), math.sin(along)
        reported = true + np.array([c * distance_error, s * distance_error, turn_error])
        along = math.atan2(reported[1], reported[0]) if reported[0] or reported[1] else 0.0
        c, s = math.cos(along), math.sin(along)
        v = std_m * std_m
        return reported, np.array(
            [[c * c * v, c * s * v, 0.0], [c * s * v, s * s * v, 0.0], [0.0, 0.0, std_rad**2]]
        )

    def _frame(
        self, k: int, T_odom_robot: Float, covariance: Float | None, rng: np.random.Generator
    ) -> Frame:
        c = self.config
        ids, points, covariances = [], [], []
        errors = rng.normal(0.0, c.sensor_std, (c.n_points, 2)).tolist()
        seen = se2.transform(se2.inverse(self.path[k]), self.points[k]).tolist()
        for i, (x, y) in enumerate(seen):
            distance, bearing = math.hypot(x, y), math.atan2(y, x)
            if not 0.1 < distance <= c.range_m or abs(bearing) > math.radians(c.fov_deg) / 2.0:
                continue
            point, spread = from_range_bearing(
                distance + errors[i][0], bearing + errors[i][1], *c.sensor_std
            )
            ids.append(i)
            points.append(point)
            covariances.append(spread)
        stamp_ns = to_ns(float(k))
        features = Features(
            stamp_ns=stamp_ns,
            points_robot=np.array(points).reshape(-1, 2),
            covariances=np.array(covariances).reshape(-1, 2, 2),
            ids=np.array(ids, dtype=np.int64),
        )
        odometry = Odometry(
            stamp_ns=stamp_ns, T_odom_robot=T_odom_robot, increment_covariance=covariance
        )
        return Frame(stamp_ns=stamp_ns, odometry=odometry, features=features, truth=self.path[k])


def _loop(config: PointWorldConfig) -> Float:
    """Round a square with quarter circles for corners, counter-clockwise, in equal steps."""
    half = 0.3 * config.side_m
    radius = half / 2.0
    straight, corner = 2.0 * (half - radius), math.pi / 2.0 * radius
    pose = np.array([0.0, -half, 0.0])
    path, left, turning = [pose], straight / 2.0, False
    for _ in range(config.n_steps):
        step = config.step_m
        while step > 0.0:
            part = min(step, left)
            turn = part / radius if turning else 0.0
            pose = se2.compose(pose, se2.exp([part, 0.0, turn]))
            step, left = step - part, left - part
            if left <= 1e-12:
                turning = not turning
                left = corner if turning else straight
        path.append(pose)
    return np.array(path)

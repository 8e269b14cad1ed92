# SPDX-License-Identifier: Apache-2.0
"""What cameras on the ceiling would know of tagged things: late, at a rate, noisy, with gaps.

A stand-in for rendering and detecting, which costs 100 ms a picture. Rate, latency and noise are
those of a common installation (30 pictures a second, a centimetre; assumed, no source), and the
line of sight is that of the scene's own geometry: people, furniture and walls hide a tag.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from sim.core import state
from slam import se2
from slam.errors import InvalidValueError
from slam.frames import NS_PER_S, Float
from slam.settings import Settings, number

SEEN_GROUPS = np.array([1, 1, 1, 0, 0, 0], dtype=np.uint8)  # no hulls, marks or painted shadows
HORIZON = 64  # readings kept


@dataclass(frozen=True, kw_only=True)
class TagCameraConfig(Settings):
    """How good the cameras are."""

    rate_hz: float = number(30.0, "1/s", "pictures, all cameras at once", low=1e-6)
    latency_s: float = number(0.05, "s", "from picture to reading")
    noise_std_m: float = number(0.01, "m", "of x and of y, independent from picture to picture")
    noise_std_rad: float = number(math.radians(0.5), "rad", "the same of the yaw")
    bias_std_m: float = number(0.005, "m", "of x and of y, constant for each camera: calibration")
    spacing_m: float = number(3.0, "m", "between cameras, in a grid over the floor", low=1e-6)
    height_m: float = number(2.7, "m", "of them above the floor")
    reach_m: float = number(2.5, "m", "along the floor, from beneath a camera, that it sees")
    tag_height_m: float = number(0.52, "m", "of the tags above the floor")
    tag_side_m: float = number(0.24, "m", "of the square whose corners must be seen")

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.height_m <= self.tag_height_m:
            raise InvalidValueError(
                f"TagCameraConfig.height_m must be above tag_height_m, got {self.height_m}"
            )


@dataclass(frozen=True, kw_only=True, eq=False)
class TagReading:
    """What one set of pictures showed.

    stamp_ns    when the pictures were taken; ``arrival_ns`` when the reading is there
    poses       (tags, 3) ``T_world_body`` x m, y m, yaw rad; NaN where no camera saw the tag
    camera      (tags,) which camera each pose is from, -1 for none
    """

    stamp_ns: int
    arrival_ns: int
    poses: Float
    camera: NDArray[np.int64]


class TagCameras:
    """Ceiling cameras over one world.

    bounds  xmin, ymin, xmax, ymax of the floor, m
    bodies  names of the tagged bodies
    rng     drawn from once at birth, and 3 times per tag and picture, seen or not
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        bounds: tuple[float, float, float, float],
        config: TagCameraConfig | None = None,
        rng: np.random.Generator | None = None,
        *,
        bodies: Sequence[str] = ("robot/base",),
    ) -> None:
        self.config = TagCameraConfig() if config is None else config
        self._rng = np.random.default_rng(0) if rng is None else rng
        self._model = model
        self._bodies = [mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, b) for b in bodies]
        for name, body in zip(bodies, self._bodies, strict=True):
            if body < 0:
                raise InvalidValueError(f"TagCameras.bodies: the model has no body {name!r}")
        self.cameras = _grid(bounds, self.config)
        self._bias = self.config.bias_std_m * self._rng.standard_normal((len(self.cameras), 2))
        self._count = 0
        self._start_ns: int | None = None
        self._readings: deque[TagReading] = deque(maxlen=HORIZON)

    def note(self, time_ns: int, data: mujoco.MjData) -> None:
        """Take the pictures that are due; call at every physics step, kinematics fresh."""
        if self._start_ns is None:
            self._start_ns = time_ns
        due_ns = self._start_ns + round(self._count * NS_PER_S / self.config.rate_hz)
        if time_ns < due_ns:
            return
        self._count += 1
        normal = self._rng.standard_normal((len(self._bodies), 3))
        poses = np.full((len(self._bodies), 3), math.nan)
        seers = np.full(len(self._bodies), -1, dtype=np.int64)
        for k, body in enumerate(self._bodies):
            x, y, _ = data.xpos[body].tolist()
            rows = data.xmat[body].tolist()
            yaw = math.atan2(rows[3], rows[0])
            camera = self._seer(data, body, (x, y, yaw))
            if camera < 0:
                continue
            (bx, by), (nx, ny, nyaw) = self._bias[camera].tolist(), normal[k].tolist()
            c = self.config
            yaw += c.noise_std_rad * nyaw
            poses[k] = x + bx + c.noise_std_m * nx, y + by + c.noise_std_m * ny, se2.wrap(yaw)
            seers[k] = camera
        self._readings.append(
            TagReading(
                stamp_ns=time_ns,
                arrival_ns=time_ns + round(self.config.latency_s * NS_PER_S),
                poses=poses,
                camera=seers,
            )
        )

    def latest(self, now_ns: int) -> TagReading | None:
        """The newest reading that has arrived by now, None before the first."""
        for reading in reversed(self._readings):
            if reading.arrival_ns <= now_ns:
                return reading
        return None

    def save(self) -> tuple[dict[str, NDArray[Any]], dict[str, Any]]:
        """Everything that decides what comes next, readings on their way too: arrays and words."""
        kept, tags = list(self._readings), len(self._bodies)
        times = [(r.stamp_ns, r.arrival_ns) for r in kept]
        arrays = {
            "tags.bias": self._bias.copy(),
            "tags.times_ns": np.array(times, dtype=np.int64).reshape(-1, 2),
            "tags.poses": np.array([r.poses for r in kept]).reshape(-1, tags, 3),
            "tags.camera": np.array([r.camera for r in kept], dtype=np.int64).reshape(-1, tags),
        }
        words = {"count": self._count, "start_ns": self._start_ns}
        return arrays, {**words, "random": state.random_words(self._rng)}

    def load(self, arrays: Mapping[str, NDArray[Any]], words: Mapping[str, Any]) -> None:
        """Go on from ``save``; ``InvalidValueError`` if it is of other cameras."""
        if not np.array_equal(arrays["tags.bias"], self._bias):
            raise InvalidValueError("the state is of other ceiling cameras: their errors differ")
        state.restore_random(self._rng, words["random"])
        self._count, self._start_ns = words["count"], words["start_ns"]
        rows = zip(
            arrays["tags.times_ns"].tolist(),
            arrays["tags.poses"],
            arrays["tags.camera"],
            strict=True,
        )
        self._readings.clear()
        for (stamp_ns, arrival_ns), poses, camera in rows:
            self._readings.append(
                TagReading(stamp_ns=stamp_ns, arrival_ns=arrival_ns, poses=poses, camera=camera)
            )

    def _seer(self, data: mujoco.MjData, body: int, pose: tuple[float, float, float]) -> int:
        """The nearest camera that sees all corners of the tag on a body, -1 for none."""
        x, y, yaw = pose
        half, c, s = 0.5 * self.config.tag_side_m, math.cos(yaw), math.sin(yaw)
        corners = [
            (x + half * (u * c - v * s), y + half * (u * s + v * c))
            for u, v in ((1, 1), (1, -1), (-1, -1), (-1, 1))
        ]
        away = [math.hypot(cx - x, cy - y) for cx, cy in self.cameras.tolist()]
        near = [k for k in range(len(away)) if away[k] <= self.config.reach_m]
        for k in sorted(near, key=away.__getitem__):
            if all(self._is_clear(data, body, corner, k) for corner in corners):
                return k
        return -1

    def _is_clear(
        self, data: mujoco.MjData, body: int, place: tuple[float, float], camera: int
    ) -> bool:
        """Whether nothing stands between a place at the tag's height and a camera."""
        start = np.array([*place, self.config.tag_height_m])
        ray = np.array([*self.cameras[camera], self.config.height_m]) - start
        geom = np.zeros(1, dtype=np.int32)
        hit = mujoco.mj_ray(self._model, data, start, ray, SEEN_GROUPS, True, body, geom)
        return bool(hit < 0.0 or hit > 1.0)  # in lengths of the ray


def _grid(bounds: tuple[float, float, float, float], config: TagCameraConfig) -> Float:
    """(cameras, 2) places evenly over the floor, no farther apart than ``spacing_m``."""
    axes = []
    for low, high in ((bounds[0], bounds[2]), (bounds[1], bounds[3])):
        count = max(1, math.ceil((high - low) / config.spacing_m))
        axes.append([low + (high - low) * (k + 0.5) / count for k in range(count)])
    return np.array([(x, y) for x in axes[0] for y in axes[1]])

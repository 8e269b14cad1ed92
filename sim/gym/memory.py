# SPDX-License-Identifier: Apache-2.0
"""A wrapper that remembers what the scanner no longer sees: ranges all around the robot."""

from __future__ import annotations

from collections import deque
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from sim.core.checks import number, whole
from sim.gym.observation import Observation
from slam import se2
from slam.errors import InvalidValueError
from slam.frames import Float, LaserSpec

SECTORS = 72  # of a full turn: 5 degrees each
FAR_M = 4.0  # m from the robot's centre; what is farther is not told
REMEMBERED_S = 2.0  # s, age of the oldest scan that still counts
BEFORE_S = 0.5  # s, age of the scan in ``ranges_before``
_MOST_S = 60.0


class LidarMemory(gymnasium.Wrapper[Observation, Any, Observation, Any]):
    """``ranges`` all around the robot, from the present scan and what earlier ones saw.

    A scanner sees half a turn, and no longer what it has passed. The observation's ``pose`` moves
    earlier scans to where the robot is now. In the field of view only the present scan counts.

    The entries instead of `ranges` and `valid`:

    | key             | shape        | unit       | meaning                                       |
    |-----------------|--------------|------------|-----------------------------------------------|
    | `ranges`        | (n_sectors,) | m          | to the nearest point of each sector from the  |
    |                 |              |            | robot's centre, counter-clockwise from behind |
    | `ranges_before` | (n_sectors,) | m          | the same of the scan ``before_s`` ago alone   |
    | `velocity`      | (2,)         | m/s, rad/s | forward and turning, from the last two poses  |

    ``far_m`` is the range where nothing is nearer. Raises ``InvalidValueError`` for an environment
    without ``pose``, and for settings out of range.
    """

    def __init__(
        self,
        env: gymnasium.Env[Observation, Any],
        n_sectors: int = SECTORS,
        *,
        far_m: float = FAR_M,
        remembered_s: float = REMEMBERED_S,
        before_s: float = BEFORE_S,
    ) -> None:
        super().__init__(env)
        whole("n_sectors", n_sectors, 4, 3600)
        for name, value in (("remembered_s", remembered_s), ("before_s", before_s)):
            number(name, value)
            if not 0.0 <= value <= _MOST_S:
                raise InvalidValueError(f"{name} must lie in [0, {_MOST_S:g}], got {value}")
        number("far_m", far_m)
        if not far_m > 0.0:
            raise InvalidValueError(f"far_m must be > 0, got {far_m}")
        inner = env.observation_space
        if not isinstance(inner, spaces.Dict) or "pose" not in inner.spaces:
            raise InvalidValueError(
                f"LidarMemory needs observations with an entry 'pose': make the environment with "
                f"a goal or a pose_source, got {inner}"
            )
        self._n, self._far = int(n_sectors), float(far_m)
        self._ages = float(remembered_s), float(before_s)
        ring = spaces.Box(0.0, np.float32(far_m), (self._n,), np.float32)
        own = {
            "ranges": ring, "ranges_before": ring,
            "velocity": spaces.Box(-np.inf, np.inf, (2,), np.float32),
        }  # fmt: skip
        kept = {name: space for name, space in inner.spaces.items() if name != "valid"}
        self.observation_space = spaces.Dict(kept | own)
        self._seen: deque[tuple[float, Float, Float]] = deque()  # s, pose, points in its frame
        self._spec: LaserSpec | None = None

    def reset(self, **arguments: Any) -> tuple[Observation, dict[str, Any]]:
        """As of the wrapped environment; everything is forgotten."""
        observation, info = self.env.reset(**arguments)
        spec = self.env.unwrapped.simulation.spec  # type: ignore[attr-defined]
        if spec is not self._spec:
            self._spec = spec
            angles = spec.angle_min + spec.angle_increment * np.arange(spec.n_beams)
            x, y, turned = spec.T_robot_laser.tolist()
            self._rays = np.stack([np.cos(angles + turned), np.sin(angles + turned)])
            self._laser, self._edges = np.array([x, y, turned]), (angles[0], angles[-1])
        self._seen.clear()
        return self._told(observation), info

    def step(self, action: Any) -> tuple[Observation, Any, bool, bool, dict[str, Any]]:
        """As of the wrapped environment."""
        observation, reward, terminated, truncated, info = self.env.step(action)
        return self._told(observation), reward, terminated, truncated, info

    def _told(self, observation: Observation) -> Observation:
        now_s, pose = float(observation["time"]), observation["pose"]
        ranges = observation["ranges"]
        fits = (observation["valid"] != 0) & (ranges <= self._far)
        points = (self._rays[:, fits] * ranges[fits] + self._laser[:2, None]).T
        speed = self._speed(now_s, pose)
        while self._seen and self._seen[0][0] < now_s - max(self._ages) - 1e-6:
            self._seen.popleft()
        self._seen.append((now_s, pose.copy(), points))
        remembered_s, before_s = self._ages
        old = [self._from(pose, *row[1:]) for row in self._seen if row[0] >= now_s - remembered_s]
        behind = np.concatenate(old)
        past = next(row for row in self._seen if row[0] >= now_s - before_s - 1e-6)
        out = {name: value for name, value in observation.items() if name != "valid"}
        out["ranges"] = self._ring(np.concatenate([points, behind[self._hidden(behind)]]))
        out["ranges_before"] = self._ring(self._from(pose, *past[1:]))
        out["velocity"] = speed
        return out

    def _speed(self, now_s: float, pose: Float) -> NDArray[np.float32]:
        if not self._seen:
            return np.zeros(2, np.float32)
        then_s, before, _ = self._seen[-1]
        x, _, turned = se2.between(before, pose).tolist()
        return np.array([x, turned], np.float32) / np.float32(max(now_s - then_s, 1e-3))

    @staticmethod
    def _from(pose: Float, before: Float, points: Float) -> Float:
        """(n, 2) points of the frame ``before``, in that of ``pose``."""
        moved: Float = se2.transform(se2.between(pose, before), points)
        return moved

    def _hidden(self, points: Float) -> NDArray[np.bool_]:
        """Which points lie outside the present field of view."""
        x, y, turned = self._laser.tolist()
        angles = np.arctan2(points[:, 1] - y, points[:, 0] - x) - turned
        angles = np.mod(angles - self._edges[0], 2.0 * np.pi)
        hidden: NDArray[np.bool_] = angles > self._edges[1] - self._edges[0]
        return hidden

    def _ring(self, points: Float) -> NDArray[np.float32]:
        ring = np.full(self._n, self._far, np.float32)
        turns = np.arctan2(points[:, 1], points[:, 0]) / (2.0 * np.pi) + 0.5
        sectors = np.minimum((turns * self._n).astype(np.int64), self._n - 1)
        np.minimum.at(ring, sectors, np.hypot(points[:, 0], points[:, 1]).astype(np.float32))
        return ring

# SPDX-License-Identifier: Apache-2.0
"""Where an environment's robot believes it is: by a SLAM, by its wheels, or by the truth."""

import math
from typing import Any

import numpy as np
from gymnasium import spaces

from slam import se2
from slam.answers import judged
from slam.errors import InvalidValueError, SlamFailedError
from slam.frames import Float, Frame
from slam.replay import Track
from slam.system import SlamSystem, create, refuse_at_the_end

_FAR_M = 1e4  # poses are told up to here
_NO_GOAL: Float = np.zeros(2)


class PoseSource:
    """``source``: "truth", a SLAM's name or ``module:Class`` (each source has its own), or one.

    Raises ``InvalidValueError`` or ``UnknownNameError`` for anything else, and for a SLAM that runs
    at the end only.
    """

    def __init__(self, source: str | SlamSystem) -> None:
        self._name = source if isinstance(source, str) else type(source).__name__
        self._system: SlamSystem | None = None
        if isinstance(source, str):
            self._system = None if source == "truth" else create(source)
        elif isinstance(source, SlamSystem) and not isinstance(source, type):
            self._system = source
        else:
            raise InvalidValueError(
                "pose_source must be 'truth', the name of a SLAM, module:Class or a SlamSystem, "
                f"got {source!r}"
            )
        refuse_at_the_end(self._system, self._name, "an environment")
        self._track: Track | None = None
        self._start: Float = np.zeros(3)
        self._pose: Float = np.zeros(3)
        self._trusted = True

    @staticmethod
    def space(*, polar: bool = False) -> dict[str, spaces.Space[Any]]:
        """What ``observation`` adds; with ``polar`` range and bearing of the goal too."""
        low, high = np.array([-_FAR_M, -_FAR_M, -np.pi]), np.array([_FAR_M, _FAR_M, np.pi])
        believed: dict[str, spaces.Space[Any]] = {
            "pose": spaces.Box(low, high, (3,), np.float64),
            "trusted": spaces.Box(0, 1, (), np.uint8),
            "goal": spaces.Box(-3.0 * _FAR_M, 3.0 * _FAR_M, (2,), np.float64),
        }
        if polar:
            low, high = np.array([0.0, -np.pi]), np.array([5.0 * _FAR_M, np.pi])
            believed["goal_polar"] = spaces.Box(low, high, (2,), np.float64)
        return believed

    def reset(self, T_world_start: Float) -> None:
        """A new episode from there; the SLAM forgets everything."""
        self._start = T_world_start
        if self._system is not None:
            self._track = Track(name=self._name, system=self._system)
            try:
                with judged():
                    self._system.reset()
            except SlamFailedError as error:
                raise error.at(f"SLAM '{self._name}', reset()") from error

    def take(self, frame: Frame) -> None:
        """One more scan; ``SlamFailedError`` when the SLAM fails."""
        if self._track is None:
            assert frame.truth is not None  # the simulator always knows
            pose, self._trusted = se2.between(self._start, frame.truth), True
        else:
            estimate = self._track.take(frame.without_truth())
            pose, self._trusted = estimate.T_map_robot, estimate.converged
        x, y, theta = pose.tolist()
        x, y = min(max(x, -_FAR_M), _FAR_M), min(max(y, -_FAR_M), _FAR_M)
        self._pose = np.array([x, y, se2.wrap(theta)])

    def observation(
        self, goal: tuple[float, float] | None, *, polar: bool = False
    ) -> dict[str, Any]:
        """The believed pose in the frame of the start, and the goal (world) as seen from it."""
        there = _NO_GOAL
        if goal is not None:
            of_start = se2.transform(se2.inverse(self._start), np.array(goal))
            there = se2.transform(se2.inverse(self._pose), of_start)
        believed = {
            "pose": self._pose.copy(),
            "trusted": np.array(self._trusted, dtype=np.uint8),
            "goal": there.copy(),
        }
        if polar:
            x, y = there.tolist()
            believed["goal_polar"] = np.array([math.hypot(x, y), math.atan2(y, x)])
        return believed

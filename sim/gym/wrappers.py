# SPDX-License-Identifier: Apache-2.0
"""Wrappers that make an observation small enough to learn from, for one room and for many.

Whatever has no need of this project is Gymnasium's: ``gymnasium.wrappers.FrameStackObservation``
stacks what these give.
"""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.vector import VectorEnv, VectorObservationWrapper
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from sim.core.checks import number, whole
from sim.core.dynamism import Dynamism
from sim.gym.observation import Observation
from slam.errors import InvalidValueError

SECTORS = 36  # of 361 beams: 5 degrees each
NEAR_M = 4.0  # m, what is farther looks like this far
GOAL_M = 8.0  # m, likewise of the goal

Floats = NDArray[np.float32]


def pooled(ranges: NDArray[Any], n_sectors: int) -> NDArray[Any]:
    """(..., n_sectors) least of each group of neighbouring beams of (..., n), right to left.

    Groups differ by one beam at most, as those of ``numpy.array_split``.
    """
    n = ranges.shape[-1]
    longer, least = n % n_sectors, n // n_sectors
    starts = np.arange(n_sectors) * least + np.minimum(np.arange(n_sectors), longer)
    out: NDArray[Any] = np.minimum.reduceat(ranges, starts, axis=-1)
    return out


class _Pooling:
    """What both wrappers of that name do."""

    def __init__(self, space: spaces.Space[Any], n_sectors: int) -> None:
        beams = _entry(space, "ranges", "LidarMinPooling")
        whole("n_sectors", n_sectors, 1, beams.shape[0])
        self.n = int(n_sectors)
        most = float(beams.high.flat[0])
        kept = {k: v for k, v in space.items() if k != "valid"}  # type: ignore[attr-defined]
        kept["ranges"] = spaces.Box(0.0, np.float32(most), (self.n,), np.float32)
        self.space = spaces.Dict(kept)

    def __call__(self, seen: Observation) -> Observation:
        out = {name: value for name, value in seen.items() if name != "valid"}
        out["ranges"] = pooled(seen["ranges"], self.n)
        return out


class _Vector:
    """What both wrappers to a vector do."""

    def __init__(self, space: spaces.Space[Any], near_m: float) -> None:
        number("near_m", near_m)
        if not near_m > 0.0:
            raise InvalidValueError(f"near_m must be > 0, got {near_m}")
        n = _entry(space, "ranges", "GoalVector").shape[0]
        _entry(space, "goal_polar", "GoalVector")
        self.near_m = float(near_m)
        low = np.concatenate([np.zeros(n + 1), -np.ones(2)]).astype(np.float32)
        self.space = spaces.Box(low, np.ones(n + 3, np.float32), (n + 3,), np.float32)

    def __call__(self, seen: Observation) -> Floats:
        beams = np.minimum(seen["ranges"] / self.near_m, 1.0)
        away, bearing = seen["goal_polar"][..., 0], seen["goal_polar"][..., 1]
        goal = [np.minimum(away / GOAL_M, 1.0), np.cos(bearing), np.sin(bearing)]
        out: Floats = np.concatenate([beams, np.stack(goal, axis=-1)], axis=-1).astype(np.float32)
        return out


def _entry(space: spaces.Space[Any], name: str, who: str) -> spaces.Box:
    if isinstance(space, spaces.Dict) and isinstance(space.get(name), spaces.Box):
        box: spaces.Box = space[name]  # type: ignore[assignment]
        return box
    hint = ": make the environment with a goal" if name == "goal_polar" else ""
    raise InvalidValueError(f"{who} needs observations with an entry '{name}'{hint}, got {space}")


class LidarMinPooling(gymnasium.ObservationWrapper[Observation, Any, Observation]):
    """``ranges`` (n_sectors,) m, the least of each sector; `valid` is left out.

    A beam without a return counts as the scanner's greatest range. Raises ``InvalidValueError`` for
    less than one or more sectors than beams, and for an environment without ``ranges``.
    """

    def __init__(self, env: gymnasium.Env[Observation, Any], n_sectors: int = SECTORS) -> None:
        super().__init__(env)
        self._pooling = _Pooling(env.observation_space, n_sectors)
        self.observation_space = self._pooling.space

    def observation(self, observation: Observation) -> Observation:
        """Of the wrapped environment's ``observation``."""
        return self._pooling(observation)


class GoalVector(gymnasium.ObservationWrapper[Floats, Any, Observation]):
    """The observation as one ``Box(-1, 1, (n + 3,), float32)``, for a small network.

    Each range over ``near_m``, at most 1; range of the goal over 8 m, at most 1; cosine and sine
    of its bearing. Raises ``InvalidValueError`` for an environment without ``goal_polar``.
    """

    def __init__(self, env: gymnasium.Env[Observation, Any], near_m: float = NEAR_M) -> None:
        super().__init__(env)
        self._vector = _Vector(env.observation_space, near_m)
        self.observation_space = self._vector.space

    def observation(self, observation: Observation) -> Floats:
        """Of the wrapped environment's ``observation``."""
        return self._vector(observation)


class VectorLidarMinPooling(VectorObservationWrapper):
    """``LidarMinPooling`` of a vector environment."""

    def __init__(self, env: VectorEnv[Any, Any, Any], n_sectors: int = SECTORS) -> None:
        super().__init__(env)
        self._pooling = _Pooling(env.single_observation_space, n_sectors)
        self.single_observation_space = self._pooling.space
        self.observation_space = batch_space(self._pooling.space, env.num_envs)

    def observations(self, observations: Observation) -> Observation:
        """Of all rooms."""
        return self._pooling(observations)


class VectorGoalVector(VectorObservationWrapper):
    """``GoalVector`` of a vector environment: (num_envs, n + 3)."""

    def __init__(self, env: VectorEnv[Any, Any, Any], near_m: float = NEAR_M) -> None:
        super().__init__(env)
        self._vector = _Vector(env.single_observation_space, near_m)
        self.single_observation_space = self._vector.space
        self.observation_space = batch_space(self._vector.space, env.num_envs)

    def observations(self, observations: Observation) -> Floats:
        """Of all rooms."""
        return self._vector(observations)


def goal_rooms(
    id_: str, num_envs: int = 8, *, n_sectors: int = SECTORS, **settings: Any
) -> VectorEnv[Any, Any, Any]:
    """Rooms that a small network learns in fast, each seen as ``GoalVector(LidarMinPooling)``.

    settings  of ``sim.gym.vector.MobiliaVectorEnv``. Unless they say otherwise, a step takes one
              scan (``scans="last"``), the rooms step on two threads, and whoever steps them resets
              those that have ended (``autoreset_mode="disabled"``).
    """
    usual = {"autoreset_mode": "disabled", "n_threads": 2, "scans": "last"}
    rooms: Any = gymnasium.make_vec(
        id_, num_envs=num_envs, vectorization_mode="vector_entry_point", **{**usual, **settings}
    )
    return VectorGoalVector(VectorLidarMinPooling(rooms, n_sectors))


class DynamismCurriculum(gymnasium.Wrapper[Any, Any, Any, Any]):
    """Each episode has a dynamism of its own, drawn evenly from 0 to ``level``.

    Raise ``level`` (0 to 1) as the policy gets better. An option "dynamism" of a reset goes before.
    The draws are those of the seed of the last seeded reset.
    """

    def __init__(self, env: gymnasium.Env[Any, Any], level: float = 0.0) -> None:
        super().__init__(env)
        self.set_level(level)
        self._draws = np.random.default_rng()

    def set_level(self, level: float) -> None:
        """From the next reset on; ``InvalidValueError`` outside 0 to 1."""
        Dynamism.of(level)
        self.level = float(level)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """As of the wrapped environment."""
        if seed is not None:
            self._draws = np.random.default_rng([seed, 1])
        dynamism = self.level * float(self._draws.random())
        return self.env.reset(seed=seed, options={"dynamism": dynamism, **(options or {})})

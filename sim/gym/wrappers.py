# SPDX-License-Identifier: Apache-2.0
"""Wrappers that make an observation small enough to learn from, for one room and for many.

Whatever has no need of this project is Gymnasium's: ``gymnasium.wrappers.FrameStackObservation``
stacks what these give.
"""

from collections.abc import Callable
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.vector import VectorEnv
from gymnasium.wrappers import TransformObservation
from gymnasium.wrappers.vector import TransformObservation as OfMany
from numpy.typing import NDArray

from sim.core.dynamism import Dynamism
from sim.gym.observation import Observation
from slam.errors import InvalidValueError
from slam.shaped import Positive, shaped, whole

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


def LidarMinPooling(env: Any, n_sectors: int = SECTORS) -> Any:
    """One room or a vector of them with ``ranges`` (n_sectors,) m, the least of each sector.

    `valid` is left out: a beam without a return counts as the scanner's greatest range. Raises
    ``InvalidValueError`` for less than one or more sectors than beams, and for an environment
    without ``ranges``.
    """
    space = _space(env)
    beams = _entry(space, "ranges", "LidarMinPooling")
    whole("n_sectors", n_sectors, 1, beams.shape[0])
    n, most = int(n_sectors), np.float32(beams.high.flat[0])

    def look(seen: Observation) -> Observation:
        out = {name: value for name, value in seen.items() if name != "valid"}
        return {**out, "ranges": pooled(seen["ranges"], n)}

    kept = {name: one for name, one in space.items() if name != "valid"}
    kept["ranges"] = spaces.Box(0.0, most, (n,), np.float32)
    return _seen(env, look, spaces.Dict(kept))


def GoalVector(env: Any, near_m: float = NEAR_M) -> Any:
    """One room or a vector of them, seen as one ``Box(-1, 1, (n + 3,), float32)`` each.

    Each range over ``near_m``, at most 1; range of the goal over 8 m, at most 1; cosine and sine
    of its bearing. Raises ``InvalidValueError`` for an environment without ``goal_polar``.
    """
    shaped("near_m", near_m, Positive)
    n = _entry(_space(env), "ranges", "GoalVector").shape[0]
    _entry(_space(env), "goal_polar", "GoalVector")

    def look(seen: Observation) -> Floats:
        beams = np.minimum(seen["ranges"] / float(near_m), 1.0)
        away, bearing = seen["goal_polar"][..., 0], seen["goal_polar"][..., 1]
        goal = [np.minimum(away / GOAL_M, 1.0), np.cos(bearing), np.sin(bearing)]
        out: Floats = np.concatenate([beams, np.stack(goal, axis=-1)], axis=-1).astype(np.float32)
        return out

    low = np.concatenate([np.zeros(n + 1), -np.ones(2)]).astype(np.float32)
    return _seen(env, look, spaces.Box(low, np.ones(n + 3, np.float32), (n + 3,), np.float32))


def _space(env: Any) -> Any:
    """Of the observations of one room."""
    return env.single_observation_space if isinstance(env, VectorEnv) else env.observation_space


def _seen(env: Any, look: Callable[[Observation], Any], space: spaces.Space[Any]) -> Any:
    if isinstance(env, VectorEnv):
        return OfMany(env, look, single_observation_space=space)
    return TransformObservation(env, look, space)


def _entry(space: Any, name: str, who: str) -> spaces.Box:
    if isinstance(space, spaces.Dict) and isinstance(space.get(name), spaces.Box):
        box: spaces.Box = space[name]  # type: ignore[assignment]
        return box
    hint = ": make the environment with a goal" if name == "goal_polar" else ""
    raise InvalidValueError(f"{who} needs observations with an entry '{name}'{hint}, got {space}")


def goal_rooms(
    id_: str,
    num_envs: int = 8,
    *,
    n_sectors: int = SECTORS,
    autoreset_mode: str = "disabled",
    n_workers: int = 2,
    scans: str = "last",
    **settings: Any,
) -> VectorEnv[Any, Any, Any]:
    """Rooms that a small network learns in fast, each seen as ``GoalVector(LidarMinPooling)``.

    autoreset_mode  who begins the next episode of a room whose last one has ended: "disabled", you,
                    with ``reset(options={"reset_mask": terminated | truncated})`` before the next
                    step; "next_step", the room itself
    n_workers       processes that step the rooms
    scans           "last": a step takes one scan; "all": each of its scans
    settings        others of ``sim.gym.vector.MobiliaVectorEnv``

    Every reset puts the robot at the scene's start mark, at rest. With an id ``...Goal`` a goal is
    drawn on floor that it can reach, and furniture and people by the episode's seed. An episode is
    terminated at the goal, and with ``terminate_on_collision`` by a hard contact; it is truncated
    after ``time_limit_s``.
    """
    rooms: Any = gymnasium.make_vec(
        id_, num_envs=num_envs, vectorization_mode="vector_entry_point", n_workers=n_workers,
        autoreset_mode=autoreset_mode, scans=scans, **settings,
    )  # fmt: skip
    many: VectorEnv[Any, Any, Any] = GoalVector(LidarMinPooling(rooms, n_sectors))
    return many


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

# SPDX-License-Identifier: Apache-2.0
"""Odd calls of ``update``, ``step``, ``reset`` and constructors, for ``scripts.robustness.fuzz``.

A call may succeed or raise one of our errors. Frames are those of ``fuzz_frames``; arguments of an
environment are of any type. Each case draws from (seed, target, number) alone.
"""

from __future__ import annotations

import math
import warnings
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cache
from typing import Any

import numpy as np

from scripts.robustness.fuzz_frames import any_of, extreme, extreme_pose, frames
from sim.core.dynamism import Dynamism
from sim.gym.env import MobiliaEnv
from sim.gym.vector import MobiliaVectorEnv
from sim.sensors.lidar.models.lms221 import Lms221Config
from slam.errors import MobiliaError
from slam.system import SlamSystem, create

SLAMS = ("odometry", "shunting", "shunting-features", "occupancy", "ekf", "kiss-icp", "karto")
NOT_NUMBERS: tuple[Any, ...] = (
    None, "", "a", "1", b"x", [], {}, (), [1], [1, 2, 3, 4], {"x": 1}, object(), np.nan, math.inf,
    -math.inf, True, False, 5, -1, 0, 3.5, 2**31, 2**70, -(2**70), 1e9, 1e300, -1e300, 1 + 2j,
    np.int64(3), np.float32(0.5), np.array(1), np.zeros(2), np.zeros((2, 2)), np.full(2, np.nan),
    np.array(["a", "b"]), np.array([None, 1], dtype=object), (0.0, 0.0), (1e9, 1e9),
    (0.1, 0.2, 0.3), (np.inf, 0.0), ("1", "2"), (True, False), (1 + 1j, 0), "office",
    "shunting", "module:thing",
)  # fmt: skip


@dataclass(kw_only=True)
class Tally:
    """What a case came to: calls that were answered or refused, warnings, and foreign errors."""

    answered: int = 0
    refused: int = 0
    warned: Counter[str] = field(default_factory=Counter)
    findings: list[str] = field(default_factory=list)

    def add(self, other: Tally) -> None:
        """Count another case in."""
        self.answered += other.answered
        self.refused += other.refused
        self.warned += other.warned
        self.findings += other.findings

    def call(self, what: str, function: Callable[..., Any], *args: Any, **named: Any) -> Any:
        """The answer of one call; None where it was refused or failed."""
        try:
            out = function(*args, **named)
        except MobiliaError:
            self.refused += 1
            return None
        except Exception as error:  # noqa: BLE001  (any other error is what we look for)
            self.findings.append(f"{what}: {type(error).__name__}: {error}"[:300])
            return None
        self.answered += 1
        return out


@cache
def _slam(name: str) -> SlamSystem:
    return create(name)


def update(tally: Tally, name: str, rng: np.random.Generator) -> None:
    """A short stream into a SLAM that was just reset, and all that one may ask of it then."""
    system = _slam(name)
    system.reset()
    last: int | None = None
    for frame in frames(rng):
        estimate = tally.call("update", system.update, frame)
        if estimate is None:
            continue
        if estimate.stamp_ns != frame.stamp_ns or (last is not None and last >= frame.stamp_ns):
            tally.findings.append(f"update: answered {frame.stamp_ns} ns after {last} ns")
        last = frame.stamp_ns
    tally.call("trajectory", system.trajectory)
    tally.call("map", system.map)


@cache
def _room(kind: str) -> Any:
    made: Any = MobiliaEnv("arena") if kind == "single" else MobiliaVectorEnv(2, scene="arena")
    made.reset(seed=0, options={"n_chairs": 2})
    return made


def _action(rng: np.random.Generator, rooms: int) -> Any:
    shape = (2,) if rooms == 1 else (rooms, 2)
    odd = np.array([any_of(rng, (np.nan, np.inf, -np.inf, extreme(rng))) for _ in range(2 * rooms)])
    kinds: tuple[Callable[[], Any], ...] = (
        lambda: rng.uniform(-1.0, 1.0, shape),
        lambda: odd.reshape(shape),
        lambda: odd.reshape(shape).tolist(),
        lambda: np.full(shape, extreme(rng)),
        lambda: np.zeros(any_of(rng, ((), (0,), (1,), (3,), (2, 1), (1, 2), (2, 2, 2), (3, 2)))),
        lambda: rng.integers(-3, 3, shape),
        lambda: rng.uniform(-1.0, 1.0, shape).astype(any_of(rng, (bool, complex, object, "U"))),
        lambda: any_of(rng, NOT_NUMBERS),
        lambda: {0: 0.5, 1: 0.5},
        lambda: {0.25, 0.5},
        lambda: (v for v in (0.1, 0.2)),
    )  # fmt: skip
    with np.errstate(all="ignore"):
        return any_of(rng, kinds)()


def step(tally: Tally, name: str, rng: np.random.Generator) -> None:
    """Odd actions in a room, alone or one of two."""
    room = _room(name)
    for _ in range(4):
        if name == "single" and rng.random() < 0.05:
            room.close()
        out = tally.call("step", room.step, _action(rng, 1 if name == "single" else 2))
        seen = room.observation_space if out is not None else None
        if seen is not None and not seen.contains(out[0]):
            tally.findings.append("step: the observation lies outside its space")


def _options(rng: np.random.Generator) -> Any:
    names = (
        "goal", "start", "seeds", "scene", "n_chairs", "n_people", "dynamism", "moving_share",
        "rates", "scan_height_m", "resolution_deg", "noise_std_m", "laser", "reset_mask", "gaol", 3,
    )  # fmt: skip
    inner = {str(any_of(rng, ("n_chairs", "lidar", "door_rate", "x", "walls"))): _odd(rng)}
    values = (
        inner, inner, _odd(rng), extreme(rng), (extreme(rng), extreme(rng)), extreme_pose(rng),
        Lms221Config.ideal(), replace(Dynamism(), chair_push_rate=1e3),
    )  # fmt: skip
    if rng.random() < 0.15:
        return _odd(rng)
    return {any_of(rng, names): any_of(rng, values) for _ in range(int(rng.integers(1, 3)))}


def _odd(rng: np.random.Generator) -> Any:
    return any_of(rng, NOT_NUMBERS)


def reset(tally: Tally, name: str, rng: np.random.Generator) -> None:
    """Odd seeds and options; where they are taken, one step."""
    room = _room(name)
    seed = any_of(rng, (None, 0, 7, _odd(rng), [1, 2], [_odd(rng), 1], np.arange(2), -1, 2**70))
    options = any_of(rng, (None, _options(rng), _options(rng)))
    if tally.call("reset", room.reset, seed=seed, options=options) is not None:
        tally.call("step", room.step, room.action_space.sample())


def construct(tally: Tally, name: str, rng: np.random.Generator) -> None:
    """An environment with odd arguments; where it can be made: reset, step, picture, close."""
    fitting: dict[str, tuple[Any, ...]] = {
        "scene": ("arena", "module:thing", ":"), "dynamism": (0.5, 2.0), "laser": (None,),
        "scan_height_m": (0.36, 0.05, -1.0), "odometry": ("ideal", "x"), "labels": (True, 1),
        "time_limit_s": (60.0, 1e300, 5e-324), "terminate_on_collision": (True, "no"),
        "pose_source": ("truth", "odometry", "nobody", "pipe:"), "render_mode": ("map", "x"),
        "view": ("top", "x"), "render_size": ((64, 48), (0, 0), (1, 1), (10**6, 10**6), (-1, 5)),
    }  # fmt: skip
    if name == "vector":
        fitting |= {"num_envs": (1, 2, 0, 2.0), "n_threads": (1, 2, 0), "autoreset_mode": ("x",),
                    "frames": (True, "no")}  # fmt: skip
    chosen = [any_of(rng, list(fitting)) for _ in range(int(rng.integers(1, 3)))]
    given = {k: any_of(rng, fitting[k]) if rng.random() < 0.5 else _odd(rng) for k in chosen}
    if name == "single" and given.get("render_size") is not None:
        given["render_mode"] = "map"
    make = MobiliaEnv if name == "single" else MobiliaVectorEnv
    room = tally.call(f"make {given}", make, **({"scene": "arena"} | given))
    if room is None:
        return
    if rng.random() < 0.2:
        tally.call(f"step before reset {given}", room.step, room.action_space.sample())
    if tally.call(f"reset {given}", room.reset, seed=1) is not None:
        tally.call(f"step {given}", room.step, room.action_space.sample())
        tally.call(f"render {given}", room.render)
    tally.call("close", room.close)


GROUPS: dict[str, tuple[Callable[[Tally, str, np.random.Generator], None], tuple[str, ...]]] = {
    "update": (update, SLAMS),
    "step": (step, ("single", "vector")),
    "reset": (reset, ("single", "vector")),
    "make": (construct, ("single", "vector")),
}


def run(group: str, number: int, seed: int) -> Tally:
    """One case; its target takes turns within the group."""
    function, names = GROUPS[group]
    rng = np.random.default_rng([seed, list(GROUPS).index(group), number])
    tally = Tally()
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        function(tally, names[number % len(names)], rng)
    tally.warned.update(f"{w.category.__name__}: {w.message}" for w in caught)
    return tally

# SPDX-License-Identifier: Apache-2.0
"""Odd calls of ``update``, ``step``, ``reset`` and constructors, for ``scripts.robustness.fuzz``.

A call may succeed or raise one of our errors. Frames hold extreme values that their types allow;
arguments of an environment are of any type. Each case draws from (seed, target, number) alone.
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

from sim.core.dynamism import Dynamism
from sim.gym.env import MobiliaEnv
from sim.gym.vector import MobiliaVectorEnv
from sim.sensors.lidar.models.lms221 import Lms221Config
from slam.errors import MobiliaError
from slam.frames import Features, Float, Frame, LaserSpec, Odometry, Scan
from slam.guests.pipe import guarded
from slam.system import SlamSystem, create

SLAMS = ("odometry", "shunting", "shunting-features", "occupancy", "ekf", "kiss-icp", "karto")
PIPED = "pipe"  # odometry in a process of its own
FRAMES = 6  # of a case
LAST_NS = 2**63 - 1
SIZES = (0.0, 5e-324, 1e-300, 1e-30, 1e-9, 1e-3, 0.5, 1.0, 30.0, 999.0, 1e3, 1e6, 1e9, 1e12, 1e100)
EXTREMES = (*SIZES, 1e154, 1e300, 1.7e308)
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


def _pick(rng: np.random.Generator, values: Any) -> Any:
    return values[int(rng.integers(len(values)))]


def _number(rng: np.random.Generator, sizes: tuple[float, ...] = EXTREMES) -> float:
    return float(_pick(rng, sizes)) * (-1.0 if rng.random() < 0.5 else 1.0)


def _made(make: Callable[[], Any]) -> Any:
    """What ``make`` gives, tried until the type allows it."""
    while True:
        try:
            return make()
        except MobiliaError:
            continue


def _pose(rng: np.random.Generator) -> Float:
    return np.array([_number(rng), _number(rng), _number(rng)])


def spec(rng: np.random.Generator) -> LaserSpec:
    """A scanner that can be made, however absurd."""

    def make() -> LaserSpec:
        n = int(_pick(rng, (1, 2, 3, 4, 5, 7, 90, 181, 361, 1081, 5000)))
        if rng.random() < 0.03:
            n = 100_000
        turn = math.tau / n
        low = abs(_number(rng)) if rng.random() < 0.3 else 0.0
        offsets = _pick(rng, (np.zeros(0), np.linspace(0.0, 0.03, n), np.full(n, 1e9), None))
        mounted = _pick(rng, (np.zeros(3), np.array([0.2, 0.0, 0.0]), _pose(rng)))
        return LaserSpec(
            n_beams=n,
            angle_min=_pick(rng, (-math.pi / 2.0, -math.pi, 0.0, _number(rng))),
            angle_increment=_pick(rng, (turn, turn / 2.0, math.radians(0.5), 1e-9, turn * 1.04)),
            range_min=low,
            range_max=_pick(rng, (8.0, 80.0, 1e-6, 1e12, abs(_number(rng)))),
            beam_time_offsets=rng.uniform(0.0, 0.03, n) if offsets is None else offsets,
            T_robot_laser=mounted,
        )  # fmt: skip

    out: LaserSpec = _made(make)
    return out


def _ranges(rng: np.random.Generator, of: LaserSpec) -> np.ndarray[Any, np.dtype[np.float32]]:
    n, most = of.n_beams, min(of.range_max, 3e38)
    flat = _pick(rng, (np.nan, np.inf, 0.0, most, of.range_min, 1.0, 5.0, 1e-40, 3e38))
    kinds: tuple[Callable[[], Any], ...] = (
        lambda: np.full(n, min(flat, 3e38) if math.isfinite(flat) else flat),
        lambda: 3.0 + np.sin(np.arange(n) * 0.05),
        lambda: rng.uniform(0.0, min(most, 1e6), n),
        lambda: rng.uniform(0.0, 9.0, n).round(),
        lambda: rng.choice(np.array([np.nan, np.inf, 0.0, 1.0, most, 3e38]), n),
    )
    return np.asarray(_pick(rng, kinds)()).astype(np.float32)


def _covariance(rng: np.random.Generator, n: int) -> Float:
    mixed = [abs(_number(rng)) for _ in range(n)]
    alike = [abs(_number(rng))] * n
    out = np.diag(_pick(rng, (alike, mixed, [1e-4] * n)))
    if rng.random() < 0.3:  # fully correlated
        std = np.sqrt(np.diag(out))
        out = std[:, None] * std[None, :]
    return out


def _features(rng: np.random.Generator, stamp_ns: int) -> Features:
    def make() -> Features:
        k = int(_pick(rng, (0, 1, 2, 3, 30)))
        near = rng.uniform(-10.0, 10.0, (k, 2))
        points = near if rng.random() < 0.6 else np.array([_number(rng) for _ in range(2 * k)])
        if k > 1 and rng.random() < 0.2:
            points = np.tile(points.reshape(k, 2)[:1], (k, 1))
        covariances = np.array([_covariance(rng, 2) for _ in range(k)]).reshape(k, 2, 2)
        return Features(
            stamp_ns=stamp_ns, points_robot=points.reshape(k, 2), covariances=covariances
        )

    out: Features = _made(make)
    return out


def _odometry(rng: np.random.Generator, stamp_ns: int, before: Float) -> Odometry:
    def make() -> Odometry:
        step = np.array([rng.normal(0.0, 0.1), rng.normal(0.0, 0.1), rng.normal(0.0, 0.1)])
        if rng.random() < 0.15:
            step = np.array([_pick(rng, (900.0, 1001.0, 5e-324)), 0.0, _number(rng)])
        with np.errstate(over="ignore"):
            pose = before + step if rng.random() < 0.93 else _pose(rng)
        twist = None if rng.random() < 0.5 else np.array([_number(rng, SIZES[:11])] * 3)
        stated = None if rng.random() < 0.4 else _covariance(rng, 3)
        return Odometry(
            stamp_ns=stamp_ns, T_odom_robot=pose, increment_covariance=stated, twist=twist
        )

    out: Odometry = _made(make)
    return out


def _stamps(rng: np.random.Generator) -> list[Any]:
    step = int(_pick(rng, (1, 1_000_000, 26_666_667, 10**9, 10**18)))
    first = int(_pick(rng, (0, 1_700_000_000 * 10**9, -LAST_NS - 1, LAST_NS - 3 * step, -step)))
    stamps: list[Any] = [first + k * step for k in range(FRAMES)]
    if rng.random() < 0.3:
        k = int(rng.integers(FRAMES))
        stamps[k] = _pick(rng, (stamps[0], stamps[k - 1], -LAST_NS - 1, LAST_NS, 0, 2**70))
    if rng.random() < 0.2 and all(abs(s) <= LAST_NS for s in stamps):
        stamps = [np.int64(s) for s in stamps]
    return stamps


def frames(rng: np.random.Generator) -> list[Frame]:
    """A short stream; the scanner and what is sensed may change in the middle."""
    out: list[Frame] = []
    laser, before = spec(rng), np.zeros(3) if rng.random() < 0.8 else _pose(rng)
    kind = _pick(rng, ("scan", "scan", "features", "both", "none"))
    for stamp_ns in _stamps(rng):
        if rng.random() < 0.1:
            laser = spec(rng)
        if rng.random() < 0.1:
            kind = _pick(rng, ("scan", "features", "both", "none"))
        try:
            odometry = _odometry_at(rng, stamp_ns, before)
            scan = features = None
            if kind in ("scan", "both"):
                scan = Scan(stamp_ns=stamp_ns, ranges=_ranges(rng, laser), spec=laser)
            if kind in ("features", "both"):
                features = _features(rng, stamp_ns)
            out.append(Frame(stamp_ns=stamp_ns, odometry=odometry, scan=scan, features=features))
        except MobiliaError:  # a stamp that no frame can have
            continue
        before = odometry.T_odom_robot
    return out


def _odometry_at(rng: np.random.Generator, stamp_ns: int, before: Float) -> Odometry:
    Odometry(stamp_ns=stamp_ns, T_odom_robot=np.zeros(3))  # the stamp alone may be refused
    return _odometry(rng, stamp_ns, before)


@cache
def _slam(name: str) -> SlamSystem:
    return guarded("odometry") if name == PIPED else create(name)


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
    odd = np.array([_pick(rng, (np.nan, np.inf, -np.inf, _number(rng))) for _ in range(2 * rooms)])
    kinds: tuple[Callable[[], Any], ...] = (
        lambda: rng.uniform(-1.0, 1.0, shape),
        lambda: odd.reshape(shape),
        lambda: odd.reshape(shape).tolist(),
        lambda: np.full(shape, _number(rng)),
        lambda: np.zeros(_pick(rng, ((), (0,), (1,), (3,), (2, 1), (1, 2), (2, 2, 2), (3, 2)))),
        lambda: rng.integers(-3, 3, shape),
        lambda: rng.uniform(-1.0, 1.0, shape).astype(_pick(rng, (bool, complex, object, "U"))),
        lambda: _pick(rng, NOT_NUMBERS),
        lambda: {0: 0.5, 1: 0.5},
        lambda: {0.25, 0.5},
        lambda: (v for v in (0.1, 0.2)),
    )  # fmt: skip
    with np.errstate(all="ignore"):
        return _pick(rng, kinds)()


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
    inner = {str(_pick(rng, ("n_chairs", "lidar", "door_rate", "x", "walls"))): _odd(rng)}
    values = (inner, inner, _odd(rng), _number(rng), (_number(rng), _number(rng)), _pose(rng),
              Lms221Config.ideal(), replace(Dynamism(), chair_push_rate=1e3))  # fmt: skip
    if rng.random() < 0.15:
        return _odd(rng)
    return {_pick(rng, names): _pick(rng, values) for _ in range(int(rng.integers(1, 3)))}


def _odd(rng: np.random.Generator) -> Any:
    return _pick(rng, NOT_NUMBERS)


def reset(tally: Tally, name: str, rng: np.random.Generator) -> None:
    """Odd seeds and options; where they are taken, one step."""
    room = _room(name)
    seed = _pick(rng, (None, 0, 7, _odd(rng), [1, 2], [_odd(rng), 1], np.arange(2), -1, 2**70))
    options = _pick(rng, (None, _options(rng), _options(rng)))
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
    chosen = [_pick(rng, list(fitting)) for _ in range(int(rng.integers(1, 3)))]
    given = {k: _pick(rng, fitting[k]) if rng.random() < 0.5 else _odd(rng) for k in chosen}
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
    "update": (update, (*SLAMS, PIPED)),
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

# SPDX-License-Identifier: Apache-2.0
"""Frames with extreme values that their types allow, for ``scripts.robustness.fuzz_calls``."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from slam.errors import MobiliaError
from slam.frames import Features, Float, Frame, LaserSpec, Odometry, Scan

FRAMES = 6  # of a case
LAST_NS = 2**63 - 1
SIZES = (0.0, 5e-324, 1e-300, 1e-30, 1e-9, 1e-3, 0.5, 1.0, 30.0, 999.0, 1e3, 1e6, 1e9, 1e12, 1e100)
EXTREMES = (*SIZES, 1e154, 1e300, 1.7e308)


def any_of(rng: np.random.Generator, values: Any) -> Any:
    """One of ``values``."""
    return values[int(rng.integers(len(values)))]


def extreme(rng: np.random.Generator, sizes: tuple[float, ...] = EXTREMES) -> float:
    """One of ``sizes``, of either sign."""
    return float(any_of(rng, sizes)) * (-1.0 if rng.random() < 0.5 else 1.0)


def _made(make: Callable[[], Any]) -> Any:
    """What ``make`` gives, tried until the type allows it."""
    while True:
        try:
            return make()
        except MobiliaError:
            continue


def extreme_pose(rng: np.random.Generator) -> Float:
    """(3,) of these."""
    return np.array([extreme(rng), extreme(rng), extreme(rng)])


def spec(rng: np.random.Generator) -> LaserSpec:
    """A scanner that can be made, however absurd."""

    def make() -> LaserSpec:
        n = int(any_of(rng, (1, 2, 3, 4, 5, 7, 90, 181, 361, 1081, 5000)))
        if rng.random() < 0.03:
            n = 100_000
        turn = math.tau / n
        low = abs(extreme(rng)) if rng.random() < 0.3 else 0.0
        offsets = any_of(rng, (np.zeros(0), np.linspace(0.0, 0.03, n), np.full(n, 1e9), None))
        mounted = any_of(rng, (np.zeros(3), np.array([0.2, 0.0, 0.0]), extreme_pose(rng)))
        return LaserSpec(
            n_beams=n,
            angle_min=any_of(rng, (-math.pi / 2.0, -math.pi, 0.0, extreme(rng))),
            angle_increment=any_of(rng, (turn, turn / 2.0, math.radians(0.5), 1e-9, turn * 1.04)),
            range_min=low,
            range_max=any_of(rng, (8.0, 80.0, 1e-6, 1e12, abs(extreme(rng)))),
            beam_time_offsets=rng.uniform(0.0, 0.03, n) if offsets is None else offsets,
            T_robot_laser=mounted,
        )  # fmt: skip

    out: LaserSpec = _made(make)
    return out


def _ranges(rng: np.random.Generator, of: LaserSpec) -> np.ndarray[Any, np.dtype[np.float32]]:
    n, most = of.n_beams, min(of.range_max, 3e38)
    flat = any_of(rng, (np.nan, np.inf, 0.0, most, of.range_min, 1.0, 5.0, 1e-40, 3e38))
    kinds: tuple[Callable[[], Any], ...] = (
        lambda: np.full(n, min(flat, 3e38) if math.isfinite(flat) else flat),
        lambda: 3.0 + np.sin(np.arange(n) * 0.05),
        lambda: rng.uniform(0.0, min(most, 1e6), n),
        lambda: rng.uniform(0.0, 9.0, n).round(),
        lambda: rng.choice(np.array([np.nan, np.inf, 0.0, 1.0, most, 3e38]), n),
    )
    return np.asarray(any_of(rng, kinds)()).astype(np.float32)


def _covariance(rng: np.random.Generator, n: int) -> Float:
    mixed = [abs(extreme(rng)) for _ in range(n)]
    alike = [abs(extreme(rng))] * n
    out = np.diag(any_of(rng, (alike, mixed, [1e-4] * n)))
    if rng.random() < 0.3:  # fully correlated
        std = np.sqrt(np.diag(out))
        out = std[:, None] * std[None, :]
    return out


def _features(rng: np.random.Generator, stamp_ns: int) -> Features:
    def make() -> Features:
        k = int(any_of(rng, (0, 1, 2, 3, 30)))
        near = rng.uniform(-10.0, 10.0, (k, 2))
        points = near if rng.random() < 0.6 else np.array([extreme(rng) for _ in range(2 * k)])
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
            step = np.array([any_of(rng, (900.0, 1001.0, 5e-324)), 0.0, extreme(rng)])
        with np.errstate(over="ignore"):
            pose = before + step if rng.random() < 0.93 else extreme_pose(rng)
        twist = None if rng.random() < 0.5 else np.array([extreme(rng, SIZES[:11])] * 3)
        stated = None if rng.random() < 0.4 else _covariance(rng, 3)
        return Odometry(
            stamp_ns=stamp_ns, T_odom_robot=pose, increment_covariance=stated, twist=twist
        )

    out: Odometry = _made(make)
    return out


def _stamps(rng: np.random.Generator) -> list[Any]:
    step = int(any_of(rng, (1, 1_000_000, 26_666_667, 10**9, 10**18)))
    first = int(any_of(rng, (0, 1_700_000_000 * 10**9, -LAST_NS - 1, LAST_NS - 3 * step, -step)))
    stamps: list[Any] = [first + k * step for k in range(FRAMES)]
    if rng.random() < 0.3:
        k = int(rng.integers(FRAMES))
        stamps[k] = any_of(rng, (stamps[0], stamps[k - 1], -LAST_NS - 1, LAST_NS, 0, 2**70))
    if rng.random() < 0.2 and all(abs(s) <= LAST_NS for s in stamps):
        stamps = [np.int64(s) for s in stamps]
    return stamps


def frames(rng: np.random.Generator) -> list[Frame]:
    """A short stream; the scanner and what is sensed may change in the middle."""
    out: list[Frame] = []
    laser, before = spec(rng), np.zeros(3) if rng.random() < 0.8 else extreme_pose(rng)
    kind = any_of(rng, ("scan", "scan", "features", "both", "none"))
    for stamp_ns in _stamps(rng):
        if rng.random() < 0.1:
            laser = spec(rng)
        if rng.random() < 0.1:
            kind = any_of(rng, ("scan", "features", "both", "none"))
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

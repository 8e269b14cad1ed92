# SPDX-License-Identifier: Apache-2.0
"""Odd input succeeds or raises our own errors: damaged files, and extreme frames."""

import math
import re
from collections.abc import Iterator
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from slam.errors import MobiliaError
from slam.frames import Features, Frame, LaserSpec, Odometry, Scan
from slam.system import create
from tests.processes import python

pytestmark = pytest.mark.fuzz
Rng = np.random.Generator


KINDS = sorted(path.name for path in Path(__file__).with_name("corpus").iterdir())
MORE = ("plan", "lab", "named") * 4 + ("carmen", "rawlog", "robotlaser", "rawlaser") * 2


def test_damaged_and_hostile_files_are_read_or_refused_by_name():
    """The short version, more of it plans and text logs; 20 000 take a quarter of an hour."""
    kinds = [*KINDS, *MORE]
    words = ["--inputs", 6 * len(kinds), "--seed", 3, "--kinds", *kinds]
    said = python("-m", "tests.scripts.robustness.fuzz", *words).stdout
    read, refused = map(int, re.search(r"(\d+) read, (\d+) refused; 0 raw", said).groups())
    assert min(read, refused) > 40
    assert said.endswith("0 raw errors, 0 crashes, 0 over 10 s\n")


# -- frames ----------------------------------------------------------------------------------------

SLAMS = ("odometry", "shunting", "shunting-features", "occupancy", "ekf", "kiss-icp", "karto")
SIZES = (0.0, 5e-324, 1e-300, 1e-9, 1e-3, 0.5, 1.0, 30.0, 999.0, 1e3, 1e9, 1e100, 1e300, 1.7e308)
LAST_NS = 2**63 - 1


def one_of(rng: Rng, values: Any) -> Any:
    return values[int(rng.integers(len(values)))]


def extreme(rng: Rng) -> float:
    return float(one_of(rng, SIZES)) * float(rng.choice([-1.0, 1.0]))


def spec(rng: Rng) -> LaserSpec:
    n = int(one_of(rng, (1, 2, 3, 5, 90, 361, 1081)))
    turn = math.tau / n
    return LaserSpec(
        n_beams=n,
        angle_min=one_of(rng, (-math.pi / 2.0, -math.pi, 0.0, extreme(rng))),
        angle_increment=one_of(rng, (turn, turn / 2.0, math.radians(0.5), 1e-9, turn * 1.04)),
        range_min=one_of(rng, (0.0, 0.0, abs(extreme(rng)))),
        range_max=one_of(rng, (8.0, 80.0, 1e-6, 1e12, abs(extreme(rng)))),
        beam_time_offsets=one_of(rng, (np.zeros(0), np.linspace(0.0, 0.03, n), np.full(n, 1e9))),
        T_robot_laser=one_of(rng, (np.zeros(3), np.array([extreme(rng) for _ in range(3)]))),
    )


def covariance(rng: Rng, n: int) -> Any:
    flat = np.full((n, n), abs(extreme(rng)))  # fully correlated
    return one_of(rng, (flat, np.eye(n) * 1e-4, np.diag([abs(extreme(rng)) for _ in range(n)])))


def frames(rng: Rng) -> Iterator[Frame]:
    """A short stream; the scanner and what is sensed may change in the middle."""
    step = int(one_of(rng, (1, 26_666_667, 10**9, 10**18)))
    first = int(one_of(rng, (0, 1_700_000_000 * 10**9, -LAST_NS - 1, LAST_NS - 3 * step, -step)))
    laser, here = LaserSpec(n_beams=90, angle_min=0.0, angle_increment=0.05), np.zeros(3)
    for k in range(6):
        stamp_ns = one_of(rng, (first + k * step,) * 18 + (first, LAST_NS))
        with suppress(MobiliaError):  # what no frame can have
            laser = spec(rng) if rng.random() < 0.3 else laser
            far = rng.random() < 0.15
            ahead = np.array([extreme(rng), 0.0, extreme(rng)]) if far else rng.normal(0, 0.1, 3)
            odometry = Odometry(
                stamp_ns=stamp_ns,
                T_odom_robot=here + ahead,
                increment_covariance=one_of(rng, (None, covariance(rng, 3))),
            )
            here = odometry.T_odom_robot
            flat = one_of(rng, (np.nan, np.inf, 0.0, laser.range_min, 1.0, 1e-40, 3e38))
            ranges = one_of(rng, (np.full(laser.n_beams, flat), rng.uniform(0, 9, laser.n_beams)))
            scan = Scan(stamp_ns=stamp_ns, ranges=ranges.astype(np.float32), spec=laser)
            n = int(one_of(rng, (0, 1, 2, 30)))
            seen = Features(
                stamp_ns=stamp_ns,
                points_robot=one_of(rng, (rng.uniform(-9, 9, (n, 2)), np.full((n, 2), 1e9))),
                covariances=np.array([covariance(rng, 2) for _ in range(n)]).reshape(n, 2, 2),
            )
            given = one_of(rng, ({"scan": scan}, {"scan": scan}, {"features": seen}, {}))
            yield Frame(stamp_ns=stamp_ns, odometry=odometry, **given)


@cache
def slam(name: str) -> Any:
    return create(name)


@pytest.mark.filterwarnings("ignore")
def test_extreme_frames_are_answered_in_order_or_refused():
    outcomes = set()
    for number in range(21):
        system, last = slam(SLAMS[number % len(SLAMS)]), None
        system.reset()
        for frame in frames(np.random.default_rng([3, number])):
            try:
                estimate = system.update(frame)
            except MobiliaError:
                outcomes.add("refused")
                continue
            outcomes.add("answered")
            assert estimate.stamp_ns == frame.stamp_ns
            assert last is None or last < frame.stamp_ns
            last = frame.stamp_ns
        for ask in (system.trajectory, system.map):
            with suppress(MobiliaError):
                ask()
    assert outcomes == {"answered", "refused"}

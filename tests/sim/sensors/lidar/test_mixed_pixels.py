# SPDX-License-Identifier: Apache-2.0
"""Mixed pixels of scanners with a published spot, against the geometry of an edge."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from sim.sensors.lidar.device import LaserScanner, ScanResult
from sim.sensors.lidar.registry import names, scanner_of
from sim.sensors.lidar.scanner import Scanner, Spot

NEAR_M = 4.0  # from the laser, which is 2 cm ahead of the robot's axis
OUTERMOST = 0.8  # of the seven rays, as a share of the spot's half width


def bare(name: str) -> tuple[Spot, float, Scanner]:
    """(spot, m of a pulse, model) with the spot and its mixed pixels as the only errors."""
    model = scanner_of(name).scanner()
    only = replace(model.only("ideal"), spot=model.spot, mixed_pixels=model.mixed_pixels,
                   pulse_m=model.pulse_m)  # fmt: skip
    return model.spot, model.pulse_m, only


def look(room: SimpleNamespace, model: Scanner, world: str, seed: int = 0) -> ScanResult:
    built, data = room.build(world)
    lidar = LaserScanner(built, model, np.random.default_rng(seed))
    return lidar.observe(room.stepper(built, data), data)


def step(room: SimpleNamespace, edge_m: float, gap_m: float) -> str:
    """A face at ``NEAR_M`` that ends at y = ``edge_m``, right of it; a wall ``gap_m`` behind."""
    x = NEAR_M + 0.02
    near = room.wall(x + 0.01, edge_m - 2.0, 0.01, 2.0)
    return near + room.wall(x + gap_m + 0.05, 0.0, 0.05, 8.0)


def test_which_models_have_a_spot() -> None:
    """The data sheets of the others state none, and neither does who sets a generic one."""
    models = {name: scanner_of(name).scanner() for name in names() if name != "scanner"}
    assert {n for n, m in models.items() if m.mixed_pixels} == {"lms221", "tim561"}
    assert all((len(m.spot.weights) > 1) == m.mixed_pixels for m in models.values())


@pytest.mark.parametrize("gap_m", [0.3, 0.6])
def test_an_edge_mixes_within_the_footprint_and_nowhere_else(
    room: SimpleNamespace, gap_m: float
) -> None:
    """Where less than half of the spot is on the near face, the value lies between the two."""
    spot, _, model = bare("tim561")
    half_m = 0.5 * spot.size_at(NEAR_M)[0]
    within = beyond = 0
    for seed in range(24):
        edge_m = 0.3 + 0.001 * seed  # the beams at 4 m are 23 mm apart
        result = look(room, model, step(room, edge_m, gap_m), seed)
        angles = model.spec().angles
        ahead = np.abs(angles) < math.radians(25.0)
        beside = NEAR_M * np.tan(angles) - edge_m  # m of a beam's middle past the edge
        near, far = NEAR_M / np.cos(angles), (NEAR_M + gap_m) / np.cos(angles)
        ranges, mixed = result.ranges.astype(np.float64), result.mixed
        # Never outside the footprint, which the slant of a beam widens by 1 % here.
        outside = ahead & (np.abs(beside) > 1.02 * half_m)
        assert not mixed[outside].any()
        wanted = np.where(beside < 0.0, near, far)
        np.testing.assert_allclose(ranges[outside], wanted[outside], rtol=2e-3)
        # Nor where the middle of the spot, and so more than half of it, is on the near face.
        on_near = ahead & (beside < -0.01 * half_m)
        assert not mixed[on_near].any()
        np.testing.assert_allclose(ranges[on_near], near[on_near], rtol=2e-3)
        # Always where its outermost rays alone are: strictly between the two faces.
        on_far = ahead & (beside > 0.05 * half_m) & (beside < 0.98 * OUTERMOST * half_m)
        assert mixed[on_far].all()
        slack = 0.01
        assert (ranges[on_far] > near[on_far] - slack).all()
        assert (ranges[on_far] < far[on_far] + slack).all()
        within += int(on_far.sum())
        between = (ranges[on_far] > near[on_far] + 0.1) & (ranges[on_far] < far[on_far] - 0.1)
        beyond += int(between.sum())
    assert within >= 20
    assert beyond >= 0.2 * within  # not only the ends of the interval


def test_surfaces_further_apart_than_a_pulse_do_not_mix(room: SimpleNamespace) -> None:
    _, pulse_m, model = bare("tim561")
    for gap_m, mixes in ((pulse_m - 0.05, True), (pulse_m + 0.05, False)):
        seen = [look(room, model, step(room, 0.3 + 0.002 * k, gap_m), k) for k in range(12)]
        assert any(result.mixed.any() for result in seen) == mixes


def test_the_spot_of_the_tim561_is_wider_than_high(room: SimpleNamespace) -> None:
    """A bar 28 mm from the middle of the beam at 4 m: 32 mm to the side, 21 mm upwards."""
    spot, _, model = bare("tim561")
    wide, high = (0.5 * size for size in spot.size_at(NEAR_M))
    off_m = 0.5 * (high + OUTERMOST * wide)
    ahead = int(np.argmin(np.abs(model.spec().angles)))
    beside = f'<geom type="box" size=".01 1 1" pos="{NEAR_M + 0.03} {1.0 + off_m} .5"/>'
    above = f'<geom type="box" size=".01 1 .5" pos="{NEAR_M + 0.03} 0 {0.36 + 0.5 + off_m}"/>'
    assert math.isfinite(look(room, model, beside).ranges[ahead])
    assert not math.isfinite(look(room, model, above).ranges[ahead])
    lower = above.replace(f"{0.36 + 0.5 + off_m}", f"{0.36 + 0.5 + 0.7 * high}")
    assert math.isfinite(look(room, model, lower).ranges[ahead])

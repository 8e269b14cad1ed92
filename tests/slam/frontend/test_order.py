# SPDX-License-Identifier: Apache-2.0
"""Hits come by rising bearing, whatever the scanner did."""

import math

import numpy as np
import pytest

from slam.frames import LaserSpec, Scan
from slam.frontend.observations import _order, from_scan
from slam.shunting.slam import ShuntingConfig


def test_beams_are_sorted_as_a_stable_sort_does() -> None:
    rng = np.random.default_rng(0)
    for n in (1, 2, 3, 7, 64, 361):
        for bearings in (
            np.arange(n, dtype=float),
            -np.arange(n, dtype=float),
            rng.integers(0, 5, n).astype(float),
            np.arange(n) + rng.uniform(-2.0, 2.0, n),
        ):
            order, room = np.empty(n, np.int64), np.empty(n, np.int64)
            _order.py_func(bearings, order, room)  # type: ignore[attr-defined]
            np.testing.assert_array_equal(order, np.argsort(bearings, kind="stable"))


@pytest.mark.parametrize("omega", [3.0, -3.0])
def test_an_interlaced_scan_of_a_robot_that_turns_is_in_order(omega: float) -> None:
    offsets = np.where(np.arange(181) % 2 == 0, 0.0, 0.0133)
    spec = LaserSpec(
        n_beams=181,
        angle_min=-0.5 * math.pi,
        angle_increment=math.radians(1.0),
        beam_time_offsets=offsets,
    )
    ranges = np.full(181, 2.0, np.float32)
    ranges[40:44] = np.inf
    twist = np.array([0.0, 0.0, omega])
    seen = from_scan(Scan(stamp_ns=0, ranges=ranges, spec=spec), twist, ShuntingConfig())
    bearings = np.arctan2(seen.points_robot[:, 1], seen.points_robot[:, 0])
    assert len(bearings) == 177
    assert np.all(np.diff(bearings) >= 0.0)
    turned = np.delete(spec.angles + omega * spec.beam_time_offsets, range(40, 44))
    np.testing.assert_allclose(bearings, np.sort(turned), atol=1e-12)

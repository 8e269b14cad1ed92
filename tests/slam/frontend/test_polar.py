# SPDX-License-Identifier: Apache-2.0
"""The fast bearing is as near to the right one as those who decide by it assume."""

import math

import numpy as np
from numpy.typing import NDArray

from slam._jit import njit
from slam.frontend import polar


@njit
def bearings(points: NDArray[np.float64], out: NDArray[np.float64]) -> None:
    for k in range(len(points)):
        out[k] = polar.bearing(points[k, 0], points[k, 1])


def test_the_fast_bearing_is_never_off_by_what_is_allowed_for() -> None:
    turns = np.linspace(-math.pi, math.pi, 20_001)
    points = (
        np.column_stack([np.cos(turns), np.sin(turns)]) * np.geomspace(1e-6, 1e6, 20_001)[:, None]
    )
    out = np.empty(len(points))
    bearings(points, out)
    exact = np.array([math.atan2(y, x) for x, y in points.tolist()])
    assert np.abs(out - exact).max() < 0.6 * polar.BEARING_OFF


def test_the_fast_bearing_has_a_value_at_the_origin_and_on_the_axes() -> None:
    points = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 2.0], [-3.0, 0.0], [0.0, -4.0]])
    out = np.empty(len(points))
    bearings(points, out)
    assert np.allclose(out, [0.0, 0.0, 0.5 * math.pi, math.pi, -0.5 * math.pi], atol=1e-5)

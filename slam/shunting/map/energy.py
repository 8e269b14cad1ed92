# SPDX-License-Identifier: Apache-2.0
"""The energy of the network, Eqs. (9) to (11): never rises while input and view stay the same.

It proves that one update settles. It is no proof about SLAM: poses feed back into the input.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


def shunting_terms(x: Array, inputs: Array, decay: float) -> tuple[Array, Array]:
    """a(x) = 1 - x and b(x) = -A x / (1 - x) + I of Eq. (9)."""
    return 1.0 - x, -decay * x / (1.0 - x) + inputs


def _lateral(x: Array, mu: float, reach: float, threshold: float) -> Array:
    """Sum over neighbours of w_ij d(x_j) on a field (rows, columns), zero outside."""
    d = np.maximum(x - threshold, 0.0)
    total = np.zeros_like(d)
    edge = math.ceil(reach)
    padded = np.pad(d, edge)
    rows, columns = d.shape
    for dj in range(-edge, edge + 1):
        for di in range(-edge, edge + 1):
            distance = math.hypot(di, dj)
            if 0.0 < distance < reach:
                total += (mu / distance) * padded[
                    edge + dj : edge + dj + rows, edge + di : edge + di + columns
                ]
    return total


def energy(
    activities: ArrayLike,
    inputs: ArrayLike,
    *,
    decay: float,
    threshold: float,
    mu: float = 0.0,
    reach: float = 1.5,
) -> float:
    """V of Eq. (10) for a field (rows, columns) of activities x in [0, 1) under inputs I.

    V = - sum_i int b_i(e) d_i'(e) de - 1/2 sum_ij w_ij d_i d_j, with d(x) = max(x - sigma, 0), so
    the integral runs from sigma to max(x, sigma): int b = A (x + ln(1 - x)) + I x.
    """
    x = np.asarray(activities, dtype=np.float64)
    given = np.asarray(inputs, dtype=np.float64)
    upper = np.maximum(x, threshold)
    at_upper = decay * (upper + np.log1p(-upper)) + given * upper
    at_lower = decay * (threshold + math.log1p(-threshold)) + given * threshold
    d = np.maximum(x - threshold, 0.0)
    coupled = d * _lateral(x, mu, reach, threshold) if mu > 0.0 else np.zeros_like(d)
    return float(-(at_upper - at_lower).sum() - 0.5 * coupled.sum())

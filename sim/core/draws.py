# SPDX-License-Identifier: Apache-2.0
"""Random numbers inside compiled kernels: one 64-bit counter for each actor, nothing shared.

SplitMix64 (Steele, Lea, Flood 2014, "Fast splittable pseudorandom number generators"): the whole
state of a generator is one number, so it lives in the actor's arrays and is saved with them.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from slam._jit import uncounted

_GAMMA = np.uint64(0x9E3779B97F4A7C15)
_MIX1 = np.uint64(0xBF58476D1CE4E5B9)
_MIX2 = np.uint64(0x94D049BB133111EB)


@uncounted
def uniform(counters: NDArray[np.uint64], i: int) -> float:
    """A number in [0, 1) with 53 random bits from generator ``i``, which moves on by one."""
    counters[i] = counters[i] + _GAMMA
    z = counters[i]
    z = (z ^ (z >> np.uint64(30))) * _MIX1
    z = (z ^ (z >> np.uint64(27))) * _MIX2
    z = z ^ (z >> np.uint64(31))
    return float(z >> np.uint64(11)) * (1.0 / 9007199254740992.0)


@uncounted
def between(counters: NDArray[np.uint64], i: int, low: float, high: float) -> float:
    """Uniform in [low, high)."""
    return low + (high - low) * uniform(counters, i)


@uncounted
def waiting(counters: NDArray[np.uint64], i: int, rate: float) -> float:
    """Time to the next event of a Poisson process, s; infinite at rate 0. Always one draw."""
    u = 1.0 - uniform(counters, i)
    if rate <= 0.0:
        return math.inf
    return -math.log(u) / rate


@uncounted
def normal(counters: NDArray[np.uint64], i: int) -> float:
    """Standard normal (Box and Muller); always two draws."""
    u = 1.0 - uniform(counters, i)
    v = uniform(counters, i)
    return math.sqrt(-2.0 * math.log(u)) * math.cos(2.0 * math.pi * v)

# SPDX-License-Identifier: Apache-2.0
"""Named streams of randomness: one seed makes a whole run, each part of it draws from its own.

Adding a person must not move the chairs, and a noisier scanner must not change a walk. So every
part asks for a stream by name; ``Seeds(3, lidar=7)`` is run 3 with the scanner noise of run 7.
"""

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from slam._jit import uncounted
from slam.errors import InvalidValueError, UnknownNameError, meant

# Inside kernels a generator is one number in an array, saved with it: SplitMix64 (Steele,
# Lea, Flood 2014, "Fast splittable pseudorandom number generators").
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


# The position in this tuple is part of every recorded run: append, never reorder.
STREAMS = (
    "layout",
    "chairs",
    "people",
    "doors",
    "lidar",
    "odometry",
    "driving",
    "bins",
    "tags",  # of ceiling cameras, which are gone
    "loads",
    "change",
    "goals",
)


class Seeds:
    """The seeds of one run.

    seed       whole number >= 0, seeds every stream that is not overridden
    overrides  stream name -> its own seed, e.g. ``Seeds(3, chairs=4)``
    """

    def __init__(self, seed: int = 0, **overrides: int) -> None:
        self.seed = _checked("seed", seed)
        for name, value in overrides.items():
            _stream(name)
            _checked(name, value)
        self.overrides: Mapping[str, int] = {k: int(v) for k, v in sorted(overrides.items())}

    def sequence(self, stream: str) -> np.random.SeedSequence:
        """The seed sequence of a stream; the same object twice draws the same numbers."""
        seed = self.overrides.get(stream, self.seed)
        return np.random.SeedSequence(entropy=seed, spawn_key=(_stream(stream),))

    def generator(self, stream: str) -> np.random.Generator:
        """A fresh generator at the start of the stream."""
        return np.random.Generator(np.random.PCG64(self.sequence(stream)))

    def counters(self, stream: str, n: int) -> NDArray[np.uint64]:
        """(n,) start values of the compiled generators of ``sim.core.seeds``, one an actor."""
        state = self.sequence(stream).generate_state(n, np.uint64)
        return state.astype(np.uint64, copy=False)

    def integer(self, stream: str) -> int:
        """One whole number below 2**31 from the stream, for parts that take a plain seed."""
        return int(self.sequence(stream).generate_state(1, np.uint32)[0] >> 1)

    def record(self) -> dict[str, int]:
        """What to write down to get the same run again: ``Seeds(**record)``."""
        return {"seed": self.seed, **self.overrides}

    def __repr__(self) -> str:
        return f"Seeds({', '.join(f'{k}={v}' for k, v in self.record().items())})"


def _checked(name: str, value: int) -> int:
    if isinstance(value, bool) or not isinstance(value, (int, np.integer)) or value < 0:
        raise InvalidValueError(f"Seeds.{name} must be a whole number >= 0, got {value!r}")
    return int(value)


def _stream(name: str) -> int:
    if name not in STREAMS:
        hint = meant(name, STREAMS)
        raise UnknownNameError(
            f"no stream of randomness is called '{name}'.{hint} Known: {', '.join(STREAMS)}."
        )
    return STREAMS.index(name)

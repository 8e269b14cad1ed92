# SPDX-License-Identifier: Apache-2.0
"""Values of the wrong type are refused where they are set, by name, not where they first hurt."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import fields
from types import MappingProxyType
from typing import Any

import numpy as np

from slam.errors import InvalidValueError

MOST_LETTERS = 100  # of a name
FAR_M = 1e6  # no place of a scene is farther away
_NUMBER = (float, int, np.floating, np.integer)
# annotation -> what it says in words, and the types that will do
_PLAIN = MappingProxyType(
    {
        "float": ("a number", _NUMBER),
        "float | None": ("a number or None", (*_NUMBER, type(None))),
        "int": ("a whole number", (int, np.integer)),
        "bool": ("True or False", (bool,)),
        "str": ("a word", (str,)),
    }
)


def check_types(config: Any) -> None:
    """Raise ``InvalidValueError`` for a field of a dataclass that is no number, word or switch."""
    for item in fields(config):
        words, kinds = _PLAIN.get(str(item.type), ("", (object,)))
        value = getattr(config, item.name)
        if not isinstance(value, kinds) or (isinstance(value, bool) and words.startswith("a ")):
            raise InvalidValueError(
                f"{type(config).__name__}.{item.name} must be {words}, got {value!r}"
            )


def instance(name: str, value: Any, kind: type) -> None:
    """Raise ``InvalidValueError`` unless ``value`` is of that class."""
    if not isinstance(value, kind):
        raise InvalidValueError(f"{name} must be a {kind.__name__}, got {value!r}")


def one_of(name: str, value: Any, known: Sequence[str]) -> None:
    """Raise ``InvalidValueError`` unless ``value`` is one of these words."""
    if not isinstance(value, str) or value not in known:
        raise InvalidValueError(f"{name} must be one of {', '.join(known)}, got {value!r}")


def number(name: str, value: Any) -> None:
    """Raise ``InvalidValueError`` unless ``value`` is one finite number."""
    fits = isinstance(value, _NUMBER) and not isinstance(value, bool)
    if not (fits and -math.inf < value < math.inf):  # whole numbers may be beyond any float
        raise InvalidValueError(f"{name} must be a finite number, got {value!r}")


def whole_numbers(name: str, value: Any, meaning: str, most: int) -> tuple[int, int]:
    """Two whole numbers from 1 to ``most``; ``InvalidValueError`` naming what is none."""
    try:
        out = tuple(value)
    except TypeError:
        out = ()
    whole = all(isinstance(v, (int, np.integer)) and not isinstance(v, bool) for v in out)
    if len(out) != 2 or not whole or not all(1 <= v <= most for v in out):
        raise InvalidValueError(
            f"{name} must be {meaning}, whole numbers from 1 to {most}, got {value!r:.200}"
        )
    return int(out[0]), int(out[1])


def numbers(name: str, value: Any, n: int, meaning: str) -> tuple[float, ...]:
    """``n`` numbers; ``InvalidValueError`` naming what is none."""
    try:
        out = () if isinstance(value, (str, bytes)) else tuple(float(v) for v in value)
    except (TypeError, ValueError, OverflowError):
        out = ()
    if len(out) != n:
        raise InvalidValueError(f"{name} must be {meaning}, got {value!r}")
    return out


def check_within(config: Any, limits: Mapping[str, tuple[float, float]]) -> None:
    """``InvalidValueError`` for a field of that dataclass below its least or above its most."""
    for name, (least, most) in limits.items():
        value = getattr(config, name)
        if not least <= value <= most:
            raise InvalidValueError(
                f"{type(config).__name__}.{name} must be in {least:g}..{most:g}, got {value!r}"
            )


def whole(name: str, value: Any, least: int, most: int) -> None:
    """``InvalidValueError`` unless ``value`` is one whole number from ``least`` to ``most``."""
    if (
        isinstance(value, bool)
        or not isinstance(value, (int, np.integer))
        or (not least <= value <= most)
    ):
        raise InvalidValueError(
            f"{name} must be a whole number from {least} to {most}, got {value!r:.200}"
        )


def switch(name: str, value: Any) -> None:
    """``InvalidValueError`` unless ``value`` is True or False, NumPy's too."""
    if not isinstance(value, (bool, np.bool_)):
        raise InvalidValueError(f"{name} must be True or False, got {value!r}")


def word(what: str, value: Any) -> str:
    """A name; ``InvalidValueError`` for anything else."""
    if not isinstance(value, str) or len(value) > MOST_LETTERS or not value.isprintable():
        raise InvalidValueError(
            f"{what} must be a name of up to {MOST_LETTERS} letters, got {value!r:.60}"
        )
    return value


def three(what: str, value: Any) -> None:
    """Three finite numbers that a place may have; ``InvalidValueError`` for anything else."""
    if not isinstance(value, tuple) or len(value) != 3:
        raise InvalidValueError(f"{what} must be three numbers, got {value!r:.60}")
    for number in value:
        within(what, number, -FAR_M, FAR_M)


def within(what: str, value: Any, low: float, high: float) -> float:
    """A finite number in [low, high]; ``InvalidValueError`` for anything else."""
    if isinstance(value, bool) or not isinstance(value, int | float) or math.isnan(value):
        raise InvalidValueError(f"{what} must be a number, got {value!r:.60}")
    if not low <= value <= high:
        raise InvalidValueError(f"{what} must lie in [{low:g}, {high:g}], got {value!r:.60}")
    return float(value)

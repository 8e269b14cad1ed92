# SPDX-License-Identifier: Apache-2.0
"""Values of the wrong type are refused where they are set, by name, not where they first hurt."""

from __future__ import annotations

import math
from dataclasses import fields
from types import MappingProxyType
from typing import Any

import numpy as np

from slam.errors import InvalidValueError

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


def numbers(name: str, value: Any, n: int, meaning: str) -> tuple[float, ...]:
    """``n`` numbers; ``InvalidValueError`` naming what is none."""
    try:
        out = tuple(float(v) for v in value)
    except (TypeError, ValueError):
        out = ()
    if len(out) != n:
        raise InvalidValueError(f"{name} must be {meaning}, got {value!r}")
    return out


def check_not_negative(config: Any) -> None:
    """``InvalidValueError`` for a field of that dataclass that is negative or not finite."""
    for item in fields(config):
        value = getattr(config, item.name)
        if not (math.isfinite(value) and value >= 0.0):
            raise InvalidValueError(
                f"{type(config).__name__}.{item.name} must be finite and >= 0, got {value}"
            )

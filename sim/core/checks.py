# SPDX-License-Identifier: Apache-2.0
"""Arguments of the wrong type are refused where they are given, by name, not where they hurt."""

from typing import Annotated, Any

import numpy as np
from msgspec import Meta

from slam.errors import InvalidValueError
from slam.shaped import PRINTABLE, Number, instance, one_of, shaped, within

__all__ = [
    "FAR_M", "MOST_LETTERS", "instance", "number", "numbers", "one_of", "switch", "whole",
    "whole_numbers", "within", "word",
]  # fmt: skip
MOST_LETTERS = 100  # of a name
FAR_M = 1e6  # no place of a scene is farther away
Word = Annotated[str, Meta(max_length=MOST_LETTERS, pattern=PRINTABLE)]
Metres = Annotated[float, Meta(ge=-FAR_M, le=FAR_M)]
Point = tuple[Metres, Metres, Metres]


def number(name: str, value: Any) -> None:
    """Raise ``InvalidValueError`` unless ``value`` is one finite number."""
    shaped(name, value, Number)


def whole_numbers(name: str, value: Any, meaning: str, most: int) -> tuple[int, int]:
    """Two whole numbers from 1 to ``most``; ``InvalidValueError`` naming what is none."""
    try:
        first, second = (v.item() if isinstance(v, np.generic) else v for v in value)
    except (TypeError, ValueError):
        raise InvalidValueError(f"{name} must be {meaning}, got {value!r:.200}") from None
    one = Annotated[int, Meta(ge=1, le=most)]
    found: tuple[int, int] = shaped(name, (first, second), tuple[one, one])
    return found


def numbers(name: str, value: Any, n: int, meaning: str) -> tuple[float, ...]:
    """``n`` numbers; ``InvalidValueError`` naming what is none."""
    try:
        out = () if isinstance(value, (str, bytes)) else tuple(float(v) for v in value)
    except (TypeError, ValueError, OverflowError):
        out = ()
    if len(out) != n:
        raise InvalidValueError(f"{name} must be {meaning}, got {value!r}")
    return out


def whole(name: str, value: Any, least: int, most: int) -> None:
    """``InvalidValueError`` unless ``value`` is one whole number from ``least`` to ``most``."""
    shaped(name, value, Annotated[int, Meta(ge=least, le=most)])


def switch(name: str, value: Any) -> None:
    """``InvalidValueError`` unless ``value`` is True or False, NumPy's too."""
    shaped(name, value, bool)


def word(what: str, value: Any) -> str:
    """A name; ``InvalidValueError`` for anything else."""
    if not isinstance(value, str) or len(value) > MOST_LETTERS or not value.isprintable():
        raise InvalidValueError(
            f"{what} must be a name of up to {MOST_LETTERS} letters, got {value!r:.60}"
        )
    return value

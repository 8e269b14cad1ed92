# SPDX-License-Identifier: Apache-2.0
"""Words of options into levels: ``0:1:0.25``, or one by one."""

from __future__ import annotations

from typing import Any

from scripts.knobs import chosen
from scripts.many import named
from slam.errors import InvalidValueError

MAX_SWEEP = 1000


def sweep(text: str, option: str = "--dynamism-sweep") -> tuple[float, ...]:
    """``0:1:0.25`` -> (0, 0.25, 0.5, 0.75, 1); ``InvalidValueError`` for anything else."""
    try:
        start, stop, step = (float(word) for word in text.split(":"))
    except ValueError:
        raise InvalidValueError(f"{option} must be start:stop:step, got {text!r}") from None
    if not (step > 0.0 and 0.0 <= start <= stop <= 1.0):
        raise InvalidValueError(
            f"{option} needs step > 0 and 0 <= start <= stop <= 1, got {text!r}"
        )
    count = int((stop - start) / step + 1e-9) + 1
    if count > MAX_SWEEP:
        raise InvalidValueError(f"{option} {text!r}: {count} levels, at most {MAX_SWEEP}")
    return tuple(round(start + k * step, 9) for k in range(count))


def axis_levels(
    dynamism: list[str] | None, motion: list[str] | None, change: list[str] | None
) -> tuple[str, tuple[float, ...], dict[str, Any]]:
    """The axis, its levels and what is held, from the three options; default 0 to 1 dynamism."""
    given = {"dynamism": dynamism, "motion": motion, "change": change}
    axis, at, held = chosen(*(levels(values or [], f"--{k}") for k, values in given.items()))
    return axis, at or levels(["0:1:0.25"]), dict(held)


def levels(values: list[str], option: str = "--dynamism") -> tuple[float, ...]:
    """``["0:1:0.5"]`` or ``["0", "0.5,1"]`` -> (0, 0.5, 1)."""
    found: list[float] = []
    for word in named(values):
        if ":" in word:
            found += sweep(word, option)
            continue
        try:
            found.append(float(word))
        except ValueError:
            raise InvalidValueError(
                f"{option} must be numbers or start:stop:step, got {word!r}"
            ) from None
    return tuple(found)

# SPDX-License-Identifier: Apache-2.0
"""Whole numbers that are given as options."""

from __future__ import annotations

from typing import Any

from slam.errors import InvalidValueError


def whole(name: str, value: Any, least: int, most: int | None = None) -> None:
    """``InvalidValueError`` unless ``value`` is a whole number from ``least`` to ``most``."""
    bad = isinstance(value, bool) or not isinstance(value, int) or value < least
    if bad or (most is not None and value > most):
        wanted = f"a whole number >= {least}" if most is None else f"{least} to {most}"
        raise InvalidValueError(f"{name} must be {wanted}, got {value!r}")

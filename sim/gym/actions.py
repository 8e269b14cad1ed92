# SPDX-License-Identifier: Apache-2.0
"""What an environment takes for an action, and what it refuses."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from slam.errors import InvalidValueError


def clipped(action: Any) -> tuple[float, float]:
    """Forward speed and turn rate, each in [-1, 1]: finite numbers beyond are clipped.

    Raises ``InvalidValueError`` for what is not two numbers (words, objects and switches are none),
    and for NaN and infinities alike.
    """
    v, omega = map(float, _finite(action, (2,), "an action is two").tolist())
    return min(max(v, -1.0), 1.0), min(max(omega, -1.0), 1.0)


def of_rooms(actions: Any, n: int) -> NDArray[Any]:
    """(n, 2) finite numbers, one action for each of ``n`` rooms; else ``InvalidValueError``."""
    return _finite(actions, (n, 2), f"actions are ({n}, 2)")


def _finite(value: Any, shape: tuple[int, ...], words: str) -> NDArray[Any]:
    array = array_of(value)
    if array.shape != shape or array.dtype.kind not in "fiu" or not np.isfinite(array).all():
        raise InvalidValueError(f"{words} finite numbers in [-1, 1], got {value!r:.200}")
    return array


def array_of(value: Any) -> NDArray[Any]:
    """``np.asarray``; an empty array for what none can hold."""
    try:
        return np.asarray(value)
    except (TypeError, ValueError, OverflowError):  # ragged, for instance
        return np.zeros(0)

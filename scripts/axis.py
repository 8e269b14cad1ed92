# SPDX-License-Identifier: Apache-2.0
"""What a level of an experiment sets: the dynamism as a whole, or one of its two axes alone.

The one place that knows the names of the arguments.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Any

from slam.errors import InvalidValueError

BOTH = "both"
AXES = (BOTH, "motion", "change")


def at(axis: str, level: float, of: Callable[..., Any]) -> dict[str, float]:
    """Arguments of ``of`` (``Simulation``, ``Recipe``): with one axis the other stays at 0.

    Raises ``InvalidValueError`` for another axis, and for one that ``of`` cannot set apart.
    """
    if axis not in AXES:
        raise InvalidValueError(f"axis must be one of {', '.join(AXES)}, got {axis!r}")
    if axis == BOTH:
        return {"dynamism": level}
    if axis not in inspect.signature(of).parameters:
        raise InvalidValueError(f"{of.__name__} has no {axis}=: use the axis {BOTH!r}")
    return {"dynamism": 0.0, axis: level}

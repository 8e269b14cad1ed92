# SPDX-License-Identifier: Apache-2.0
"""How long a SLAM in a process of its own may take, and what it may not see."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

from slam.checked import is_number
from slam.errors import InvalidValueError


@dataclass(frozen=True, kw_only=True)
class Limits:
    """How long an answer may take, seconds of wall-clock time.

    scan_s   one scan
    first_s  its start, the first scan after it, a reset, the map and the final poses: compilers and
             great maps are no hang
    hidden   folders of results, which hold the truth: a command sees nothing in them
    """

    scan_s: float = 10.0
    first_s: float = 120.0
    hidden: tuple[Path, ...] = ()

    def __post_init__(self) -> None:
        for name in ("scan_s", "first_s"):
            value = getattr(self, name)
            if not is_number(value) or not 0.0 < value < math.inf:
                raise InvalidValueError(f"Limits.{name} must be > 0 s and finite, got {value!r}")

# SPDX-License-Identifier: Apache-2.0
"""SLAMs from outside, behind the same protocol: to compare with on the same frames.

The registered ones are optional (docs/bring_your_own.md: how to get each). Any other joins over a
pipe. ``Guest``, the base of those in Python, is imported when first asked for: it loads a compiler.
"""

from typing import TYPE_CHECKING, Any

from slam.guests.pipe import Limits, PipeSlam, guarded, limited

if TYPE_CHECKING:
    from slam.guests.guest import Guest

__all__ = ["Guest", "Limits", "PipeSlam", "guarded", "limited"]


def __getattr__(name: str) -> Any:
    """``Guest``."""
    if name != "Guest":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from slam.guests.guest import Guest

    return Guest

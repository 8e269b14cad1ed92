# SPDX-License-Identifier: Apache-2.0
"""Numbers that trackers no longer have, of maps that were saved while they had them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

_GROUPS = {
    "": ("range_error",),
    "tracking": ("quality", "verdict"),
    "frontend": ("surfaces", "view", "prior"),
    "features": ("corners",),
}
_NUMBERS: dict[str, tuple[str, ...]] = {
    "frontend": ("spacing_m", "least_weight"),
    "belief": ("confirmed_share",),
    "standing": (
        "better", "doubtful_m", "explains", "fallen", "fallen_s", "outvoted", "rival_gain",
        "rival_m", "rival_points", "rival_rad", "rival_s", "rival_scans", "undecided_s",
    ),
    "tracking.relocalise": (
        "alias", "alone", "denied_here", "drift_m", "drift_rad", "enough", "enough_last",
        "enough_later", "farthest_m", "farthest_rad", "few_vote", "hopeless", "last", "later",
        "on_m", "on_rad", "on_s", "pushed_mps", "pushed_radps", "scans", "slipped_m",
        "slipped_rad", "sure",
    ),
}  # fmt: skip

_LEFT = {"frontend.bias": ("per_m", "per_rad")}  # all others are gone


def updated(words: Any) -> Any:
    """The tree of a config as it would be saved today; what is no tree is given back as it is.

    Of ``freeze_below`` only 0 has a meaning today: a pose that is never doubted.
    """
    if not isinstance(words, Mapping):
        return words
    found = _without(words, "")
    if "freeze_below" in found:
        freeze_below = found.pop("freeze_below")
        if freeze_below == 0.0:
            found.setdefault("carried_per_h", 0.0)
    return found


def _without(words: Mapping[str, Any], path: str) -> dict[str, Any]:
    gone = (*_GROUPS.get(path, ()), *_NUMBERS.get(path, ()))
    return {
        name: _without(value, f"{path}.{name}".lstrip(".")) if isinstance(value, Mapping) else value
        for name, value in words.items()
        if name not in gone and name in _LEFT.get(path, words)
    }

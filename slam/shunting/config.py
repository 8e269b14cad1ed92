# SPDX-License-Identifier: Apache-2.0
"""The numbers of the shunting SLAM: the tree of every tracker, all of which it uses."""

from __future__ import annotations

from dataclasses import dataclass

from slam.tracker.config import TrackerConfig


@dataclass(frozen=True, kw_only=True)
class ShuntingConfig(TrackerConfig):
    """As ``TrackerConfig``; ``robust()`` is the default, ``paper()`` the paper as printed."""

# SPDX-License-Identifier: Apache-2.0
"""The trees of trackers: recipes and saved maps hold their paths and digests."""

from __future__ import annotations

import pytest

from slam.grid.config import OccupancyConfig
from slam.shunting.config import ShuntingConfig
from slam.tracker.config import TrackerConfig

TOP = [
    "cell_m", "decay_per_s", "lateral_sum", "lateral_reach_cells", "threshold", "trace_s",
    "short_term_weight", "reward", "reward_exponent", "objective", "range_m", "freeze_below",
    "frontend", "map", "matching", "tracking", "loops", "uncertainty", "features", "standing",
    "range_error",
]  # fmt: skip


@pytest.mark.parametrize(
    ("tree", "more", "digests"),
    [
        (ShuntingConfig, [], ("9e067d843682", "109a56f81e12")),
        (OccupancyConfig, ["grid"], ("319e780a1b16", "672901a12eb7")),
    ],
)
def test_a_tree_keeps_its_paths_its_order_and_its_digest(
    tree: type[TrackerConfig], more: list[str], digests: tuple[str, str]
) -> None:
    assert list(tree().as_words()) == TOP + more
    assert (tree.robust().sha256()[:12], tree.paper().sha256()[:12]) == digests

# SPDX-License-Identifier: Apache-2.0
"""The trees of trackers: recipes and saved maps hold their paths and digests."""

import pytest

from slam.errors import UnknownNameError
from slam.grid.occupancy import OccupancyConfig
from slam.shunting.slam import ShuntingConfig
from slam.tracker.config import TrackerConfig

TOP = [
    "cell_m", "decay_per_s", "lateral_sum", "lateral_reach_cells", "threshold", "trace_s",
    "short_term_weight", "reward", "reward_exponent", "objective", "range_m", "carried_per_h",
    "frontend", "map", "matching", "tracking", "belief", "loops", "uncertainty", "features",
    "standing",
]  # fmt: skip


@pytest.mark.parametrize(
    ("tree", "more", "digests"),
    [
        (ShuntingConfig, [], ("a631069871a0", "e80ba1c14080")),
        (OccupancyConfig, ["grid"], ("a4924042b5b7", "45e1fb746d2c")),
    ],
)
def test_a_tree_keeps_its_paths_its_order_and_its_digest(
    tree: type[TrackerConfig], more: list[str], digests: tuple[str, str]
) -> None:
    assert list(tree().as_words()) == TOP + more
    assert (tree.robust().sha256()[:12], tree.paper().sha256()[:12]) == digests


@pytest.mark.parametrize(
    ("path", "instead"),
    [
        ("freeze_below", "carried_per_h"),
        ("tracking.freeze_below", "carried_per_h"),
        ("tracking.quality.give_up_s", "tracking.give_up_s"),
    ],
)
def test_a_number_that_is_gone_is_refused_by_the_name_of_what_took_its_place(
    path: str, instead: str
) -> None:
    with pytest.raises(UnknownNameError, match=f"no '{path}' any more; set '{instead}'"):
        ShuntingConfig().changed({path: 0.0})
    assert instead in {row.path for row in ShuntingConfig().rows()}

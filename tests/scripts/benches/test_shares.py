# SPDX-License-Identifier: Apache-2.0
"""The shares of an episode are shares: none below zero, all of them one."""

from __future__ import annotations

import pytest

from scripts.benches.dataset import shares


@pytest.mark.parametrize("labelled", [0.9, 1.0, 1.2])  # 0.9: the clock says labels cost less
def test_shares_are_none_below_zero_and_add_up(labelled: float):
    found = shares(1.0, labelled, 0.15)
    assert list(found) == ["simulation", "labels", "writing"]
    assert min(found.values()) >= 0.0
    assert sum(found.values()) == pytest.approx(1.0)
    assert found["labels"] == pytest.approx(max(0.0, 1.0 - 1.0 / labelled) * 0.85)

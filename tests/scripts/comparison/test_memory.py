# SPDX-License-Identifier: Apache-2.0
"""Peak memory: what is touched between ``begin`` and ``end`` counts, freed or not."""

from __future__ import annotations

import math
import mmap

import numpy as np
import pytest

from scripts.comparison.entry import PeakMemory

MB = 1_000_000


def hold_for_a_moment(mb: int) -> None:
    """Straight from the system: what ``malloc`` gets, it may keep."""
    if mb:
        with mmap.mmap(-1, mb * MB) as pages:
            np.frombuffer(pages, dtype=np.uint8)[:] = 1


def grown(before_mb: int, within_mb: int) -> float:
    """MB grown where so much is held for a moment before, and so much within."""
    memory = PeakMemory()
    hold_for_a_moment(before_mb)
    memory.begin()
    hold_for_a_moment(within_mb)
    memory.end()
    if math.isnan(memory.growth_mb):
        pytest.skip("the kernel does not say")
    return memory.growth_mb


def test_what_an_update_holds_counts_even_for_a_moment():
    assert grown(0, 80) == pytest.approx(80.0, abs=12.0)


def test_what_is_held_elsewhere_does_not():
    assert grown(80, 8) < 30.0

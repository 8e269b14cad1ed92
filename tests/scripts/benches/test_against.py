# SPDX-License-Identifier: Apache-2.0
"""Ratios to others: the interval is of the pairs, and the bare rays are those of the scan."""

import numpy as np
import pytest

from scripts.benches import against
from scripts.benches.world import scan


def test_a_machine_that_slows_down_moves_the_times_and_not_the_ratio():
    slower = np.linspace(1.0, 3.0, against.PAIRS)
    row = against.compared("x", (list(slower), list(4.0 * slower)), 1e3, "ms", "")
    assert row["ours"] == pytest.approx(2000.0)
    assert (row["low"], row["ratio"], row["high"]) == pytest.approx((4.0, 4.0, 4.0))


def test_the_interval_holds_the_median_in_96_of_100_tables():
    rng = np.random.default_rng(0)
    pairs = rng.exponential(size=(2000, against.PAIRS))  # median log 2
    rows = [against.compared("x", ([1.0] * against.PAIRS, list(p)), 1.0, "", "") for p in pairs]
    held = np.mean([row["low"] <= np.log(2.0) <= row["high"] for row in rows])
    assert held == pytest.approx(0.965, abs=0.015)


def test_mujocos_bare_rays_meet_what_the_scan_meets(monkeypatch: pytest.MonkeyPatch):
    world, laser = against.at_rest("arena")
    found, seen = scan(laser, world), []
    cast = against.mujoco.mj_multiRay
    monkeypatch.setattr(against.mujoco, "mj_multiRay", lambda *a: (cast(*a), seen.append(a)))
    against.bare_rays(world, laser, 1)()
    assert np.array_equal(seen[0][7], found.geoms)
    assert np.array_equal(seen[0][8], found.true_ranges)

# SPDX-License-Identifier: Apache-2.0
"""What matches were like so far, and which scans go on from those before."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from slam.tracker.matching.config import UsualConfig
from slam.tracker.matching.matcher import Match, Usual

CONFIG = UsualConfig()
STEP_S = 0.2
LONG = round(10.0 * CONFIG.fallen_s / STEP_S)  # scans after which nothing of before is remembered


def match(matched: float = 0.8, *, overlapped: float = 0.8) -> Match:
    return Match(
        T_map_robot=np.zeros(3), information=np.eye(3), matched=matched, score=0.0, tau=1.0,
        overlapped=overlapped,
    )  # fmt: skip


def seeing(in_view: float) -> Any:
    """Observations, as far as they are asked."""
    return SimpleNamespace(in_view=in_view)


ALL = seeing(1.0)


def settled(of: Match, step_s: float = STEP_S, scans: int = LONG) -> Usual:
    usual = Usual(CONFIG)
    for _ in range(scans):
        usual.learn(of)
        usual.follow(of, ALL, step_s)
    return usual


def test_the_usual_match_is_the_median_of_the_latest() -> None:
    assert Usual(CONFIG).match == 1.0  # before anything is known all is expected to match
    usual = Usual(replace(CONFIG, remembered=3), [0.1])
    assert usual.match == 0.1
    for matched in (0.9, 0.5, 0.7, 0.8):
        usual.learn(match(matched))
    assert list(usual.matches) == [0.5, 0.7, 0.8]
    assert usual.match == 0.7


def test_a_share_is_of_what_the_second_before_matched() -> None:
    usual = settled(match(overlapped=0.8))
    assert usual.share(match(overlapped=0.8), ALL) == pytest.approx(1.0, abs=1e-3)
    assert usual.share(match(overlapped=0.2), ALL) == pytest.approx(0.25, abs=1e-3)
    usual.learn(match(overlapped=0.1))  # the map took it in: that alone says nothing
    assert usual.share(match(overlapped=0.8), ALL) == pytest.approx(1.0, abs=1e-3)
    for _ in range(LONG):  # the scans that follow are what goes on
        usual.follow(match(overlapped=0.2), ALL, STEP_S)
    assert usual.share(match(overlapped=0.2), ALL) == pytest.approx(1.0, abs=1e-3)


@pytest.mark.parametrize("fast_s", [0.027, 0.1])
def test_a_second_is_forgotten_alike_at_any_rate(fast_s: float) -> None:
    """Where scans are not so rare that one may replace most of what is remembered."""
    shares = []
    for step_s in (fast_s, 2.0 * fast_s):
        usual = settled(match(overlapped=0.8), step_s, round(10.0 * CONFIG.fallen_s / step_s))
        for _ in range(round(CONFIG.fallen_s / fast_s / 2.0) * (2 if step_s == fast_s else 1)):
            usual.follow(match(overlapped=0.4), ALL, step_s)
        shares.append(usual.share(match(overlapped=0.4), ALL))
    assert shares[0] == pytest.approx(shares[1], rel=1e-6)
    assert 0.5 < shares[0] < 1.0


def test_what_was_not_in_view_before_need_not_go_on() -> None:
    """A robot that turns into a part of a room that no scan has seen has not been carried off."""
    usual = settled(match(overlapped=0.8))
    turned = match(overlapped=0.2)
    assert usual.share(turned, ALL) < 0.3
    assert usual.share(turned, seeing(0.25)) == pytest.approx(1.0, abs=1e-3)
    assert usual.share(match(overlapped=0.9), seeing(0.5)) < 1.3


def test_the_first_scan_in_a_loaded_map_is_to_go_on_from_it() -> None:
    usual = Usual(CONFIG)
    usual.know([])  # of an empty one
    assert usual.share(match(), ALL) > 1.0
    usual.know([0.7, 0.8, 0.8])
    assert usual.share(match(overlapped=0.8), ALL) == pytest.approx(1.0)
    assert usual.share(match(overlapped=0.1), ALL) == pytest.approx(0.125)

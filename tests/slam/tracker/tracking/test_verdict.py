# SPDX-License-Identifier: Apache-2.0
"""Lost, or the map outdated: what stands decides."""

from __future__ import annotations

import math

import numpy as np
import pytest

from scripts.experiments.verdict import area
from slam.frames import Frame, Scan
from slam.shunting import ShuntingConfig, ShuntingSlam
from slam.tracker.tracking.config import VerdictConfig
from slam.tracker.tracking.verdict import BLIND, LOST, OUTDATED, TRACKING, Verdict
from tests.world2d import Drive, World2D, arena, frames, going_on, rectangle

FAST = ShuntingConfig(cell_m=0.05)
TURN = Drive((0.0, 0.0, 0.0), ((0.0, 0.8, 12.0),))


def furnished(shift: float) -> World2D:
    """A room with five boxes round its middle, moved by so much."""
    spots = np.arange(5) * math.tau / 5.0 + shift
    x, y = 1.8 * np.cos(spots), 1.8 * np.sin(spots)
    boxes = [rectangle(a - 0.2, b - 0.2, a + 0.2, b + 0.2) for a, b in zip(x, y, strict=True)]
    return World2D(np.vstack([arena(), *boxes]))


def said(system: ShuntingSlam, stream: list[Frame]) -> list[tuple[str, float]]:
    words = [system.update(frame.without_truth()).diagnostics for frame in stream]
    return [(w["verdict"], w["p_lost"]) for w in words]


def mapped(world: World2D) -> tuple[ShuntingSlam, Frame]:
    before = frames(world, TURN, rate_hz=5.0, seed=3)
    system = ShuntingSlam(FAST)
    assert {word for word, _ in said(system, before)} == {TRACKING}
    return system, before[-1]


def test_where_everything_moved_but_the_walls_the_map_is_outdated_and_the_robot_is_not_lost():
    system, last = mapped(furnished(0.0))
    pose = system.trajectory().poses[-1]
    stays = Drive(tuple(pose.tolist()), ((0.0, 0.0, 2.0),))
    verdicts, stream = [], frames(furnished(0.6), stays, rate_hz=5.0, seed=3)
    for frame in going_on(stream, last):
        estimate = system.update(frame.without_truth())
        assert estimate.diagnostics["state"] != "lost"
        verdicts.append(estimate.diagnostics["verdict"])
        np.testing.assert_allclose(estimate.T_map_robot[:2], pose[:2], atol=0.05)
    assert verdicts[0] == OUTDATED
    assert LOST not in verdicts


def test_a_carried_robot_is_lost_until_it_is_found() -> None:
    world = World2D(np.vstack([arena(), rectangle(-2.0, 1.0, -1.2, 2.2)]))
    system, last = mapped(world)
    moving = Drive((2.0, -2.0, 2.0), ((0.2, 0.3, 4.0),))
    states = []
    for frame in going_on(frames(world, moving, rate_hz=5.0, seed=7), last):
        words = system.update(frame.without_truth()).diagnostics
        states.append(words["state"])
        if words["state"] in ("frozen", "lost"):
            assert words["verdict"] == LOST
            assert words["p_lost"] > 0.5
        else:
            assert words["verdict"] == TRACKING
    assert "lost" in states
    assert states[-1] == "tracking"


def test_a_scan_without_a_return_is_blind() -> None:
    system, last = mapped(World2D(arena()))
    assert last.scan is not None
    dark = Scan(
        stamp_ns=last.stamp_ns, ranges=np.full_like(last.scan.ranges, np.nan), spec=last.scan.spec
    )
    blind = [Frame(stamp_ns=last.stamp_ns, odometry=last.odometry, scan=dark)]
    assert said(system, going_on(blind, last))[0][0] == BLIND


@pytest.mark.parametrize(
    ("here", "elsewhere", "word"),
    [(1.0, 0.0, TRACKING), (0.7, 0.0, OUTDATED), (0.2, 0.0, LOST), (0.6, 0.9, LOST)],
)
def test_what_stands_here_and_elsewhere_decides(here: float, elsewhere: float, word: str) -> None:
    verdict = Verdict(VerdictConfig())
    verdict.take(here, elsewhere)
    assert verdict.word == word
    surer = Verdict(VerdictConfig())
    surer.take(here - 0.1, elsewhere)
    assert surer.p_lost > verdict.p_lost
    denied = Verdict(VerdictConfig())
    denied.take(here, elsewhere, ratio=20.0)
    assert (denied.word == LOST) == (here < 0.8)  # odometry alone does not outweigh what stands
    slipped = Verdict(VerdictConfig())
    slipped.take(here, elsewhere, ratio=20.0, vote=1.0)  # nothing moves: the wheels did
    assert slipped.p_lost == verdict.p_lost


def test_the_area_under_a_roc_counts_pairs_and_ties_half() -> None:
    assert area(np.array([0.9, 0.8]), np.array([0.1, 0.2])) == 1.0
    assert area(np.array([0.1, 0.5]), np.array([0.5, 0.1])) == 0.5
    assert area(np.array([0.1]), np.array([0.9])) == 0.0

# SPDX-License-Identifier: Apache-2.0
"""What a scan shows that the days before did not know: what came, what went, and for how long."""

import math

import numpy as np
import pytest

from slam.days.evidence import SessionGrid
from slam.days.history import History, News
from tests.world2d import Drive, World2D, frames, rectangle

WALLS = rectangle(-3.0, -2.5, 4.0, 2.5)
BOX = rectangle(2.0, -0.4, 2.6, 0.4)
EMPTY, WITH_BOX = World2D(WALLS), World2D(np.vstack([WALLS, BOX]))
TURNING = Drive((0.0, 0.0, 0.0), ((0.0, 0.1, 5.0),))


def stream(world, seed):
    return list(frames(world, TURNING, rate_hz=5.0, seed=seed))


def day(world) -> History:
    grid = SessionGrid()
    for frame in stream(world, 1):
        grid.add(frame, frame.truth)
    return History(cell_m=0.1).with_session(grid.snapshot(0.0))


def shares(before, now):
    news = News(day(before))
    return [news.share(frame, frame.truth) for frame in stream(now, 2)]


def beams_on_the_box() -> float:
    """Share of the beams of half a turn: its front edge is 0.8 m wide, 2 m away."""
    return 2.0 * math.atan2(0.4, 2.0) / math.pi


@pytest.mark.parametrize(("before", "now"), [(EMPTY, WITH_BOX), (WITH_BOX, EMPTY)])
def test_what_came_and_what_went_is_news_for_two_seconds(before, now):
    found = shares(before, now)
    assert found[0] == pytest.approx(beams_on_the_box(), rel=0.3)
    assert min(found[:10]) > 0.7 * beams_on_the_box()
    assert max(found[12:]) < 0.02


@pytest.mark.parametrize("world", [EMPTY, WITH_BOX])
def test_a_room_as_it_was_tells_nothing(world):
    assert max(shares(world, world)) < 0.01


@pytest.mark.parametrize("heading", [0.0, math.pi])
def test_what_left_is_news_in_every_direction(heading):
    """Also where bearings wrap, at pi in the map: a post 2 m ahead, a place wide."""
    ahead = 1.0 if heading == 0.0 else -1.0
    room = ahead * WALLS
    post = World2D(np.vstack([room, ahead * rectangle(2.0, 0.01, 2.08, 0.09)]))
    grid, still = SessionGrid(), Drive((0.0, ahead * 0.05, heading), ((0.0, 0.0, 3.0),))
    for frame in frames(post, still, rate_hz=5.0, seed=1):
        grid.add(frame, frame.truth)
    news = News(History(cell_m=0.1).with_session(grid.snapshot(0.0)))
    frame = frames(World2D(room), still, rate_hz=5.0, seed=2)[0]
    assert news.share(frame, frame.truth) > 0.9 * 0.1 / 2.0 / math.pi  # a place, seen from there


def test_without_days_before_nothing_is_news():
    news = News(History(cell_m=0.1))
    assert not news.known
    assert news.share(stream(EMPTY, 1)[0], np.zeros(3)) == 0.0

# SPDX-License-Identifier: Apache-2.0
"""Where a session starts: one belief weighs all places, and what lies outside the map."""

from __future__ import annotations

import math

import numpy as np
import pytest

from slam import se2
from slam.days.history import History
from slam.days.search import Past, StartSearch
from slam.shunting import ShuntingConfig, ShuntingSlam
from tests.world2d import Drive, World2D, frames, laser, rectangle, wander

CONFIG = ShuntingConfig(cell_m=0.05, trace_s=2.5)
HALL = rectangle(-4.0, -3.0, 4.0, 3.0)
NICHE = rectangle(2.0, -3.0, 4.0, -2.0)
AROUND = Drive((1.0, 0.6, 2.6), ((0.2, 0.4, 8.0),))


def mapped(*parts) -> ShuntingSlam:
    """A SLAM that has seen all of this; its map's frame is that of the world."""
    slam = ShuntingSlam(CONFIG)
    for frame in frames(World2D(np.vstack(parts)), wander(16.0), rate_hz=5.0, spec=laser(181)):
        slam.update(frame.without_truth())
    return slam


def searched(known, world, drive):
    """The search after all scans of a drive, where it was found, and the true start."""
    search = StartSearch(known, Past(History(cell_m=0.1)))
    stream = frames(World2D(np.vstack(world)), drive, rate_hz=5.0, spec=laser(181), seed=9)
    found = None
    for frame in stream:
        _, found = search.take(frame.without_truth())
        if found is not None:
            break
    return search, found, stream[0].truth


@pytest.fixture(scope="module")
def home() -> ShuntingSlam:
    return mapped(HALL, NICHE)


def test_a_start_is_found_where_one_place_explains_all(home):
    search, found, truth = searched(home, (HALL, NICHE), AROUND)
    assert found is not None
    x, y, turn = se2.between(truth, found).tolist()
    assert math.hypot(x, y) < 0.05
    assert abs(turn) < 0.02
    assert max(start.probability for start in search.starts()) >= 0.99


def test_two_ends_that_are_alike_share_the_belief(home):
    """Whatever the session sees, half a turn explains it, too."""
    known = mapped(HALL)
    search, found, truth = searched(known, (HALL,), wander(16.0))
    assert found is None
    ends = sorted(search.starts(), key=lambda start: -start.probability)[:2]
    assert sum(end.probability for end in ends) > 0.95
    assert min(end.probability for end in ends) > 0.01
    turned = np.array([-truth[0], -truth[1], se2.wrap(truth[2] + math.pi)])
    for place in (truth, turned):
        off = [se2.between(place, end.T_map_own) for end in ends]
        assert min(math.hypot(x, y) + abs(turn) for x, y, turn in off) < 0.1


def test_outside_the_map_nothing_is_found(home):
    """Two walls of the hall explain half of this corridor, and none is seen through."""
    elsewhere = (rectangle(-1.5, -1.0, 7.0, 1.0), rectangle(3.0, 0.2, 3.6, 0.7))
    drive = Drive((0.0, 0.0, 0.0), ((0.3, 0.0, 4.0), (0.2, 0.3, 4.0)))
    _, found, _ = searched(home, elsewhere, drive)
    assert found is None


def test_a_place_that_is_found_late_is_asked_for_the_scans_before(home):
    """Its evidence is that of a place which was followed from the first scan on."""
    search, found, _ = searched(home, (HALL, NICHE), AROUND)
    assert found is not None
    (followed,) = [
        one
        for one, start in zip(search._places.followed, search.starts(), strict=True)
        if start.probability > 0.5
    ]
    before = followed.evidence.known_m
    pose = search._before[1]
    one = search._kept[-1].observations
    match = home.matched(one, se2.compose(found, pose), np.diag([0.01, 0.01, 0.001]))
    late = search._places.begun(one, match)
    assert late.evidence.known_m < before
    search._places.followed.clear()
    search._join(late, pose)
    while search._late:
        search._ask(pose)
    (again,) = search._places.followed
    assert again.evidence.known_m == pytest.approx(before, rel=0.15)

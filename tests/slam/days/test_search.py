# SPDX-License-Identifier: Apache-2.0
"""Where a session starts: scans weigh all places; and whether what it saw fits the past."""

import math
from dataclasses import replace

import numpy as np
import pytest

from slam import se2
from slam.days.evidence import Snapshot
from slam.days.history import History
from slam.days.search import KNOWN, SPOILS, Past, StartSearch
from slam.shunting import ShuntingConfig, ShuntingSlam
from slam.tracker.belief.places import Place
from slam.tracker.matching.matcher import unmatched
from tests.world2d import Drive, World2D, frames, laser, rectangle, wander

pytestmark = pytest.mark.slow
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
    assert max(start.probability for start in search.starts()) >= 0.9


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
    """What is kept of them is part of them all; one that lags far behind is hopeless."""
    search, world = StartSearch(home, Past(History(cell_m=0.1))), World2D(np.vstack((HALL, NICHE)))
    for frame in frames(world, AROUND, rate_hz=5.0, spec=laser(181), seed=9):
        search.take(frame.without_truth())
    pose, places = search._before[1], search._places
    best = max(places.followed, key=lambda one: one.nats)
    there = best.match.T_map_robot
    late = Place(match=unmatched(there, matched=1.0, score=0.0), evidence=1.0)
    beside = np.array([1.0, 1.0, 1.0])
    match = unmatched(se2.compose(there, beside), matched=1.0, score=0.0)
    denied = replace(late, match=match, evidence=-100.0)
    places.followed.clear()
    for new in (late, denied):
        search._join(new, pose)
    while search._late:
        search._ask(pose)
    (again,) = places.followed
    assert 0.4 * best.nats < again.nats <= best.nats
    np.testing.assert_allclose(again.match.T_map_robot, there, atol=1e-9)
    hopeless = se2.compose(search._hopeless[-1], pose)
    np.testing.assert_allclose(hopeless, se2.compose(there, beside), atol=1e-9)
    search._join(denied, pose)  # not again
    assert not search._late


CELL = 0.1


def building(*things, shift=(0.0, 0.0), wall_x=3.0):
    """8 x 5 m within walls, a wall with a gap at ``wall_x``, and (x0, y0, x1, y1) m of things."""
    j, i = np.mgrid[0:50, 0:80]
    cells = np.stack([i.ravel(), j.ravel()], axis=1).astype(np.int32)
    middle = (cells + 0.5) * CELL
    x, y = middle.T
    wall = (x < 0.1) | (x > 7.9) | (y < 0.1) | (y > 4.9)
    wall |= (abs(x - wall_x - 0.05) < 0.06) & (abs(y - 2.5) > 0.6)
    for box in things:
        wall |= np.all((middle >= box[:2]) & (middle <= box[2:]), axis=1)
    moved = cells + np.round(np.array(shift) / CELL).astype(np.int32)
    return Snapshot(time_s=0.0, cells=moved, standing=np.where(wall, 0.95, 0.0).astype(np.float32))


def past(*snapshots):
    history = History(cell_m=CELL)
    for number, one in enumerate(snapshots):
        at = Snapshot(time_s=float(number), cells=one.cells, standing=one.standing)
        history = history.with_session(at)
    return Past(history)


def test_chairs_may_move_and_edges_may_be_off_by_a_little():
    chairs = [(1.0, 1.0, 1.4, 1.4), (5.0, 2.0, 5.4, 2.4)]
    others = [(1.0, 3.0, 1.4, 3.4), (6.0, 1.0, 6.4, 1.4)]
    known = past(building(*chairs), building(*chairs))
    same = known.agreement(building(*chairs))
    assert same.disagrees == 0.0
    assert same.known > KNOWN
    assert known.agreement(building(*chairs, shift=(0.2, -0.1))).disagrees == 0.0
    assert 0.0 < known.agreement(building(*others)).disagrees < SPOILS


def test_walls_may_not():
    known = past(building())
    assert known.agreement(building(wall_x=5.0)).disagrees > SPOILS
    assert known.agreement(building(shift=(1.0, 0.6))).disagrees > SPOILS


def test_what_moves_in_the_days_before_has_no_say():
    """A chair that stood there in one session of two does not always stand there."""
    chair = (5.0, 2.0, 5.4, 2.4)
    found = past(building(chair), building()).agreement(building())
    assert found.missing == 0
    assert past(building(chair), building(chair)).agreement(building()).missing > 0

# SPDX-License-Identifier: Apache-2.0
"""What changed between two sessions, on places laid out by hand, and what a session sees."""

import math

import numpy as np
import pytest

from slam.days.changes import between
from slam.days.evidence import SessionGrid, Snapshot
from slam.days.habits import MobilityMap
from slam.days.history import History, told
from slam.errors import InvalidValueError
from tests.world2d import Drive, World2D, frames, rectangle

CELL = 0.1


def room(*things, unseen=(), share=0.9):
    """6 x 4 m of floor, with (x0, y0, x1, y1) m of things standing; ``unseen`` left out.

    share  of the looks that find something in their places
    """
    j, i = np.mgrid[0:40, 0:60]
    cells = np.stack([i.ravel(), j.ravel()], axis=1).astype(np.int32)
    middle = (cells + 0.5) * CELL

    def inside(box):
        return np.all((middle >= box[:2]) & (middle <= box[2:]), axis=1)

    standing = np.zeros(len(cells), np.float32)
    for box in things:
        standing[inside(box)] = share
    known = ~np.any([inside(box) for box in unseen] or [np.zeros(len(cells), bool)], axis=0)
    return Snapshot(time_s=0.0, cells=cells[known], standing=standing[known])


def test_what_came_what_went_and_what_stayed():
    table, box = (1.0, 1.0, 1.5, 1.5), (4.0, 3.0, 4.5, 3.5)
    found = between(room(table), room(table, box), CELL)
    assert [c.kind for c in found] == ["appeared"]
    assert math.dist(found[0].at, (4.25, 3.25)) < 0.1
    assert 0.4 <= found[0].size_m <= 0.75
    assert found[0].confidence > 0.6
    assert [c.kind for c in between(room(table, box), room(table), CELL)] == ["gone"]
    assert between(room(table), room(table), CELL) == []


def test_a_thing_of_the_same_size_nearby_has_moved():
    found = between(room((1.0, 1.0, 1.5, 1.5)), room((1.7, 1.6, 2.2, 2.1)), CELL)
    assert [c.kind for c in found] == ["moved"]
    assert math.dist(found[0].before, (1.25, 1.25)) < 0.1
    assert math.dist(found[0].at, (1.95, 1.85)) < 0.1
    assert found[0].places == (found[0].before, found[0].at)
    far = between(room((1.0, 1.0, 1.5, 1.5)), room((3.0, 2.0, 3.5, 2.5)), CELL)
    assert sorted(c.kind for c in far) == ["appeared", "gone"]
    other = between(room((1.0, 1.0, 1.3, 1.3)), room((3.0, 2.0, 4.0, 3.0)), CELL)
    assert sorted(c.kind for c in other) == ["appeared", "gone"]


def test_the_column_of_a_chair_is_a_change_and_four_legs_are_one():
    """All that a scan meets of a swivel chair is a column; of another chair, four legs."""
    column = [(2.0, 2.0, 2.1, 2.1)]
    legs = [(x, y, x + 0.1, y + 0.1) for x in (4.0, 4.4) for y in (1.0, 1.4)]
    found = between(room(*column, *legs), room(), CELL)
    assert [c.kind for c in found] == ["gone", "gone"]
    assert math.dist(found[0].at, (4.25, 1.25)) < 0.1
    assert math.dist(found[1].at, (2.05, 2.05)) < 0.1
    assert found[0].confidence > found[1].confidence


def test_what_most_beams_pass_beside_is_a_change_where_nothing_was():
    """One look in five meets a leg. That is no chance where no look at all met any before."""
    legs = [(x, y, x + 0.1, y + 0.1) for x in (4.0, 4.4) for y in (1.0, 1.4)]
    found = between(room(), room(*legs, share=0.2), CELL)
    assert [c.kind for c in found] == ["appeared"]
    assert math.dist(found[0].at, (4.25, 1.25)) < 0.1
    assert between(room(*legs, share=0.15), room(*legs, share=0.35), CELL) == []
    assert between(room(), room(legs[0], share=0.2), CELL) == []


def test_what_stood_there_for_a_while_still_went():
    """A door that is shut all night, and in the morning for one look in four."""
    leaf = (2.0, 2.0, 2.9, 2.1)
    assert [c.kind for c in between(room(leaf), room(leaf, share=0.25), CELL)] == ["gone"]
    assert between(room(leaf), room(leaf, share=0.5), CELL) == []


def test_a_single_place_at_the_edge_of_what_was_seen_is_no_change():
    column, beside, below = (2.0, 2.0, 2.1, 2.1), (2.1, 1.0, 6.0, 3.0), (1.0, 1.0, 2.1, 2.0)
    assert [c.kind for c in between(room(column), room(), CELL)] == ["gone"]
    assert between(room(column), room(unseen=(beside, below)), CELL) == []


def test_a_leaf_that_turned_about_its_hinge_is_a_door():
    shut, opened = (2.0, 2.0, 2.9, 2.1), (2.0, 2.0, 2.1, 2.9)
    found = between(room(shut), room(opened), CELL)
    assert [c.kind for c in found] == ["door"]
    assert abs(found[0].angle_deg) == pytest.approx(90.0, abs=12.0)
    assert math.dist(found[0].at, (2.05, 2.05)) < 0.25


def test_what_only_one_session_saw_has_not_changed():
    corner = (3.5, 2.5, 5.0, 4.0)
    assert between(room((4.0, 3.0, 4.5, 3.5)), room(unseen=(corner,)), CELL) == []
    nothing = Snapshot(
        time_s=0.0, cells=np.zeros((0, 2), np.int32), standing=np.zeros(0, np.float32)
    )
    assert between(nothing, room(), CELL) == []


def test_a_session_sees_walls_standing_floor_empty_and_nothing_behind():
    world = World2D(np.vstack([rectangle(-2.0, -2.0, 4.0, 2.0), rectangle(2.0, -0.4, 2.6, 0.4)]))
    grid = SessionGrid()
    for frame in frames(world, Drive((0.0, 0.0, 0.0), ((0.1, 0.0, 4.0),)), rate_hz=5.0, seed=1):
        grid.add(frame, frame.truth)
    assert grid.scans == 21
    snapshot = grid.snapshot(7.0)
    told = {tuple(c): s for c, s in zip(snapshot.cells.tolist(), snapshot.standing, strict=True)}

    def at(x, y):
        return told.get((math.floor(x / 0.1), math.floor(y / 0.1)))

    assert max(at(2.0, 0.05), at(1.95, 0.05) or 0.0) > 0.7
    assert at(1.5, 0.05) == 0.0
    assert at(1.0, 1.0) == 0.0
    assert at(3.2, 0.05) is None


def test_a_history_keeps_its_newest_sessions_in_order():
    history = History(cell_m=CELL)
    for time_s in (1.0, 2.0, 3.0):
        part = room()
        session = Snapshot(time_s=time_s, cells=part.cells, standing=part.standing)
        history = history.with_session(session, most=2)
    np.testing.assert_array_equal(history.times_s, [2.0, 3.0])
    with pytest.raises(InvalidValueError, match="later than the map's last session"):
        history.with_session(session)


@pytest.mark.parametrize(
    ("time_s", "words"),
    [
        (1777885200.0, "2026-05-04T09:00:00Z"),
        (1777885200.25, "2026-05-04T09:00:00.250000Z"),
        (118800.0, "118800 s"),  # simulated
        (-5.0, "-5 s"),
        (1e12, "1000000000000 s"),  # no such year
    ],
)
def test_a_time_is_said_as_a_date_where_it_is_one(time_s: float, words: str):
    assert told(time_s) == words


def test_mobility_is_how_much_a_place_differs_from_one_sighting_to_the_next():
    """A wall that is seen in half of the looks, always, has not changed; a door that swings has."""
    cells = np.array([[0, 0], [1, 0], [2, 0]], np.int32)
    history = History(cell_m=CELL)
    for time_s, shares in ((1.0, (0.5, 1.0)), (2.0, (0.5, 0.0)), (3.0, (0.5, 1.0))):
        shares = np.array([*shares, 0.0], np.float32)
        known = slice(0, 2 if time_s < 3.0 else 3)
        history = history.with_session(
            Snapshot(time_s=time_s, cells=cells[known], standing=shares[known])
        )
    raster = MobilityMap(history).mobility
    np.testing.assert_array_equal(raster.values, [[0.0, 1.0, np.nan]])
    assert MobilityMap(History(cell_m=CELL)).mobility is None

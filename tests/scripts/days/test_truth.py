# SPDX-License-Identifier: Apache-2.0
"""The score of a list of changes, by hand, and what the tables of a building say."""

from types import SimpleNamespace

import numpy as np
import pytest

from scripts.days.lifelong import COLUMNS
from scripts.days.report import operator, summed
from scripts.days.tables import last_session
from scripts.days.truth import Spot, Still, ages_of, scored, stands_there, verdicts
from slam.days.changes import Change
from slam.tracker.belief.state import State

pytestmark = pytest.mark.slow


def spot(x, name, *, came=False, seen=True, asked=True, door=False):
    return Spot(at=(x, 0.0), name=name, came=came, seen=seen, asked=asked, door=door)


def change(kind, *places, size=0.5, **more):
    spots = tuple((x, 0.0) for x in places)
    return Change(kind=kind, at=spots[-1], size_m=size, confidence=0.9, places=spots, **more)


@pytest.mark.parametrize(
    ("changes", "truth", "counts"),
    [
        # A moved thing counts at both its places.
        ([("moved", 0.2, 2.1)], [spot(0.0, "a"), spot(2.0, "a", came=True)], (2, 2, 2, 2)),
        # What nobody could see is not missed, and what is not there is wrong.
        ([("gone", 0.1), ("appeared", 3.0)],
         [spot(0.0, "chair0"), spot(5.0, "chair1", seen=False), spot(8.0, "chair2")], (2, 1, 2, 1)),
        # Every listed place counts: what a scan meets of a swivel chair is a column of 6 cm.
        ([("gone", 0.1), ("gone", 9.0)], [spot(0.0, "a")], (2, 1, 1, 1)),
        # What need not be listed is right if it is.
        ([("gone", 0.1)], [spot(0.0, "bin0", asked=False), spot(4.0, "chair0")], (1, 1, 1, 0)),
    ],
)  # fmt: skip
def test_listed_places_right_ones_and_those_to_be_told(changes, truth, counts):
    score = scored([change(*words, size=0.1) for words in changes], truth)
    assert (score.listed, score.right, score.seen, score.told) == counts


def test_a_door_is_one_door_before_and_after():
    truth = [spot(0.0, "door0", door=True), spot(1.0, "door0", came=True, door=True)]
    score = scored([change("door", 0.1, 1.1)], truth)
    assert score.doors == (1, 1)
    assert scored([change("moved", 0.1, 1.1)], truth).moved == (1, 0)
    told = summed([score, scored([change("gone", 5.0)], truth)])
    assert "precision 0.67 (2 of 3 places listed), recall 0.50 (2 of 4 places" in told
    assert "median position error 10 cm; truly so: 1 of 1 doors" in told


def row(session, **values):
    return {**dict.fromkeys(COLUMNS), "slam": "s", "session": session, "map": "merged", **values}


@pytest.mark.parametrize(
    ("kind", "turned", "there"),
    [("door", 0.3, False), ("chair_visitor", 0.3, True), ("door", 0.1, True)],
)
def test_a_door_whose_leaf_has_turned_stands_there_no_more(kind, turned, there):
    """Its hinge never moves; a chair may turn on the spot."""
    thing = Still(
        row=0, name="a", kind=kind, radius_m=0.9, pose=(1.0, 2.0, 3.1), share=1.0, met=1.0,
        points=np.zeros((0, 2)),
    )  # fmt: skip
    assert stands_there(thing, np.array([1.0, 2.0, 3.1 + turned])) == there
    assert not stands_there(thing, np.array([1.3, 2.0, 3.1]))


def test_an_age_counts_sessions_back_and_a_session_that_lay_apart_makes_it_older():
    assert list(ages_of(range(11), 11)) == [(1, 10), (3, 8), (10, 1)]
    assert list(ages_of([0, 1, 3], 5)) == [(1, 3), (3, 1)]
    assert list(ages_of([], 5)) == []
    assert list(ages_of([4], 5)) == [(1, 4)]


def test_whether_the_map_is_outdated_is_asked_where_the_room_clearly_changed_and_where_it_did_not():
    outdated, tracking = State.OUTDATED.value, State.TRACKING.value
    said = [outdated, outdated, tracking, outdated, tracking]
    estimates = [SimpleNamespace(diagnostics={"state": word}) for word in said]
    shares = np.array([0.9, 0.2, 0.3, 0.0, 0.0])
    assert verdicts(estimates, shares, 1) == {"outdated_told": 0.5, "outdated_false": 0.5}
    assert verdicts(estimates, np.full(5, 0.05), 0) == {
        "outdated_told": None,
        "outdated_false": None,
    }


def test_doors_have_numbers_by_where_they_are_and_things_are_counted():
    earlier = [change("door", 9.0, angle_deg=80.0), change("door", 2.0, angle_deg=-70.0)]
    now = [
        change("door", 9.1, angle_deg=-82.0), change("moved", 4.0, before=(5.0, 1.0)),
        change("moved", 6.0, before=(7.0, 1.0)), change("gone", 1.0),
    ]  # fmt: skip
    told = operator(now, [*earlier, *now])
    assert told == "door 2 turned by 82°, 2 things moved, 1 thing gone"
    assert operator([], earlier) == "nothing changed that it could tell"
    row = {"session": 3, "slam": "s", "place": "right", "found_after_s": 4.2, "map": "merged"}
    assert last_session([row | {"tracked": 1.0}], told).endswith("found in 4 s, never lost.")
    lost = last_session([row | {"tracked": 0.75, "place": "wrong"}], "")
    assert lost.endswith("found in 4 s, at a wrong place, in doubt in 25 % of the scans.")
    assert "not found in the map" in last_session([row | {"found_after_s": None}], told)

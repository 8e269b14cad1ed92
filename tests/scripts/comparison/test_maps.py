# SPDX-License-Identifier: Apache-2.0
"""Scores of maps on a room made by hand: known ghosts, known half-life, known doors."""

from __future__ import annotations

import math

import numpy as np
import pytest

from scripts.comparison.maps import MapJudge, disc
from scripts.comparison.sight import OldPlace, Sight, seen_empty
from tests.scripts.comparison.hand_made import HZ, WALL_M, raster, recording

HERE, THERE = (2.0, 0.0), (1.5, 1.5)


def near(place, reach_m: float = 0.1):
    return lambda x, y: math.dist((x, y), place) <= reach_m


def wall(x, y) -> bool:
    return max(abs(x), abs(y)) > WALL_M


def judged(drive, map_after) -> MapJudge:
    """Scores of the maps ``map_after(k)``, asked for as a comparison does."""
    judge = MapJudge(drive)
    for k in range(len(drive.frames)):
        judge.look(k)
        if judge.wants(k):
            judge.judge(k, map_after(k))
    return judge


def moved_after(scans: int, of: int):
    """The chair stands at HERE for so many scans, then at THERE."""
    return recording([HERE] * scans + [THERE] * (of - scans))


def test_a_true_map_has_no_ghost_and_a_known_share_is_found():
    drive = recording([HERE] * (3 * HZ + 1))
    true = raster(lambda x, y: wall(x, y) or near(HERE)(x, y))
    assert judged(drive, lambda k: true).scores()["ghost_rate"] == 0.0
    stray = raster(lambda x, y: wall(x, y) or near((-2.0, 1.0), 0.2)(x, y))
    share = (stray.values.sum() - raster(wall).values.sum()) / stray.values.sum()
    scores = judged(drive, lambda k: stray).scores()
    assert scores["ghost_rate"] == pytest.approx(share, abs=1e-6)
    assert scores["ghost_left_rate"] == 0.0  # nothing ever was there


def test_what_a_chair_left_behind_is_told_from_stray_cells():
    drive = moved_after(2 * HZ, 4 * HZ + 1)
    both = raster(lambda x, y: wall(x, y) or near(HERE)(x, y) or near(THERE)(x, y))
    judge = judged(drive, lambda k: both if k > 3 * HZ else raster(wall))
    ghost, left = judge.scores()["ghost_rate"], judge.scores()["ghost_left_rate"]
    cells = raster(near(HERE)).values.sum()
    assert left == ghost == pytest.approx(cells / both.values.sum() / 4.0, rel=0.05)


@pytest.mark.parametrize("scans", [1, 2, 6, 11])
def test_half_life_of_a_moved_chair(scans: int):
    """The map forgets the old place at the n-th scan that sees it empty."""
    first_empty = 2 * HZ
    drive = moved_after(first_empty, first_empty + 4 * HZ)
    kept = raster(lambda x, y: wall(x, y) or near(HERE)(x, y))
    judge = judged(drive, lambda k: kept if k < first_empty + scans else raster(wall))
    scores = judge.scores()
    assert (scores["half_life_events"], scores["half_life_censored"]) == (1, 0)
    assert scores["half_life_s"] == pytest.approx(scans / HZ, abs=1e-6)
    assert scores["half_life_observations"] == scans + 1


def test_a_place_never_forgotten_is_infinite_and_one_never_known_no_event():
    drive = moved_after(2 * HZ, 6 * HZ)
    kept = raster(lambda x, y: wall(x, y) or near(HERE)(x, y))
    scores = judged(drive, lambda k: kept).scores()
    assert scores["half_life_s"] == math.inf
    assert (scores["half_life_events"], scores["half_life_censored"]) == (1, 1)
    scores = judged(drive, lambda k: raster(wall)).scores()
    assert scores["half_life_events"] == 0
    assert scores["half_life_s"] is None


def test_a_place_watched_to_the_end_counts_for_as_long_as_it_was_watched():
    """Three places: forgotten after 1 s and 3 s, and one taken again after 2 s, still believed."""
    judge = judged(recording([HERE] * 11), lambda k: raster(wall))
    for lasted_s, forgotten in ((1.0, True), (2.0, False), (3.0, True)):
        old = OldPlace(np.zeros((1, 2)), seen_empty_s=1.0, lasted_s=lasted_s, forgotten=forgotten)
        old.observations = round(HZ * lasted_s)
        judge.places.left.append(old)
    scores = judge.scores()
    assert (scores["half_life_events"], scores["half_life_censored"]) == (3, 1)
    assert scores["half_life_s"] == 3.0  # 2/3 last longer than 1 s, of whom the only one left ends
    assert scores["half_life_observations"] == 3 * HZ


def test_recall_of_a_chair_at_its_new_place():
    """It stands there from 2 s on, counts from 4 s: judged at 4, 5 and 6 s, in the map at 6 s."""
    drive = moved_after(2 * HZ, 6 * HZ + 1)
    new = raster(lambda x, y: wall(x, y) or near(THERE)(x, y))
    scores = judged(drive, lambda k: new if k >= 6 * HZ else raster(wall)).scores()
    assert scores["new_objects"] == 3
    assert scores["new_object_recall"] == pytest.approx(1.0 / 3.0)


@pytest.mark.parametrize(("door_rad", "truly_closed"), [(0.0, True), (1.4, False), (0.5, None)])
def test_doors(door_rad: float, truly_closed: bool | None):
    """The leaf closes the line x = 2, y from -3 to -2; half-open doors are nobody's error."""
    drive = recording([HERE] * (3 * HZ + 1), door_rad=door_rad)
    shut = raster(lambda x, y: wall(x, y) or (abs(x - 2.0) < 0.05 and -3.0 < y < -2.0))
    for map_shut, map_now in ((True, shut), (False, raster(wall))):
        scores = judged(drive, lambda k, map_now=map_now: map_now).scores()
        if truly_closed is None:
            assert (scores["doors_judged"], scores["door_accuracy"]) == (0, None)
        else:
            assert scores["doors_judged"] == 3
            assert scores["door_accuracy"] == float(map_shut == truly_closed)


def test_a_drifted_map_is_judged_where_it_lies():
    """Shifted by half a metre its walls stand where nothing is."""
    drive = recording([HERE] * (3 * HZ + 1))
    shifted = raster(lambda x, y: wall(x + 0.5, y))
    assert judged(drive, lambda k: shifted).scores()["ghost_rate"] > 0.15


def test_what_a_scan_saw():
    sight = Sight(recording([HERE]), 0)
    assert np.nanmin(np.hypot(*sight.points.T)) == pytest.approx(1.9, abs=1e-3)
    empty = sight.emptied(np.array([[1.0, 0.5], [3.0, 0.0], [1.95, 0.0], [-1.0, 0.0], [3.9, 1.0]]))
    assert empty.tolist() == [True, False, False, False, False]
    assert sight.crossing(np.array([3.0, 1.0]), np.array([3.0, 2.0])) == 31  # 18.4 to 33.7 degrees
    assert sight.crossing(np.array([5.0, 1.0]), np.array([5.0, 2.0])) == 0  # behind the wall


def test_the_last_scan_with_a_say_tells_whether_a_place_is_empty():
    """The chair came to ``HERE``; behind it nobody has a say any more, but earlier scans had."""
    places = np.array([HERE, THERE, [HERE[0] + 1.0, HERE[1]], [-1.0, 0.0]])
    found = seen_empty(places, recording([THERE, HERE, HERE]))
    assert found.tolist() == [False, True, True, False]


def test_no_map_has_no_scores():
    assert judged(recording([HERE] * 11), lambda k: None).scores() == {}


def test_disc():
    assert disc(0.1, 0.05).sum() == 13
    assert disc(0.01, 0.05).tolist() == [[1]]

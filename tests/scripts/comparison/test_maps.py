# SPDX-License-Identifier: Apache-2.0
"""Scores of maps on a room made by hand: known ghosts, known new places."""

import math

import numpy as np
import pytest

from scripts.comparison.maps import MapJudge, seen_empty
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
        if judge.wants_map(k):
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
    assert judged(drive, lambda k: stray).scores()["ghost_rate"] == pytest.approx(share, abs=1e-6)


def test_recall_of_a_chair_at_its_new_place():
    """It stands there from 2 s on, counts from 4 s: judged at 4, 5 and 6 s, in the map at 6 s."""
    drive = moved_after(2 * HZ, 6 * HZ + 1)
    new = raster(lambda x, y: wall(x, y) or near(THERE)(x, y))
    scores = judged(drive, lambda k: new if k >= 6 * HZ else raster(wall)).scores()
    assert scores["new_objects"] == 3
    assert scores["new_object_recall"] == pytest.approx(1.0 / 3.0)


def test_a_drifted_map_is_judged_where_it_lies():
    """Shifted by half a metre its walls stand where nothing is."""
    drive = recording([HERE] * (3 * HZ + 1))
    shifted = raster(lambda x, y: wall(x + 0.5, y))
    assert judged(drive, lambda k: shifted).scores()["ghost_rate"] > 0.15


def test_the_last_scan_with_a_say_tells_whether_a_place_is_empty():
    """The chair came to ``HERE``; behind it nobody has a say any more, but earlier scans had."""
    places = np.array([HERE, THERE, [HERE[0] + 1.0, HERE[1]], [-1.0, 0.0]])
    found = seen_empty(places, recording([THERE, HERE, HERE]))
    assert found.tolist() == [False, True, True, False]


def test_no_map_has_no_scores():
    assert judged(recording([HERE] * 11), lambda k: None).scores() == {}

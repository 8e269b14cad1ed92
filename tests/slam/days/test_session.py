# SPDX-License-Identifier: Apache-2.0
"""A map from day to day: its start is found, what does not fit never touches it."""

import json
from pathlib import Path

import numpy as np
import pytest

from slam.days.evidence import Snapshot
from slam.days.habits import DaysRaster
from slam.days.history import DAY_S, History
from slam.days.search import FITS, SPOILS
from slam.days.session import Session, keep, read_history, searched
from slam.errors import InvalidValueError, LogFormatError
from slam.shunting import ShuntingConfig, ShuntingSlam
from slam.tracker import map_file
from tests.slam.tracker.test_map_file import rewritten
from tests.world2d import Drive, World2D, frames, laser, rectangle, wander

pytestmark = pytest.mark.slow
WALLS = np.vstack([rectangle(-4.0, -3.0, 4.0, 3.0), rectangle(-2.0, 1.0, -1.2, 2.2)])
HOME = World2D(np.vstack([WALLS, rectangle(2.0, -3.0, 4.0, -2.0)]))
ELSEWHERE = World2D(np.vstack([rectangle(-1.5, -1.0, 7.0, 1.0), rectangle(3.0, 0.2, 3.6, 0.7)]))
CONFIG = ShuntingConfig(cell_m=0.05, trace_s=2.5)
NINE = 9.0 * 3600.0


def driven(session, world, drive, seed, seconds=None):
    """The estimates and the true poses in the world."""
    stream = frames(world, drive, rate_hz=5.0, spec=laser(181), seed=seed)
    pairs = [(session.update(f.without_truth()), f.truth) for f in stream[:seconds]]
    return [p[0] for p in pairs], np.array([p[1] for p in pairs])


@pytest.fixture(scope="module")
def first(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Session]:
    session = Session(ShuntingSlam(CONFIG), time_s=NINE)
    driven(session, HOME, wander(16.0), seed=7)
    path = tmp_path_factory.mktemp("days") / "m.npz"
    assert keep(session, path) == path
    return path, session


def test_the_next_day_begins_anywhere_and_is_merged(first, tmp_path) -> None:
    path = tmp_path / "m.npz"
    path.write_bytes(first[0].read_bytes())
    session = Session.open(path, ShuntingSlam, time_s=DAY_S + NINE)
    before = first[0].read_bytes()
    estimates, truth = driven(session, HOME, Drive((1.0, 0.6, 2.6), ((0.2, 0.4, 8.0),)), seed=9)
    state = session.state
    assert state.fits
    assert state.found_after_s is not None
    assert 0.0 < state.found_after_s < 8.0
    assert path.read_bytes() == before  # nothing is written before it is kept
    searching = [e.diagnostics["state"] == "searching" for e in estimates]
    assert searching[0]
    assert not any(e.converged for e, s in zip(estimates, searching, strict=True) if s)
    np.testing.assert_allclose(estimates[-1].T_map_robot, truth[-1], atol=0.05)
    np.testing.assert_allclose(session.trajectory().poses, truth, atol=0.08)
    np.testing.assert_allclose(session.T_map_first, truth[0], atol=0.08)
    moved = [any(e.diagnostics["correction"]) for e in estimates]
    assert moved.index(True) == searched(estimates) == sum(searching)
    assert keep(session, path) == path
    history = read_history(path)
    assert history is not None
    np.testing.assert_array_equal(history.times_s, [NINE, DAY_S + NINE])
    with pytest.raises(InvalidValueError, match="later than the map's last session, at 118800 s"):
        Session.open(path, ShuntingSlam, time_s=DAY_S + NINE)


def test_where_a_box_has_come_overnight_the_map_is_outdated(first, tmp_path) -> None:
    path = tmp_path / "m.npz"
    path.write_bytes(first[0].read_bytes())
    box = rectangle(1.9, 0.6, 2.5, 1.4)
    drive = Drive((-0.6, 0.4, 0.0), ((0.15, 0.0, 11.0),))
    said = []
    for world in (HOME, World2D(np.vstack([HOME.segments, box]))):
        session = Session.open(path, ShuntingSlam, time_s=DAY_S + NINE)
        estimates, _ = driven(session, world, drive, seed=9)
        assert session.state.found_after_s is not None
        said.append([e.diagnostics["state"] for e in estimates if e.converged])
        assert all(0.0 <= e.diagnostics["news"] <= 1.0 for e in estimates if e.converged)
    assert said[0].count("map outdated here") == 0
    assert said[1][0] == "map outdated here"
    assert said[1][-1] == "tracking"  # the map has learnt it


def test_in_a_room_alike_after_half_a_turn_nothing_is_found(tmp_path) -> None:
    """A box that has come, and one that has gone, cannot tell: both ends are as good."""
    path = tmp_path / "m.npz"
    ends = np.vstack([rectangle(-4.0, -3.0, 4.0, 3.0), rectangle(2.0, 1.0, 2.4, 1.4)])
    day = Session(ShuntingSlam(CONFIG), time_s=NINE)
    driven(day, World2D(ends), wander(16.0), seed=7)
    keep(day, path)
    session = Session.open(path, ShuntingSlam, time_s=DAY_S + NINE)
    now = np.vstack([rectangle(-4.0, -3.0, 4.0, 3.0), rectangle(-2.4, -1.4, -2.0, -1.0)])
    driven(session, World2D(now), wander(16.0), seed=9)
    assert session.state.found_after_s is None
    assert keep(session, path).name == "m.apart1.npz"


def test_a_session_elsewhere_leaves_the_map_byte_for_byte_and_lies_apart(first, tmp_path) -> None:
    path = tmp_path / "m.npz"
    path.write_bytes(first[0].read_bytes())
    session = Session.open(path, ShuntingSlam, time_s=DAY_S)
    before = ShuntingSlam.load(path).map().values
    drive = Drive((0.0, 0.0, 0.0), ((0.3, 0.0, 4.0), (0.2, 0.3, 4.0)))
    estimates, _ = driven(session, ELSEWHERE, drive, seed=3)
    assert session.state.found_after_s is None
    assert not any(e.converged for e in estimates)
    np.testing.assert_array_equal(session.tracker.map().values, before)
    apart = keep(session, path)
    assert apart.name == "m.apart1.npz"
    assert keep(session, path).name == "m.apart2.npz"
    assert path.read_bytes() == first[0].read_bytes()
    assert ShuntingSlam.load(apart).cell_map.extent() is not None
    assert read_history(apart) is None


def other_days(first, *, found):
    """A session in the map, whose days before saw every wall 0.9 m beside where the map has it."""
    history = read_history(first[0])
    (seen,) = history.sessions
    moved = Snapshot(time_s=NINE, cells=seen.cells + np.int32([9, 6]), standing=seen.standing)
    past = History(cell_m=history.cell_m, sessions=(moved,))
    session = Session(ShuntingSlam.load(first[0]), time_s=DAY_S, history=past, found=found)
    driven(session, HOME, Drive((1.0, 0.6, 2.6), ((0.2, 0.4, 12.0),)), seed=9)
    return session


def test_a_start_that_the_days_before_deny_is_not_found(first) -> None:
    """However sure the map alone would be."""
    session = other_days(first, found=False)
    assert session.state.found_after_s is None
    search = session._search
    assert search is not None
    assert max(start.probability for start in search.starts()) > 0.9


def test_a_session_that_the_days_before_deny_lies_apart(first) -> None:
    """Though it was tracked in the map."""
    state = other_days(first, found=True).state
    assert state.tracked > FITS
    assert state.disagrees > SPOILS
    assert not state.fits


def test_a_map_of_days_goes_round_whole_and_loads_as_a_map(first, tmp_path) -> None:
    path, session = first
    history, again = session.known(), read_history(path)
    assert again is not None
    assert again.cell_m == history.cell_m
    cells, values = history.table()
    back_cells, back = again.table()
    np.testing.assert_array_equal(back_cells, cells)
    np.testing.assert_allclose(back, values, atol=0.5 / 254)
    assert len(cells) > 500
    np.testing.assert_array_equal(History.of_arrays(path, again.arrays()).table()[1], back)
    plain = ShuntingSlam.load(path)
    np.testing.assert_array_equal(plain.map().values, session.tracker.map().values)
    plain.save(tmp_path / "plain.npz")
    versions = []
    for file in (path, tmp_path / "plain.npz"):
        with np.load(file) as archive:
            versions.append(json.loads(str(archive["header"]))["version"])
    assert versions == [map_file.VERSION, map_file.PLAIN]


def test_a_map_of_before_days_is_the_first_day_of_a_history(first, tmp_path) -> None:
    """Version 1, as every run saves it: it is searched, found and gets a history."""
    path = tmp_path / "old.npz"
    first[1].tracker.save(path)
    assert read_history(path) is None
    session = Session.open(path, ShuntingSlam, time_s=0.0)
    driven(session, HOME, Drive((1.0, 0.6, 2.6), ((0.2, 0.4, 6.0),)), seed=9)
    assert session.state.fits
    keep(session, path)
    history = read_history(path)
    assert history is not None
    assert len(history) == 1


@pytest.mark.parametrize(
    ("changes", "match"),
    [
        ({"day_times_s": np.array([5.0, 4.0])}, "day_times_s must be"),
        ({"day_cell_m": np.float64(0.0)}, "day_cell_m must be"),
        ({"day_cells": np.zeros((2, 2), np.int32)}, "a place occurs twice"),
        ({"day_cells": np.full((1, 2), 2**30, np.int32)}, "must lie within"),
        ({"day_cells": np.array([[0, 0], [2**14, 2**13]], np.int32)}, "in a rectangle of 67108864"),
        ({"extra": ["day_cell_m"]}, "a map of days without day_times_s"),
        ({"extra": ["day_nothing"]}, "day_nothing"),
    ],
)
def test_what_is_no_history_is_refused(first, tmp_path, changes, match) -> None:
    path = rewritten(first[0], tmp_path / "m.npz", **changes)
    with pytest.raises(LogFormatError, match=match) as caught:
        read_history(path)
    assert str(path) in str(caught.value)


def test_the_map_says_how_its_places_change(first) -> None:
    raster = first[1].map()
    assert isinstance(raster, DaysRaster)
    wall, floor = (-4.05, 0.0), (0.5, 0.5)
    mobility = raster.mobility
    assert mobility.at(wall, DAY_S + NINE, reach_m=0.15) > 0.6
    assert mobility.at(floor, DAY_S + NINE) < 0.4
    assert mobility.at((50.0, 0.0), DAY_S) is None
    told = mobility.probability(DAY_S + NINE)
    assert told is not None
    assert told.values.shape == mobility.standing.values.shape
    with pytest.raises(InvalidValueError):
        mobility.probability(np.inf)

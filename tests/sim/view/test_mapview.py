# SPDX-License-Identifier: Apache-2.0
"""The picture from above: where things are drawn, and that nothing else changes."""

import math

import numpy as np
import pytest

import scenes
from sim.view.draw import BLUE
from sim.view.mapview import MapView
from sim.view.scans import beam_ends
from slam.errors import InvalidValueError
from slam.frames import Frame, LaserSpec, Odometry, Scan

pytestmark = pytest.mark.film


@pytest.fixture(scope="module")
def office():
    scene = scenes.build("office", 0)
    return scene, MapView(scene, 640, 400)


@pytest.fixture(scope="module")
def poses(office):
    scene, _ = office
    return np.array([scene.initial[mover.name] for mover in scene.movers])


def changed(view, before, after):
    """(row, column) centre of the pixels that differ."""
    rows, columns = np.nonzero((before != after).any(axis=2))
    return columns.mean(), rows.mean(), len(rows)


def test_pixels_are_an_affine_picture_of_the_world(office):
    scene, view = office
    corners = view.to_pixels([scene.bounds[:2], scene.bounds[2:]])
    assert (corners >= 0).all()
    assert (corners <= [640, 400]).all()
    assert corners[0, 0] < corners[1, 0]
    assert corners[0, 1] > corners[1, 1]  # y up, rows down
    centre, right, up = view.to_pixels([(0, 0), (1, 0), (0, 1)])
    assert right - centre == pytest.approx([view.scale, 0.0])
    assert up - centre == pytest.approx([0.0, -view.scale])


@pytest.mark.parametrize(
    ("kind", "place"),
    [("robot", (-3.0, 0.3, 1.0)), ("robot", (6.0, -0.4, -2.0)), ("door", (0.0, 0.0, math.pi / 4))],
)
def test_a_mover_is_drawn_where_it_is_and_a_door_along_its_leaf(office, poses, kind, place):
    scene, view = office
    row = [m.kind for m in scene.movers].index(kind)
    hidden, moved = poses.copy(), poses.copy()
    hidden[row], moved[row] = np.nan, place
    column, line, count = changed(view, view.draw(hidden), view.draw(moved))
    middle = np.array(place[:2])
    if kind == "door":
        middle += 0.5 * scene.movers[row].radius * math.cos(math.pi / 4)
    assert [column, line] == pytest.approx(view.to_pixels([middle])[0].tolist(), abs=2.0)
    assert count > 30


def seen(ranges):
    """A frame from (0, 0.4) with these ranges all around."""
    spec = LaserSpec(n_beams=len(ranges), angle_min=-1.5, angle_increment=3.0 / len(ranges))
    scan = Scan(stamp_ns=0, ranges=np.array(ranges, np.float32), spec=spec)
    odometry = Odometry(stamp_ns=0, T_odom_robot=np.zeros(3))
    return Frame(stamp_ns=0, odometry=odometry, scan=scan, truth=np.array([0.0, 0.4, 0.0]))


def test_hits_are_drawn_in_their_colours(office, poses):
    _, view = office
    frame = seen([1.0] * 60)
    picture = view.draw(poses, frame)
    at = np.array([0.0, 0.4]) + beam_ends(frame.scan)[40]
    column, row = np.round(view.to_pixels([at])[0]).astype(int)
    assert np.abs(picture[row, column].astype(int) - BLUE).max() < 60


def test_drawing_leaves_no_trace_and_takes_any_scan(office, poses):
    _, view = office
    clean = view.draw(poses)
    for ranges in ([np.inf], [np.inf] * 5, [1e4] * 3, [1.0]):
        view.draw(poses, seen(ranges))
    np.testing.assert_array_equal(view.draw(poses), clean)


def test_wrong_numbers_are_refused(office, poses):
    scene, view = office
    with pytest.raises(InvalidValueError, match="poses"):
        view.draw(poses[:-1])
    with pytest.raises(InvalidValueError, match="px"):
        MapView(scene, 0, 400)

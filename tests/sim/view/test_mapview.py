# SPDX-License-Identifier: Apache-2.0
"""The picture from above: where things are drawn, and that nothing else changes."""

from __future__ import annotations

import math

import numpy as np
import pytest

import scenes
from sim.view.floorplan import FOOT_PX
from sim.view.icons import INK
from sim.view.mapview import SCAN_HIT, TRAILS, MapView
from slam.errors import InvalidValueError


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
    assert right - centre == pytest.approx([view.plan.scale, 0.0])
    assert up - centre == pytest.approx([0.0, -view.plan.scale])


def test_a_mover_is_drawn_where_it_is(office, poses):
    scene, view = office
    robot = [m.kind for m in scene.movers].index("robot")
    hidden = poses.copy()
    hidden[robot] = np.nan
    for place in ((-3.0, 0.3, 1.0), (6.0, -0.4, -2.0)):
        moved = poses.copy()
        moved[robot] = place
        column, row, count = changed(view, view.draw(hidden), view.draw(moved))
        assert [column, row] == pytest.approx(view.to_pixels([place[:2]])[0].tolist(), abs=2.0)
        assert count > 30


def test_people_get_feet_where_they_are_told(office, poses):
    scene, view = office
    n = sum(m.kind == "person" for m in scene.movers)
    feet = np.full((n, 2, 3), np.nan)
    without = view.draw(poses, feet=feet)
    feet[0, 0] = (2.0, -0.5, 0.0)
    column, row, _ = changed(view, without, view.draw(poses, feet=feet))
    assert [column, row] == pytest.approx(view.to_pixels([(2.05, -0.5)])[0].tolist(), abs=1.5)


def test_hits_and_trails_are_drawn_in_their_colours(office, poses):
    _, view = office
    angles = np.linspace(-1.5, 1.5, 60)
    hits = np.stack([2.0 * np.cos(angles), 0.9 * np.sin(angles)], axis=1)
    hits[20] = np.nan
    picture = view.draw(poses, scan=((0.0, 0.0, 0.0), hits))
    column, row = np.round(view.to_pixels(hits[40:41])[0]).astype(int)
    assert np.abs(picture[row, column].astype(int) - SCAN_HIT).max() < 60
    path = np.array([(-4.0, 0.5), (4.0, 0.5)])
    picture = view.draw(poses, trails={"shunting": path})
    column, row = np.round(view.to_pixels([(1.0, 0.5)])[0]).astype(int)
    assert np.abs(picture[row, column].astype(int) - TRAILS["shunting"]).max() < 60


def test_drawing_leaves_no_trace_and_takes_any_scan(office, poses):
    _, view = office
    clean = view.draw(poses)
    for hits in (np.empty((0, 2)), np.full((5, 2), np.nan), np.full((3, 2), 1e4), [(1.0, 1.0)]):
        view.draw(poses, scan=((0.0, 0.0, 0.0), hits), trails={"x": [(0, 0)]}, caption="t = 1 s")
    np.testing.assert_array_equal(view.draw(poses), clean)


def test_a_door_is_drawn_along_its_leaf(office, poses):
    scene, view = office
    door = next(k for k, m in enumerate(scene.movers) if m.kind == "door")
    hidden, turned = poses.copy(), poses.copy()
    hidden[door] = np.nan
    turned[door] = (0.0, 0.0, math.pi / 4)
    column, row, _ = changed(view, view.draw(hidden), view.draw(turned))
    middle = 0.5 * scene.movers[door].radius * math.cos(math.pi / 4)
    assert [column, row] == pytest.approx(view.to_pixels([(middle, middle)])[0].tolist(), abs=2.0)


def test_wrong_numbers_are_refused(office, poses):
    scene, view = office
    with pytest.raises(InvalidValueError, match="poses"):
        view.draw(poses[:-1])
    with pytest.raises(InvalidValueError, match="px"):
        MapView(scene, 0, 400)


@pytest.mark.parametrize("size", [(640, 480), (400, 1200), (1000, 300)])
def test_the_scale_bar_is_below_the_room(size):
    scene = scenes.build("arena", 0)
    view = MapView(scene, *size)
    xmin, ymin, xmax, _ = scene.bounds
    lowest = view.to_pixels([(xmin, ymin), (xmax, ymin)])[:, 1].max()
    ink = (view.plan.picture[-FOOT_PX:] == INK).all(axis=2)
    assert ink.any()
    assert lowest < size[1] - FOOT_PX

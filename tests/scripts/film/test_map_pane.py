# SPDX-License-Identifier: Apache-2.0
"""What the film shows is where it is: a cell of the map lands on the pixel of its centre."""

import numpy as np
import pytest

from scripts.film.map_pane import CloseUp, raster_picture
from sim.view.draw import GREEN, INK, PAPER, RED, View, scale_bar
from sim.view.moment import MOST_POINTS, Path
from slam import se2
from slam.system import Raster

pytestmark = pytest.mark.film


@pytest.mark.parametrize("yaw", [0.0, 0.5, np.pi / 2.0, -2.0])
def test_a_cell_is_drawn_at_its_place(yaw: float):
    values = np.full((40, 60), np.nan, np.float32)
    values[10:13, 50:53] = 1.0
    raster = Raster(values=values, resolution_m=0.1, T_map_origin=np.array([-3.0, -1.0, 0.0]))
    T_view_map = np.array([1.0, 2.0, yaw])
    view = View.fitting((-8.0, -8.0, 8.0, 8.0), 640, 640)
    picture = raster_picture(raster, view, T_view_map)
    center = se2.transform(T_view_map, np.array([[-3.0 + 5.15, -1.0 + 1.15]]))
    dark = np.argwhere(picture.sum(axis=2) < 150)
    found = dark.mean(axis=0)[::-1] + 0.5
    np.testing.assert_allclose(found, view.pixels(center)[0], atol=1.0)


def test_a_long_trail_keeps_its_ends():
    path = Path()
    for k in range(4 * MOST_POINTS + 1):
        path.add(np.array([float(k), -float(k), 0.0]))
    points = path.points()
    assert len(points) <= MOST_POINTS + 1
    assert points[0].tolist() == [0.0, 0.0]
    assert points[-1].tolist() == [4.0 * MOST_POINTS, -4.0 * MOST_POINTS]
    assert path.points(number=7).tolist() == [[float(k), -float(k)] for k in range(8)]


def test_the_close_up_shows_truth_and_estimate_however_far_apart():
    pane = CloseUp((150, 150), 1.0, RED)
    for gap in (0.0, 0.004, 0.3, 7.0, 0.01):
        truth = np.array([5.0 + gap, 5.0, 0.3])
        picture = pane.paint(np.array([5.0, 5.0, 0.3]), truth, 1e-4 * np.eye(2))
        assert (picture[75, 75] == RED).all()
        if gap > 0.0:
            assert (picture == GREEN).all(axis=2).any()


def test_the_scale_bar_keeps_clear_of_the_map():
    view = View.fitting((0.0, 0.0, 20.0, 10.0), 400, 200)
    corners = np.s_[150:, :150], np.s_[150:, 250:], np.s_[:50, :150], np.s_[:50, 250:]
    blank = np.full((200, 400, 3), PAPER, np.uint8)
    for drawn in range(len(corners) + 1):
        picture = blank.copy()
        for corner in corners[:drawn]:
            picture[corner] = GREEN
        scale_bar(picture, view, 1.0)
        there = [bool((picture[corner] == INK).all(axis=2).any()) for corner in corners]
        free = drawn % len(corners)  # where all are drawn in, in the first
        assert there == [k == free for k in range(len(corners))]

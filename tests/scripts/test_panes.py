# SPDX-License-Identifier: Apache-2.0
"""What the film shows is where it is: a cell of the map lands on the pixel of its centre."""

from __future__ import annotations

import numpy as np
import pytest

from scripts.draw import GREEN, ORANGE
from scripts.panes import View, draw_trail, error_chart, raster_picture
from slam import se2
from slam.system import Raster


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


def test_unknown_is_paper_and_trails_end_in_a_robot():
    raster = Raster(
        values=np.full((4, 4), np.nan, np.float32), resolution_m=1.0, T_map_origin=np.zeros(3)
    )
    view = View.fitting((0.0, 0.0, 4.0, 4.0), 100, 100)
    picture = raster_picture(raster, view, np.zeros(3))
    assert (picture == picture[0, 0]).all()
    draw_trail(picture, view, [np.zeros(3), np.array([2.0, 2.0, 0.0])], GREEN)
    assert (picture[50, 50] == GREEN).all()


def test_the_error_chart_takes_empty_and_single_point_series():
    chart = error_chart(
        {"odometry": ([], [], ORANGE), "shunting": ([1.0], [0.02], GREEN)}, 60.0, (600, 120)
    )
    assert chart.shape == (120, 600, 3)

# SPDX-License-Identifier: Apache-2.0
"""Maps for pictures: thin walls stay, in no more cells than a picture has room for."""

from __future__ import annotations

import numpy as np
import pytest

from scripts.film.encode import LAPSE_FPS, MOST_PICTURES, Pace
from scripts.single_run.score import drawn, for_file
from sim.view import moment
from slam import create
from slam.frontend.seen_space import SeenSpace
from slam.replay import Track
from slam.strips import of_raster
from slam.system import MapsInParts, Raster
from tests.world2d import World2D, frames, laser, office, office_loop

CELL = 0.05


def made(height, width, at=(-3, 5), seed=0):
    """A raster of cells (column, row) from ``at`` on, a tenth of them known."""
    rng = np.random.default_rng(seed)
    values = np.where(rng.random((height, width)) < 0.1, rng.random((height, width)), np.nan)
    origin = np.array([at[0] * CELL, at[1] * CELL, 0.0])
    return Raster(values=values.astype(np.float32), resolution_m=CELL, T_map_origin=origin)


def test_the_parts_of_a_slam_are_those_of_its_map():
    stream = frames(World2D(office()), office_loop(), rate_hz=5.0, spec=laser(181))[:40]
    for name in ("shunting", "occupancy"):
        track = Track(name, create(name))
        empty = track.map_part((0.0, 0.0, 1.0, 1.0))
        assert empty is None or np.isnan(empty.values).all()
        assert track.survive(stream) is None
        assert isinstance(track.system, MapsInParts)
        whole, part = track.map(), track.map_part((1.0, -0.5, 4.0, 2.0))
        j, i = np.round((part.T_map_origin - whole.T_map_origin)[:2] / whole.resolution_m).astype(
            int
        )
        height, width = part.values.shape
        np.testing.assert_array_equal(part.values, whole.values[i : i + height, j : j + width])
        assert height * width < whole.values.size
        assert track.map_part((500.0, 0.0, 501.0, 1.0)) is None
    odometry = Track("odometry", create("odometry"))
    assert odometry.map_part((0.0, 0.0, 1.0, 1.0)) is None


class Kept:
    """A SLAM that has this map."""

    def __init__(self, raster: Raster) -> None:
        self.raster = raster

    def map(self) -> Raster:
        return self.raster


def test_a_map_in_pictures_keeps_thin_walls_and_its_extent():
    raster = made(1001, 530)
    found = drawn(Track("kept", Kept(raster)), most=300)
    assert max(found.map.values.shape) <= 300
    assert found.map.resolution_m == pytest.approx(4 * CELL)
    assert found.changes is None
    assert np.nanmax(found.map.values) == np.nanmax(raster.values)
    blocks = raster.values[:1000, :528].reshape(250, 4, 132, 4)
    largest = np.fmax.reduce(np.fmax.reduce(blocks, axis=3), axis=1)
    np.testing.assert_array_equal(found.map.values[:250, :132], largest)
    np.testing.assert_array_equal(
        drawn(Track("kept", Kept(raster)), most=1001).map.values, raster.values
    )
    assert drawn(Track("none", create("odometry"))) is None


def test_a_map_too_large_for_an_image_has_coarser_cells_and_says_so(monkeypatch):
    strips = of_raster(made(1000, 500))
    assert for_file(strips, SeenSpace()) == (strips, "")
    monkeypatch.setattr("scripts.single_run.score.MOST_PIXELS", 125_000)
    fitting, said = for_file(strips, SeenSpace())
    assert fitting.shape == (500, 250)
    assert "cells of 0.1 m instead of 0.05 m: the map is 25 m x 50 m" in said


def test_the_film_of_a_long_log_has_a_bounded_number_of_pictures():
    for duration_s, scans in ((2651.0, 910), (2007.0, 488), (671.0, 4791), (36_000.0, 400_000)):
        pace = Pace.of_log(duration_s, scans)
        pictures = pace.due(duration_s)
        assert pictures <= MOST_PICTURES + 1
        assert pictures <= scans / 6 + 60
        assert pace.fps == LAPSE_FPS
    short = Pace.of_log(20.0, 100)
    assert (short.speed, short.fps) == (1.0, 10.0)
    assert Pace.of_log(10.0, 375).fps == 30.0
    assert Pace.of_log(0.0, 1).due(0.0) == 1


def test_a_map_as_shown_keeps_thin_walls(monkeypatch):
    raster = made(1001, 530)
    monkeypatch.setattr(moment, "MOST_CELLS", 300)
    found = moment.small_map(Track("kept", Kept(raster)))
    assert max(found.values.shape) <= 300
    assert found.resolution_m == pytest.approx(4 * CELL)
    assert np.nanmax(found.values) == np.nanmax(raster.values)
    assert moment.small_map(Track("none", create("odometry"))) is None

# SPDX-License-Identifier: Apache-2.0
"""Maps and films of long runs: neither has more cells or pictures than a file has room for."""

import numpy as np
import pytest

from scripts.film.encode import FILM_S, LAPSE_FPS, MOST_PICTURES, Pace
from scripts.single_run.session import for_file
from slam.frames import LaserSpec, Scan
from slam.frontend.seen_space import SeenSpace
from slam.system import Raster

pytestmark = pytest.mark.film
CELL = 0.05
SPEC = LaserSpec(n_beams=9, angle_min=-1.0, angle_increment=0.25)


def made(height, width, at=(-3, 5), seed=0):
    """A raster of cells (column, row) from ``at`` on, a tenth of them known."""
    rng = np.random.default_rng(seed)
    values = np.where(rng.random((height, width)) < 0.1, rng.random((height, width)), np.nan)
    origin = np.array([at[0] * CELL, at[1] * CELL, 0.0])
    return Raster(values=values.astype(np.float32), resolution_m=CELL, T_map_origin=origin)


def test_a_map_too_large_for_an_image_has_coarser_cells_and_says_so(monkeypatch):
    raster, seen = made(1000, 500), SeenSpace(CELL)
    seen.add(Scan(stamp_ns=0, ranges=np.full(9, 2.0, np.float32), spec=SPEC), np.array([9, 9, 0]))
    assert for_file(raster, seen)[1] == ""
    assert for_file(raster, seen)[0].resolution_m == CELL
    monkeypatch.setattr("scripts.single_run.session.MOST_PIXELS", 125_000)
    fitting, said = for_file(raster, seen)
    assert fitting.values.size <= 125_000
    assert np.nanmax(fitting.values) == np.nanmax(raster.values)
    assert "m instead of 0.05 m: the map is 25 m x 50 m" in said


def test_the_film_of_a_long_log_has_a_bounded_number_of_pictures():
    for duration_s, scans in ((2651.0, 910), (2007.0, 488), (671.0, 4791), (36_000.0, 400_000)):
        pace = Pace.of_log(duration_s, scans)
        pictures = pace.due(duration_s)
        assert pictures <= MOST_PICTURES + 1
        assert pictures <= scans / 6 + 60
        assert pace.fps == LAPSE_FPS
    assert [Pace.within_a_minute(k * FILM_S).speed for k in (0.5, 10.0)] == [1.0, 10.0]
    short = Pace.of_log(20.0, 100)
    assert (short.speed, short.fps) == (1.0, 10.0)
    assert Pace.of_log(10.0, 375).fps == 30.0
    assert Pace.of_log(0.0, 1).due(0.0) == 1

# SPDX-License-Identifier: Apache-2.0
"""A part of a raster lies where it lay; wider cells keep the largest; a large map has them."""

import numpy as np
import pytest

from slam import create, rasters
from slam.errors import InvalidValueError
from slam.estimate import Raster
from slam.replay import Track
from tests.world2d import World2D, frames, laser, office, office_loop

CELL = 0.05


def made(turned: float = 0.0) -> Raster:
    """A hundredth of 120 x 84 cells is known, the outermost ones not."""
    rng = np.random.default_rng(1)
    values = np.where(rng.random((120, 84)) < 0.01, rng.random((120, 84)), np.nan)
    values[[0, -1]], values[:, [0, -1]] = np.nan, np.nan
    origin = np.array([-3 * CELL, 7 * CELL, turned])
    return Raster(values=values.astype(np.float32), resolution_m=CELL, T_map_origin=origin)


def test_wider_cells_have_the_largest_of_those_in_them():
    raster = made()
    blocks = np.fmax.reduce(raster.values.reshape(30, 4, 21, 4), axis=(1, 3))
    four = rasters.joined(raster, 4)
    np.testing.assert_array_equal(four.values, blocks)
    assert four.resolution_m == 4 * CELL
    assert rasters.joined(raster, 7).values.shape == (18, 12)
    np.testing.assert_array_equal(rasters.joined(raster, 1).values, raster.values)
    with pytest.raises(InvalidValueError, match="blocks of >= 1"):
        rasters.joined(raster, 0)


@pytest.mark.parametrize("turned", [0.0, 0.5 * np.pi])
def test_a_part_lies_where_it_lay(turned):
    raster = made(turned)
    low, left, high, right = rasters.known(raster)
    part = rasters.trimmed(raster)
    np.testing.assert_array_equal(part.values, raster.values[low:high, left:right])
    x, y = (left, low) if turned == 0.0 else (-low, left)
    at = raster.T_map_origin[:2] + np.array([x, y]) * CELL
    np.testing.assert_allclose(part.T_map_origin, [*at, turned], atol=1e-12)
    assert not np.isnan(part.values[0]).all()
    assert not np.isnan(part.values[:, -1]).all()
    unknown = np.full((3, 3), np.nan, np.float32)
    nothing = Raster(values=unknown, resolution_m=CELL, T_map_origin=np.zeros(3))
    assert rasters.trimmed(nothing) is None


def test_a_map_too_large_for_a_raster_has_wider_cells(monkeypatch):
    stream = frames(World2D(office()), office_loop(), rate_hz=5.0, spec=laser(181))[:40]
    for name in ("shunting", "occupancy"):
        track = Track(name, create(name))
        assert track.survive(stream) is None
        whole = track.map()
        monkeypatch.setattr("slam.tracker.cell_map.MAX_CELLS", whole.values.size // 5)
        wide = track.map()
        assert wide.resolution_m == pytest.approx(3 * whole.resolution_m)
        np.testing.assert_array_equal(wide.values, rasters.joined(whole, 3).values)
        np.testing.assert_array_equal(wide.T_map_origin, whole.T_map_origin)
        assert track.changes() is None
        monkeypatch.undo()

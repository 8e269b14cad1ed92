# SPDX-License-Identifier: Apache-2.0
"""A map in tiles shows what the whole map shows, in memory that does not grow with it."""

from __future__ import annotations

import numpy as np
import pytest

from scripts.film.changed import SQUARE_M, Changed, _squares
from scripts.film.encode import LAPSE_FPS, MOST_PICTURES, Pace
from scripts.film.map_pane import View, raster_picture
from scripts.film.map_tiles import TILE, MapTiles
from scripts.single_run.small_maps import drawn, for_file
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


def cut(raster, bounds):
    """The part of a raster within bounds, as ``MapsInParts`` gives it."""
    x, y, _ = raster.T_map_origin
    j0, i0 = (
        max(0, int(np.floor((b - o) / CELL + 1e-9)))
        for b, o in zip(bounds[:2], (x, y), strict=True)
    )
    j1, i1 = (int(np.ceil((b - o) / CELL - 1e-9)) for b, o in zip(bounds[2:], (x, y), strict=True))
    origin = np.array([x + j0 * CELL, y + i0 * CELL, 0.0])
    values = raster.values[i0 : max(i1, i0), j0 : max(j1, j0)]
    return Raster(values=values, resolution_m=CELL, T_map_origin=origin) if values.size else None


def test_tiles_put_together_are_the_map():
    raster, tiles = made(300, 500), MapTiles()
    tiles.put(raster)
    found = tiles.whole()
    x, y, _ = found.T_map_origin
    j, i = round((raster.T_map_origin[0] - x) / CELL), round((raster.T_map_origin[1] - y) / CELL)
    levels = (np.nan_to_num(raster.values) * np.float32(255.0)).astype(np.uint8)
    np.testing.assert_array_equal(found.levels[i : i + 300, j : j + 500], levels)
    assert found.levels.sum() == levels.sum()


@pytest.mark.parametrize("scale", [12.0, 5.0, 1.3])
def test_parts_one_by_one_show_what_the_whole_shows_at_every_scale(scale):
    """Coarse before, between or after: the largest of the largest is the same."""
    raster = made(700, 900, seed=1)
    whole, parts = MapTiles(), MapTiles()
    whole.put(raster)
    whole.fit(scale)
    parts.put(made(700, 900, seed=9))  # what was there before is replaced
    corners = [(x, y) for x in np.arange(-1.0, 46.0, 6.3) for y in np.arange(0.0, 36.0, 6.3)]
    for k in np.random.default_rng(2).permutation(len(corners)).tolist():
        if k == len(corners) // 2:
            parts.fit(scale)
        (x, y), tail = corners[k], (3.0 if k % 2 else 0.1)
        part = cut(raster, parts.aligned((x, y, x + 6.3 + tail, y + 6.3 + tail)))
        if part is not None:
            parts.put(part)
    parts.fit(scale)
    assert parts.cells == whole.cells
    np.testing.assert_array_equal(parts.whole().levels, whole.whole().levels)
    view = View.fitting((-1.0, 0.0, 46.0, 36.0), 560, 430)
    one, other = (raster_picture(t.whole(), view, np.zeros(3)) for t in (whole, parts))
    np.testing.assert_array_equal(one, other)


def test_tiles_know_where_they_are_empty():
    raster, tiles = made(30, 40, at=(0, 0)), MapTiles()
    assert tiles.empty((0.0, 0.0, 2.0, 1.5))
    tiles.put(raster)
    for k in range(200):
        x, y = np.random.default_rng(k).integers(-20, 50, 2) * CELL
        inside = cut(raster, (max(x, 0.0), max(y, 0.0), x + 3 * CELL, y + 2 * CELL))
        known = inside is not None and (inside.values >= 1.0 / 255.0).any()
        assert tiles.empty((x, y, x + 3 * CELL, y + 2 * CELL)) != known


def test_memory_follows_the_view_and_not_the_map():
    tiles, scale = MapTiles(), 560 / 400.0  # 400 m in 560 px
    for k in range(40):
        tiles.put(made(200, 8000, at=(0, 200 * k), seed=k))
        tiles.fit(scale)
    assert tiles.whole().levels.size <= (2 * 560 + 2 * TILE) ** 2


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
    monkeypatch.setattr("scripts.single_run.small_maps.MOST_PIXELS", 125_000)
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


def test_what_scans_changed_is_all_that_a_film_must_draw():
    """Parts drawn a few scans at a time end as the whole map does."""
    stream = frames(World2D(office()), office_loop(), rate_hz=4.0, spec=laser(181))[:60]
    track, tiles, changed = Track("shunting", create("shunting")), MapTiles(), Changed()
    drawn = 0
    for k, frame in enumerate(stream):
        track.take(frame)
        changed.add(frame.scan, track.estimates[-1].T_map_robot)
        if k % 7 == 0 or k == len(stream) - 1:
            for bounds in changed.taken(empty=tiles.empty):
                part = track.map_part(tiles.aligned(bounds))
                drawn += part.values.size
                tiles.put(part)
    whole = MapTiles()
    whole.put(track.map())
    one, other = tiles.whole(), whole.whole()
    view = View.fitting((-3.0, -3.0, 25.0, 15.0), 900, 600)
    same = raster_picture(one, view, np.zeros(3)) == raster_picture(other, view, np.zeros(3))
    assert same.mean() > 0.9999
    assert list(changed.taken()) == []
    assert drawn < 10 * track.map().values.size


def test_runs_of_squares_cover_each_once():
    changed = Changed()
    squares = [(0, 0), (0, 1), (0, 3), (1, 3), (-1, -2)]
    centres = [((column + 0.5) * SQUARE_M, (row + 0.5) * SQUARE_M) for row, column in squares]
    met, crossed = _squares(np.array(centres[:2])), _squares(np.array(centres[1:]))
    changed._met, changed._crossed = set(met), set(crossed)
    assert list(changed.taken()) == [
        (-8.0, -4.0, -4.0, 0.0), (0.0, 0.0, 8.0, 4.0),
        (12.0, 0.0, 16.0, 4.0), (12.0, 4.0, 16.0, 8.0),
    ]  # fmt: skip
    changed._met, changed._crossed = set(met), set(crossed)
    assert list(changed.taken(empty=lambda _: True)) == [(0.0, 0.0, 8.0, 4.0)]
    changed._met = _squares(np.array([[1.0, 1.0], [15.0, 11.0]]))
    assert list(changed.taken(in_parts=False)) == [(0.0, 0.0, 16.0, 12.0)]

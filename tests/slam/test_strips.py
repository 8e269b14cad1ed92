# SPDX-License-Identifier: Apache-2.0
"""A map read a strip at a time is the map, in memory that does not grow with its extent."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest

from slam import create
from slam.errors import InvalidValueError
from slam.estimate import SQUARE, MapSquares, Raster
from slam.frames import LaserSpec, Scan
from slam.frontend.seen_space import SeenSpace
from slam.maps import read_map, write_map
from slam.replay import Track
from slam.strips import of_parts, of_raster, runs
from tests.world2d import World2D, frames, laser, office, office_loop

CELL = 0.05
# row and column of squares with a few cells each: neighbours, one apart, one far away
PLACES = np.array([[-1, 0], [-1, 1], [0, 1], [2, -3], [5, 8]], dtype=np.int64)


def square(row: int, column: int) -> np.ndarray:
    rng = np.random.default_rng(abs(1000 * row + column))
    values = rng.random((SQUARE, SQUARE)).astype(np.float32)
    values[rng.random(values.shape) > 0.01] = np.nan
    return values


def part(bounds):
    """As a SLAM gives it: whole cells, and a rim of up to one cell."""
    i0, j0 = (int(np.floor(edge / CELL)) for edge in (bounds[1], bounds[0]))
    i1, j1 = (int(np.ceil(edge / CELL)) for edge in (bounds[3], bounds[2]))
    values = np.full((i1 - i0, j1 - j0), np.nan, np.float32)
    for row, column in PLACES.tolist():
        a, b = max(i0, row * SQUARE), min(i1, (row + 1) * SQUARE)
        c, d = max(j0, column * SQUARE), min(j1, (column + 1) * SQUARE)
        if a < b and c < d:
            inside = square(row, column)[a - row * SQUARE : b - row * SQUARE]
            inside = inside[:, c - column * SQUARE : d - column * SQUARE]
            values[a - i0 : b - i0, c - j0 : d - j0] = inside
    origin = np.array([j0 * CELL, i0 * CELL, 0.0])
    return Raster(values=values, resolution_m=CELL, T_map_origin=origin)


def whole() -> Raster:
    (low, left), (high, right) = PLACES.min(axis=0), PLACES.max(axis=0) + 1
    shape = ((high - low) * SQUARE, (right - left) * SQUARE)
    values = np.full(shape, np.nan, np.float32)
    for row, column in PLACES.tolist():
        i, j = (row - low) * SQUARE, (column - left) * SQUARE
        values[i : i + SQUARE, j : j + SQUARE] = square(row, column)
    origin = np.array([left * SQUARE * CELL, low * SQUARE * CELL, 0.0])
    return Raster(values=values, resolution_m=CELL, T_map_origin=origin)


def same(one: Raster, other: Raster) -> None:
    np.testing.assert_array_equal(one.values, other.values)
    np.testing.assert_allclose(one.T_map_origin, other.T_map_origin, atol=1e-9)
    assert one.resolution_m == pytest.approx(other.resolution_m)


def test_parts_put_together_are_the_map(monkeypatch):
    monkeypatch.setattr("slam.strips.STRIP_CELLS", 50_000)  # strips that begin within squares
    strips = of_parts(part, MapSquares(CELL, PLACES))
    same(strips.whole(), whole())
    one = of_raster(whole())
    assert strips.known() == one.known()
    same(strips.cut(strips.known()).whole(), one.cut(one.known()).whole())
    for n in (2, 7, 300):
        same(strips.joined(n).whole(), one.joined(n).whole())
        assert strips.joined(n).known() == of_raster(one.joined(n).whole()).known()
    cut = strips.cut((10, 200, 900, 1501))
    same(cut.joined(5).whole(), one.cut((10, 200, 900, 1501)).joined(5).whole())
    blocks = whole().values.reshape(-1, 4, whole().values.shape[1] // 4, 4)
    largest = np.fmax.reduce(np.fmax.reduce(blocks, axis=3), axis=1)
    np.testing.assert_array_equal(strips.joined(4).whole().values, largest)
    assert of_parts(part, MapSquares(CELL, PLACES[:0])) is None
    with pytest.raises(InvalidValueError, match="blocks of >= 1"):
        one.joined(0)


def test_files_and_pictures_of_a_far_spread_map_take_no_memory_for_what_is_not_there(tmp_path):
    """37 million cells, 151 MB as one raster; eight squares have something."""
    far = np.array([[k, k] for k in range(0, 24, 3)], dtype=np.int64)
    filled = np.full((SQUARE, SQUARE), 0.9, np.float32)

    def sparse(bounds):
        rows = round((bounds[3] - bounds[1]) / CELL)
        columns = round((bounds[2] - bounds[0]) / CELL)
        origin = np.array([bounds[0], bounds[1], 0.0])
        return Raster(values=filled[:rows, :columns], resolution_m=CELL, T_map_origin=origin)

    seen = SeenSpace(CELL)
    spec = LaserSpec(n_beams=181, angle_min=-1.5, angle_increment=3.0 / 180)
    for k in range(0, 24, 3):
        ranges = np.full(181, 20.0, np.float32)
        at = np.array([(k + 0.5) * SQUARE * CELL, (k + 0.5) * SQUARE * CELL, 0.3])
        seen.add(Scan(stamp_ns=k, ranges=ranges, spec=spec), at)
    tracemalloc.start()
    strips = of_parts(sparse, MapSquares(CELL, far))
    merged = seen.merge(strips.cut(strips.known()))
    _, yaml = write_map(tmp_path / "map", merged)
    small = merged.joined(8).whole()
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    height, width = merged.shape
    assert height * width > 20_000_000
    assert peak < 32e6
    back = read_map(yaml).values
    assert back.shape == merged.shape
    assert (back == 1.0).sum() == 8 * SQUARE**2
    assert (back == 0.0).sum() > 8 * 0.5 * np.pi * (15.0 / CELL) ** 2 / 2
    assert np.nanmax(small.values) == np.float32(0.9)


def test_a_map_that_no_image_holds_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr("slam.maps.MAX_PIXELS", 100)
    with pytest.raises(InvalidValueError, match="needs 1 to 100 cells"):
        write_map(tmp_path / "map", of_raster(whole()))
    assert list(tmp_path.iterdir()) == []


def test_strips_of_a_slam_are_its_map_and_its_changes():
    stream = frames(World2D(office()), office_loop(), rate_hz=5.0, spec=laser(181))[:40]
    for name in ("shunting", "occupancy"):
        track = Track(name, create(name))
        assert track.map_strips() is None
        assert track.survive(stream) is None
        strips, map_ = track.map_strips(), of_raster(track.map())
        same(strips.cut(strips.known()).whole(), map_.cut(map_.known()).whole())
        known, changes = track.changes_strips(), track.changes()
        assert (known is None) == (changes is None)
        layers = () if changes is None else (changes.appeared, changes.gone)
        for found, layer in zip(known or (), layers, strict=True):
            one = of_raster(layer)
            assert found.shape == strips.shape
            same(found.cut(found.known()).whole(), one.cut(one.known()).whole())
    odometry = Track("odometry", create("odometry"))
    assert odometry.map_strips() is None
    assert odometry.changes_strips() is None


def test_spans_that_meet_are_one():
    assert runs([(4, 6), (0, 2), (2, 3), (5, 9), (11, 12)]) == [(0, 3), (4, 9), (11, 12)]
    assert runs([]) == []

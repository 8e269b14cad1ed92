# SPDX-License-Identifier: Apache-2.0
"""The ordinary grid: log-odds apart from the seconds of looking that its covariance reads."""

import numpy as np
import pytest

from slam import se2
from slam.frontend.observations import from_scan
from slam.grid.occupancy import Grid, OccupancySlam
from slam.tracker.cells import living
from slam.tracker.uncertainty.residuals import residuals_of
from tests.world2d import World2D, arena, frames, laser, wander

CELL_M = 0.05


@pytest.fixture(scope="module")
def driven():
    stream = frames(World2D(arena()), wander(1.0), rate_hz=5.0, spec=laser(181), seed=8)[:12]
    system = OccupancySlam(cell_m=CELL_M)
    for frame in stream[:-1]:
        system.update(frame.without_truth())
    return system, stream


def test_cells_know_for_how_long_they_were_looked_at(driven):
    system, stream = driven
    grid = system.cell_map
    assert isinstance(grid, Grid)
    slots, _ = living(grid.cells)
    ages, log_odds = grid.cells.age[slots], grid.log_odds[slots]
    seconds = (stream[-2].stamp_ns - stream[0].stamp_ns) * 1e-9
    first_s = system.config.map.first_look_s
    assert ages.min() == 0.0
    assert ages.max() == pytest.approx(seconds + first_s, rel=1e-5)
    np.testing.assert_array_equal(ages[log_odds != 0.0] > 0.0, True)
    assert log_odds.min() < 0.0 < log_odds.max() <= system.config.grid.most


def test_a_look_weighs_less_the_longer_a_cell_was_looked_at(driven):
    """Also where the grid denies what is seen: log-odds below zero are no ages."""
    system, stream = driven
    scan = stream[-1].scan
    assert scan is not None
    seen = from_scan(scan, np.zeros(3), system.config)
    pose = se2.between(stream[0].truth, stream[-1].truth)
    ages = system.cell_map.cells.age.copy()
    shares = []
    for factor in (0.0, 1.0, 10.0):
        system.cell_map.cells.age[:] = factor * ages
        residuals = residuals_of(system.cell_map, 0.0, seen, pose, (0.2, 0.0), 0)
        shares.append(residuals.new / residuals.weighed)
    system.cell_map.cells.age[:] = ages
    assert 1.0 >= shares[0] > shares[1] > shares[2] > 0.0


def test_a_saved_grid_comes_back_with_its_log_odds(driven, tmp_path):
    system, _ = driven
    system.save(tmp_path / "map.npz")
    back = OccupancySlam.load(tmp_path / "map.npz")
    np.testing.assert_array_equal(back.map().values, system.map().values)
    slots, _ = living(back.cell_map.cells)
    ages = back.cell_map.cells.age[slots]
    assert ages.min() == 0.0 < ages.max() < 60.0

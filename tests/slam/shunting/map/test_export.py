# SPDX-License-Identifier: Apache-2.0
"""What appeared and what is gone, told by the two memories; what stayed is neither."""

import numpy as np
import pytest

from slam.frontend.visibility import view_of_beams
from slam.grid.occupancy import OccupancySlam
from slam.shunting import ShuntingConfig, ShuntingSlam
from slam.shunting.map.export import changes, existence
from slam.system import Raster
from slam.tracker.network import Network
from tests.slam.tracker.test_network import look, point

CELL = 0.1
STAYS, LEAVES, COMES = (1.05, 2.05), (3.05, 2.05), (5.05, 2.05)


def at(raster: Raster, place: tuple[float, float]) -> float:
    x, y = (np.array(place) - raster.T_map_origin[:2]) / raster.resolution_m
    return float(raster.values[int(y), int(x)])


def visited(config: ShuntingConfig) -> Network:
    """A thing that stays, one that leaves after 20 s and one that comes for the last second."""
    network = Network(config)
    for k in range(110):
        look(network, point(*STAYS, CELL), 0.2)
        if k < 100:
            look(network, point(*LEAVES, CELL), 0.2)
        else:
            look(network, point(*COMES, CELL), 0.2)
            empty_at(network, LEAVES)
    return network


def empty_at(network: Network, place: tuple[float, float]) -> None:
    """See only the surroundings of ``place`` empty."""
    kept = {p: network.window(*p, *p) for p in (STAYS, COMES)}
    assert all(x[0, 0] > 0.0 for x, _ in kept.values())
    beams = np.array([np.arctan2(place[1], place[0] + 5.0)])
    view = view_of_beams(beams, np.array([20.0]), 0.02, CELL)._replace(gate=0.4)
    network.integrate(view, np.array([-5.0, 0.0, 0.0]), 0.6, write=True)


def test_what_left_is_gone_what_came_is_new_and_what_stays_is_neither() -> None:
    found = changes(visited(ShuntingConfig(cell_m=CELL)))
    assert found is not None
    assert at(found.gone, LEAVES) > 0.5
    assert at(found.appeared, COMES) > 0.5
    for place in (STAYS, COMES):
        assert at(found.gone, place) < 0.05
    for place in (STAYS, LEAVES):
        assert at(found.appeared, place) < 0.2
    assert np.isnan(at(found.gone, (4.05, 1.25)))
    for layer in (found.gone, found.appeared):
        known = layer.values[~np.isnan(layer.values)]
        assert known.min() >= 0.0
        assert known.max() <= 1.0


def test_a_wall_seen_one_neuron_aside_is_no_change() -> None:
    network = Network(ShuntingConfig(cell_m=CELL))
    for k in range(110):
        look(network, point(STAYS[0] + (CELL if k > 100 else 0.0), STAYS[1], CELL), 0.2)
    found = changes(network)
    assert found is not None
    assert np.nanmax(found.appeared.values) < 0.2
    assert np.nanmax(found.gone.values) < 0.2


def test_without_a_map_or_a_long_term_memory_nothing_is_said() -> None:
    empty = Network(ShuntingConfig())
    assert existence(empty) is None
    assert changes(empty) is None
    paper = Network(ShuntingConfig.paper(cell_m=CELL))
    look(paper, point(*STAYS, CELL), 1.0)
    assert changes(paper) is None
    assert existence(paper) is not None
    assert OccupancySlam().changes() is None
    assert ShuntingSlam().changes() is None


def test_existence_lies_where_the_thing_is() -> None:
    network = Network(ShuntingConfig(cell_m=CELL))
    look(network, point(*STAYS, CELL), 10.0)
    raster = existence(network)
    assert raster is not None
    assert at(raster, STAYS) == pytest.approx(np.nanmax(raster.values))
    assert at(raster, STAYS) > 0.9

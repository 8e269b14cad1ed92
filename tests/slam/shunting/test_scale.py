# SPDX-License-Identifier: Apache-2.0
"""What is silent costs nothing, and no slot of the network is lost."""

import numpy as np

from slam import se2
from slam.frontend.observations import from_scan
from slam.shunting import ShuntingConfig, ShuntingSlam
from slam.tracker.cells import FREE_COUNT, living
from slam.tracker.network import Network
from slam.tracker.rasterise import rasterise
from tests.world2d import World2D, arena, frames, laser, office, office_loop, wander

CONFIG = ShuntingConfig(cell_m=0.05)
STREAM = frames(World2D(arena()), wander(1.0), rate_hz=5.0, spec=laser(181), seed=3)[:60]


def test_a_live_neuron_costs_few_bytes() -> None:
    """All arrays counted. 39 in the furnished office of ``mobilia bench``; here walls are bare."""
    slam = ShuntingSlam()
    for frame in frames(World2D(office()), office_loop(), rate_hz=1.0, spec=laser(), seed=3):
        slam.update(frame.without_truth())
    assert slam.network.bytes_per_neuron() <= 48.0


def test_every_slot_is_either_free_or_lives_once() -> None:
    """Whatever comes and goes, no slot is lost and none is given twice."""
    rng = np.random.default_rng(2)
    network = Network(ShuntingConfig(cell_m=0.05, trace_s=0.0))
    for _ in range(60):
        frame = STREAM[int(rng.integers(len(STREAM)))]
        assert frame.scan is not None
        observations = from_scan(frame.scan, np.zeros(3), CONFIG)
        pose = rng.uniform([-6.0, -6.0, -3.0], [6.0, 6.0, 3.0])
        rasterise(network, observations, pose)
        T_map_laser = se2.compose(pose, observations.T_robot_laser)
        network.integrate(observations.view, T_map_laser, 2.0, write=bool(rng.random() < 0.7))
        network.release()
        slots, _ = living(network.cells)
        free = network.cells.free[: int(network.cells.counts[FREE_COUNT])]
        together = np.sort(np.concatenate([slots, free]))
        np.testing.assert_array_equal(together, np.arange(len(network.cells.free)))
        assert (network.cells.x[slots] != 0.0).any(axis=(1, 2)).all()

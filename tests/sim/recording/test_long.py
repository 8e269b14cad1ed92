# SPDX-License-Identifier: Apache-2.0
"""A recording whose chunks, of scans and of labels, are not the only ones of their kind."""

from pathlib import Path

import pytest

from sim.moments import toured
from sim.recording.bag import BagWriter
from sim.simulation import Simulation
from slam.logs import read_bag

pytestmark = pytest.mark.slow


def test_every_frame_gets_its_labels_that_lie_far_before_its_scan(tmp_path: Path) -> None:
    simulation = Simulation("arena", seed=1, laser="ideal", labels=True)
    wanted = []
    with BagWriter(tmp_path / "bag", simulation.spec) as bag:
        for moment in toured(simulation, 6.0):
            bag.write(moment)
            wanted.append(moment.frame)
    frames = list(read_bag(tmp_path / "bag", labels=True))
    assert [frame.labels for frame in frames] == [frame.labels for frame in wanted]

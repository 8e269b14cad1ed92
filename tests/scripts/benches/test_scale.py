# SPDX-License-Identifier: Apache-2.0
"""What a scan costs does not depend on what lies elsewhere: a map is enlarged as ``bench`` does."""

from pathlib import Path

import numpy as np
import pytest

from scripts.benches.slam import enlarge
from slam.frontend.observations import from_scan
from slam.shunting import ShuntingConfig, ShuntingSlam
from slam.tracker.cells import TOUCHED_COUNT, living
from slam.tracker.matching.local_search import SearchWindow
from slam.tracker.matching.matcher import Matcher
from slam.tracker.network import Network
from tests.world2d import World2D, arena, frames, laser, wander

CONFIG = ShuntingConfig(cell_m=0.05)
STREAM = frames(World2D(arena()), wander(1.0), rate_hz=5.0, spec=laser(181), seed=3)[:60]


@pytest.fixture(scope="module")
def saved(tmp_path_factory: pytest.TempPathFactory) -> Path:
    slam = ShuntingSlam(CONFIG)
    for frame in STREAM[:40]:
        slam.update(frame.without_truth())
    path = tmp_path_factory.mktemp("map") / "map.npz"
    slam.save(path)
    return path


def test_neurons_touched_and_candidates_scored_stay_while_the_map_grows_100_fold(
    saved: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    visited: list[int] = []
    whole = Network.integrate

    def counted(self, *args, **options):  # type: ignore[no-untyped-def]
        result = whole(self, *args, **options)
        visited.append(result[2] + int(self.cells.counts[TOUCHED_COUNT]))
        return result

    monkeypatch.setattr(Network, "integrate", counted)
    costs, blocks = [], []
    for times in (1, 100):
        slam = ShuntingSlam.load(saved)
        enlarge(slam.network, times)
        blocks.append(len(living(slam.network.cells)[0]))
        visited.clear()
        candidates = []
        for frame in STREAM[40:]:
            pose = slam.update(frame.without_truth()).T_map_robot
            assert frame.scan is not None
            observations = from_scan(frame.scan, np.zeros(3), CONFIG)
            window = SearchWindow(reach_m=0.4, turn_rad=0.2)
            match = Matcher(CONFIG).search(
                slam.network, observations, pose, np.diag([1e2, 1e2, 1e2]), window
            )
            candidates.append(match.evaluations)
        costs.append((sum(visited), sum(candidates)))
    assert blocks[1] == 100 * blocks[0]
    assert costs[0][0] > 10_000
    for small, large in zip(costs[0], costs[1], strict=True):
        assert large == pytest.approx(small, rel=0.2)

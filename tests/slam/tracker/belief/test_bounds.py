# SPDX-License-Identifier: Apache-2.0
"""No number of the belief breaks anything where it is as small or as large as it may be."""

import numpy as np
import pytest

from slam.shunting import ShuntingConfig, ShuntingSlam
from slam.tracker.belief.config import BeliefConfig
from tests.slam.tracker.belief.drives import ROOMS, START, estimates, still
from tests.world2d import Drive, frames, going_on

PATHS = ["map.known_s", "carried_per_h", *(f"belief.{row.path}" for row in BeliefConfig().rows())]
BEFORE = frames(ROOMS, Drive(START, ((0.0, 0.8, 6.0),)), rate_hz=5.0, seed=3)
STREAM = BEFORE + going_on(still(ROOMS, (2.0, -2.0, 2.0), 1.0), BEFORE[-1])
CONFIG = ShuntingConfig(cell_m=0.1)
ABOUT = {row.path: row.about for row in CONFIG.rows()}


@pytest.mark.parametrize("path", PATHS)
def test_a_number_at_its_bounds_is_survived(path: str) -> None:
    for value in (ABOUT[path].low, ABOUT[path].high):
        for one in estimates(ShuntingSlam(CONFIG.changed({path: value})), STREAM):
            assert 0.0 <= one.diagnostics["p_lost"] <= 1.0
            eigenvalues = np.linalg.eigvalsh(one.covariance)
            assert eigenvalues.min() >= -1e-9 * eigenvalues.max()
            assert np.isfinite(eigenvalues).all()

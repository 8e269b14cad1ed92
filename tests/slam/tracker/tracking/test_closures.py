# SPDX-License-Identifier: Apache-2.0
"""Measures between key frames."""

import numpy as np
import pytest

from slam import se2
from slam.shunting import ShuntingConfig
from slam.tracker.matching.matcher import Matcher
from slam.tracker.network import Network
from slam.tracker.tracking.closures import Closures
from slam.tracker.tracking.keys import KeyFrames
from tests.slam.tracker.tracking.test_loops import seen
from tests.world2d import Drive, World2D, frames, laser, rectangle

CONFIG = ShuntingConfig(cell_m=0.05)
SAID_M, SAID_RAD = 0.2, 0.02  # deviation of a step by odometry


@pytest.mark.parametrize(("end_m", "along"), [(60.0, False), (7.0, True)])
def test_a_match_along_a_bare_corridor_says_nothing_of_the_way(end_m: float, along: bool) -> None:
    """Its end, once in view, does; across, the walls do in both."""
    corridor = World2D(rectangle(-40.0, -1.0, end_m, 1.0))
    drive = Drive((0.0, 0.0, 0.0), ((0.5, 0.0, 8.0),))
    stream = frames(corridor, drive, rate_hz=0.5, spec=laser(181, range_max=8.0), seed=5)
    keys = KeyFrames(CONFIG.loops)
    covariance = np.diag([SAID_M**2, SAID_M**2, SAID_RAD**2])
    closures = Closures(CONFIG, Matcher(CONFIG), lambda: Network(CONFIG), keys.keys)
    before = np.zeros(3)
    for frame in stream:
        assert frame.truth is not None
        motion = se2.between(before, frame.truth)
        keys.add(frame.truth, motion, covariance, seen(frame))
        before = frame.truth
    closures.chained.append(keys.keys[0].T_map_robot)
    for j in range(1, len(keys.keys)):
        edge = closures.step(j)
    x_m, y_m, turn_rad = np.sqrt(np.diag(np.linalg.inv(edge.information))).tolist()
    assert (x_m < 0.25 * SAID_M) == along
    assert (x_m > 0.9 * SAID_M) == (not along)
    assert y_m < 0.25 * SAID_M
    assert turn_rad < 0.5 * SAID_RAD

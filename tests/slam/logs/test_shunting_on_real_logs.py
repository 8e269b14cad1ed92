# SPDX-License-Identifier: Apache-2.0
"""What the shunting SLAM promises on real logs, against their corrected poses."""

from __future__ import annotations

import pytest

from slam import create, metrics
from slam.logs import open_log
from slam.replay import Replay


@pytest.mark.parametrize(("log", "limit_m"), [("intel", 0.30)])
def test_the_online_path_stays_near_the_corrected_one(data_folder, log, limit_m):
    replay = Replay.of({"shunting": create("shunting"), "odometry": create("odometry")})
    frames = sum(1 for _ in replay.run(open_log(data_folder(log) / f"{log}-corrected.log.xz")))
    truth = replay.truth()
    assert frames == len(truth) == 910
    error = metrics.ate(replay.tracks["shunting"].online(), truth, align="se2")
    drift = metrics.ate(replay.tracks["odometry"].online(), truth, align="se2")
    assert drift.value > 10.0
    assert error.value <= limit_m

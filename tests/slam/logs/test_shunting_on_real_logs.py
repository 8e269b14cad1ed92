# SPDX-License-Identifier: Apache-2.0
"""What the shunting SLAM promises on real logs, against their corrected poses."""

from __future__ import annotations

import numpy as np
import pytest

from slam import create
from slam.evaluation import metrics
from slam.logs import open_log
from slam.replay import Replay, Track
from slam.trajectory import Trajectory


@pytest.mark.parametrize(("log", "limit_m"), [("intel", 0.12)])
def test_the_online_path_stays_near_the_corrected_one(data_folder, log, limit_m):
    replay = Replay.of({"shunting": create("shunting"), "odometry": create("odometry")})
    frames = sum(1 for _ in replay.run(open_log(data_folder(log) / f"{log}-corrected.log.xz")))
    truth = replay.truth()
    assert frames == len(truth) == 910
    error = metrics.ate(replay.tracks["shunting"].online(), truth, align="se2")
    drift = metrics.ate(replay.tracks["odometry"].online(), truth, align="se2")
    assert drift.value > 10.0
    assert error.value <= limit_m


@pytest.mark.slow
def test_closed_loops_bring_the_museum_within_its_reference(data_folder):
    """406 m at a scan each metre, among visitors; the reference itself is good to a decimetre."""
    track = Track("shunting", create("shunting"))
    frames = list(open_log(data_folder("fhw_museum") / "fhw-corrected.log.xz"))
    assert track.survive(frames) is None
    truth = Trajectory(
        stamps_ns=np.array([f.stamp_ns for f in frames]), poses=np.array([f.truth for f in frames])
    )
    final = track.final()
    assert final is not None
    assert metrics.ate(final, truth, align="se2").value <= 0.15

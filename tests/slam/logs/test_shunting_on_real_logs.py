# SPDX-License-Identifier: Apache-2.0
"""What the shunting SLAM promises on real logs, against their corrected poses.

On Intel it is in ``tests/golden``, beside the digest of the same run.
"""

import numpy as np
import pytest

from slam import create
from slam.evaluation import metrics
from slam.logs import open_log
from slam.replay import Track
from slam.trajectory import Trajectory

pytestmark = pytest.mark.slow


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

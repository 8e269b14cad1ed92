# SPDX-License-Identifier: Apache-2.0
"""Frames left out: what the odometry stated of them is not lost, and nothing is made up."""

from __future__ import annotations

import numpy as np
import pytest

from sim.moments import Moment, thinned
from slam.frames import Frame, Odometry


def moments(stated):
    for k, part in enumerate(stated):
        covariance = None if part is None else np.diag([part, part, part])
        odometry = Odometry(stamp_ns=k, T_odom_robot=np.zeros(3), increment_covariance=covariance)
        frame = Frame(stamp_ns=k, odometry=odometry)
        yield Moment(frame=frame, poses=np.zeros((0, 3)), moving=np.zeros(0, dtype=np.bool_))


@pytest.mark.parametrize(
    ("stated", "kept"),
    [
        ([0.5, 1.0, 2.0, 4.0, 8.0], [0.5, 3.0, 12.0]),
        ([None, 1.0, 2.0, None, 4.0], [None, 3.0, None]),
        ([None] * 3, [None, None]),
    ],
)
def test_covariances_are_added_up_and_none_stays_none(stated, kept):
    found = [moment.frame.odometry.increment_covariance for moment in thinned(moments(stated), 2)]
    assert [None if c is None else c[0, 0] for c in found] == kept

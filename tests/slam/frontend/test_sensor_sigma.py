# SPDX-License-Identifier: Apache-2.0
"""The sigma of ranges is the scanner's, and the config's number only where that states none."""

from dataclasses import replace

import numpy as np
import pytest

from slam.errors import InvalidValueError
from slam.frames import Frame, LaserSpec, Odometry, Scan
from slam.frontend.config import FRONTEND
from slam.frontend.observations import from_scan
from slam.shunting.slam import ShuntingConfig
from slam.system import create

SPEC = LaserSpec(n_beams=181, angle_min=-1.5, angle_increment=0.016)
CONFIG = ShuntingConfig()


def scan_of(spec: LaserSpec, stamp_ns: int = 0) -> Scan:
    ranges = (3.0 / np.maximum(np.cos(spec.angles), 0.3)).astype(np.float32)
    return Scan(stamp_ns=stamp_ns, ranges=ranges, spec=spec)


def test_a_scanner_that_states_its_sigma_is_believed():
    stated, silent = (from_scan(scan_of(s), np.zeros(3), CONFIG) for s in (
        replace(SPEC, range_sigma_m=0.08), SPEC,
    ))  # fmt: skip
    assert (stated.sensor_sigma_m, silent.sensor_sigma_m) == (0.08, FRONTEND.sensor_sigma_m)
    np.testing.assert_allclose(stated.covariances[:, 0], 0.08**2)
    np.testing.assert_allclose(silent.covariances[:, 0], (0.8 * CONFIG.cell_m) ** 2)


def test_it_reaches_the_pose_covariance():
    ends = []
    for sigma_m in (0.0, 0.01, 0.02):
        spec, slam = replace(SPEC, range_sigma_m=sigma_m), create("shunting")
        for k in range(8):
            odometry = Odometry(stamp_ns=k * 10**8, T_odom_robot=np.array([0.01 * k, 0.0, 0.0]))
            frame = Frame(stamp_ns=k * 10**8, odometry=odometry, scan=scan_of(spec, k * 10**8))
            estimate = slam.update(frame)
        ends.append(estimate.covariance)
    np.testing.assert_array_equal(ends[0], ends[1])  # 10 mm is what the config says
    assert not np.array_equal(ends[1], ends[2])


@pytest.mark.parametrize("value", [-0.01, np.nan, 11.0, True, "0.01"])
def test_what_is_no_sigma_is_refused(value):
    with pytest.raises(InvalidValueError, match=r"LaserSpec\.range_sigma_m"):
        replace(SPEC, range_sigma_m=value)

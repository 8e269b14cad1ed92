# SPDX-License-Identifier: Apache-2.0
"""A scan has the numbers of the message that a bag and a ROS node say it by."""

import math
from typing import Any

import numpy as np
import pytest

from slam import Frame, LaserSpec, Odometry, Scan
from slam.errors import InvalidValueError
from slam.ros.frames import FrameMessages
from slam.ros.template import STORE

STEP, TURN_S = math.radians(0.5), 1.0 / 75.0
NAMES = ("angle_min", "angle_max", "angle_increment", "range_min", "range_max", "scan_time")


def scan(times: np.ndarray) -> Scan:
    """Of a scanner whose k-th beam, counter-clockwise, is measured ``times[k]`` turns later."""
    spec = LaserSpec(
        n_beams=len(times), angle_min=-1.0, angle_increment=STEP, range_min=0.1, range_max=30.0,
        beam_time_offsets=times * TURN_S,
    )  # fmt: skip
    ranges = np.linspace(1.0, 7.0, len(times), dtype=np.float32)
    return Scan(stamp_ns=5, ranges=ranges, intensities=2.0 * ranges, spec=spec)


def message(said: Scan) -> Any:
    """The sensor_msgs/LaserScan of the whole scan."""
    frame = Frame(stamp_ns=5, odometry=Odometry(stamp_ns=5, T_odom_robot=np.zeros(3)), scan=said)
    whole = next(FrameMessages(said.spec, intensities=True).scans(frame))
    return STORE.deserialize_cdr(bytes(whole.data), "sensor_msgs/msg/LaserScan")


BEAMS = np.arange(61)
ALONG = BEAMS * STEP / math.tau


@pytest.mark.parametrize("times", [ALONG, ALONG + BEAMS % 2, 0.0 * ALONG])
def test_a_scan_has_the_names_of_its_message(times: np.ndarray) -> None:
    mine = scan(times)
    theirs = message(mine)
    for name in (*NAMES, "ranges", "intensities"):
        np.testing.assert_allclose(getattr(mine, name), getattr(theirs, name), rtol=1e-6)
    np.testing.assert_allclose(mine.angle_min + BEAMS * mine.angle_increment, mine.spec.angles)


def test_one_time_for_all_beams_is_said_only_where_it_is_true() -> None:
    steady = scan(ALONG)
    assert steady.time_increment == pytest.approx(message(steady).time_increment, rel=1e-6)
    ends = BEAMS * steady.time_increment
    np.testing.assert_allclose(ends, steady.spec.beam_time_offsets, atol=1e-9)
    for other in (ALONG + BEAMS % 2, ALONG[::-1]):
        with pytest.raises(InvalidValueError, match="beam_time_offsets has the time of each"):
            _ = scan(other).time_increment

# SPDX-License-Identifier: Apache-2.0
"""Numbers survive the narrower fields of ROS messages."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slam import se2
from slam.logs.ros_numbers import (
    quaternion_of,
    round_angle,
    round_number,
    round_period,
    yaw_of,
)

# But for angles of which the half has not all digits any more.
ANGLES = st.floats(-math.pi, math.pi).filter(
    lambda theta: theta == 0.0 or abs(theta) > 1e-300
) | st.floats(1e-9, 1e-3)


@given(ANGLES)
def test_a_heading_survives_as_a_quaternion_of_length_one(theta):
    z, w = quaternion_of(theta)
    assert yaw_of(0.0, 0.0, z, w) == theta
    assert z * z + w * w == pytest.approx(1.0, abs=1e-14)


@given(ANGLES)
def test_both_quaternions_of_a_rotation_have_its_heading(theta):
    z, w = quaternion_of(theta)
    assert abs(se2.wrap(yaw_of(0.0, 0.0, -z, -w) - theta)) < 1e-12
    tilted = 1e-9
    assert abs(se2.wrap(yaw_of(tilted, 0.0, z, w) - theta)) < 1e-6


def float32(value: float) -> float:
    return float(np.float32(value))


@given(st.integers(-36000, 36000))
def test_round_numbers_survive_float32(k):
    angle, number = math.radians(k / 100.0), k / 1000.0
    assert round_angle(float32(angle)) == angle
    assert round_number(float32(number)) == number
    if k > 0:
        assert round_period(float32(1.0 / k)) == 1.0 / k


@given(st.floats(2.0**-20, 6.0, width=32))
def test_what_is_no_round_number_stays_the_float32_that_it_is(value):
    for function in (round_angle, round_number, round_period):
        assert float32(function(value)) == value


def test_no_period_is_zero():
    assert round_period(0.0) == 0.0

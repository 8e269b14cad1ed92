# SPDX-License-Identifier: Apache-2.0
"""The types that flow: what they refuse, and that nobody can change them afterwards."""

import dataclasses
import math

import numpy as np
import pytest

from slam import BeamLabels, Features, Frame, LaserSpec, Odometry, Scan, Stream, StreamMetadata
from slam.errors import InvalidValueError, MobiliaError
from slam.frames import to_ns, to_s

SPEC = LaserSpec(n_beams=3, angle_min=-0.5, angle_increment=0.5, range_max=30.0)


def scan(ranges=(1.0, 2.0, 3.0), **changes):
    return Scan(**{"stamp_ns": 5, "ranges": ranges, "spec": SPEC, **changes})


def odometry(**changes):
    return Odometry(**{"stamp_ns": 5, "T_odom_robot": [0.0, 0.0, 0.0], **changes})


def features(**changes):
    one = {"stamp_ns": 5, "points_robot": [[1.0, 2.0]], "covariances": [np.eye(2)], "ids": [7]}
    return Features(**{**one, **changes})


def labels(n=3):
    zero = [0] * n
    return BeamLabels(body=zero, kind=zero, displacement=zero, incidence=zero, mixed=zero)


LASER = {"n_beams": 3, "angle_min": 0.0, "angle_increment": 0.1}


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"n_beams": 0}, "n_beams"),
        ({"angle_increment": 0.0}, "angle_increment"),
        ({"range_min": -1.0}, "range_min"),
        ({"range_min": 80.0}, "range_min"),
        ({"range_max": math.nan}, "range_max"),
        ({"beam_time_offsets": [0.0, 0.1]}, r"beam_time_offsets must have shape \(3\)"),
        ({"beam_time_offsets": [0.0, -0.1, 0.0]}, "beam_time_offsets must be >= 0"),
        ({"angle_increment": 180.0}, "3 beams within one turn"),
        ({"T_robot_laser": [0.0, 0.0]}, "T_robot_laser"),
    ],
)
def test_a_scanner_that_cannot_be(changes, message):
    with pytest.raises(InvalidValueError, match=message):
        LaserSpec(**{**LASER, **changes})


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: scan(ranges=[1.0, 2.0]), r"Scan.ranges must have shape \(3\), got \(2,\)"),
        (lambda: scan(ranges=[1.0, -0.5, 2.0]), r"Scan.ranges\[1\] must be >= 0"),
        (lambda: scan(ranges=[1.0, 1e300, 2.0]), "Scan.ranges must be numeric"),
        (lambda: scan(stamp_ns=5.0), "stamp_ns must be an integer"),
        (lambda: odometry(T_odom_robot=[0.0, math.nan, 0.0]), "T_odom_robot must be finite"),
        (lambda: odometry(twist=[0.0, math.inf, 0.0]), "twist must be finite"),
        (
            lambda: odometry(increment_covariance=np.triu(np.ones((3, 3)))),
            "symmetric with variances >= 0",
        ),
        (
            lambda: odometry(increment_covariance=[[1e-4, 1e-2, 0], [1e-2, 1e-4, 0], [0, 0, 1e-4]]),
            "increment_covariance must be positive semidefinite",
        ),
        (lambda: features(points_robot=[[1.0, 2.0, 3.0]]), "points_robot"),
        (lambda: features(covariances=[[[1.0, 0.5], [0.0, 1.0]]]), "symmetric"),
        (
            lambda: features(covariances=[[[1e-3, 5e-2], [5e-2, 1e-3]]]),
            r"Features.covariances\[0\] must be positive semidefinite",
        ),
        (lambda: features(ids=[1.5]), "ids must be numeric: expected whole numbers"),
        (
            lambda: BeamLabels(body=[0], kind=[256], displacement=[0], incidence=[0], mixed=[0]),
            "BeamLabels.kind must be numeric",
        ),
        (lambda: Frame(stamp_ns=6, odometry=odometry()), "Frame.stamp_ns"),
        (
            lambda: Frame(stamp_ns=5, odometry=odometry(), scan=scan(stamp_ns=4)),
            "5 ns beside 5 ns and 4 ns",
        ),
        (lambda: Frame(stamp_ns=5, odometry=odometry(), labels=labels()), "labels"),
        (lambda: Frame(stamp_ns=5, odometry=odometry(), scan=scan(), labels=labels(2)), "labels"),
    ],
)
def test_what_cannot_be_is_refused_by_name(make, message):
    with pytest.raises(InvalidValueError, match=message) as caught:
        make()
    assert isinstance(caught.value, MobiliaError)
    assert isinstance(caught.value, ValueError)


def test_arrays_are_copies_that_nobody_can_write():
    ranges = np.array([1.0, 2.0, 3.0], dtype=np.float32)
    made = scan(ranges=ranges)
    ranges[0] = 9.0
    assert made.ranges[0] == 1.0
    arrays = [
        made.ranges,
        SPEC.angles,
        SPEC.beam_time_offsets,
        SPEC.T_robot_laser,
        odometry().T_odom_robot,
        features().points_robot,
        Frame(stamp_ns=5, odometry=odometry(), truth=[1.0, 2.0, 3.0]).truth,
        labels().kind,
    ]
    for array in arrays:
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0
    with pytest.raises(dataclasses.FrozenInstanceError):
        made.ranges = ranges


def test_rep_117_values_pass_and_are_not_valid_ranges():
    made = scan(ranges=[math.inf, math.nan, 31.0])
    assert not made.valid.any()
    assert scan(ranges=[0.001, 1.0, 30.0]).valid.all()
    assert scan(ranges=[0.0, 1.0, 30.0]).valid.tolist() == [False, True, True]


def test_covariances_may_be_singular_and_rounded():
    for singular in (
        np.zeros((3, 3)),
        np.ones((3, 3)),
        np.outer([1.0, -2.0, 3.0], [1.0, -2.0, 3.0]),
    ):
        for scale in (1e-12, 1e-4, 1e4):
            rounded = (scale * singular).astype(np.float32)
            odometry(increment_covariance=rounded)


def test_beam_times_are_whole_nanoseconds_and_angles_count_up():
    spec = LaserSpec(**LASER, beam_time_offsets=[0.0, 1.0 / 3.0, 0.1 + 1e-13])
    np.testing.assert_array_equal(spec.beam_time_offsets, [0.0, 0.333333333, 0.1])
    assert spec.sweep_duration == 0.333333333
    np.testing.assert_allclose(SPEC.angles, [-0.5, 0.0, 0.5])


def test_a_robot_does_not_get_the_truth():
    frame = Frame(
        stamp_ns=5,
        odometry=odometry(),
        scan=scan(),
        features=features(),
        truth=[1.0, 2.0, 3.0],
        labels=labels(),
    )
    blind = frame.without_truth()
    assert blind.truth is None
    assert blind.labels is None
    assert blind.features.ids is None
    np.testing.assert_array_equal(blind.features.points_robot, frame.features.points_robot)
    assert blind.scan is frame.scan


def test_stamps_survive_seconds_and_streams_repeat():
    for stamp_ns in (0, 1, -1, 123_456_789_012, 10**15 + 1):
        assert to_ns(to_s(stamp_ns)) == stamp_ns
    frames = [Frame(stamp_ns=5, odometry=odometry())]
    stream = Stream(metadata=StreamMetadata(source="test"), frames=lambda: frames, length=1)
    assert list(stream) == list(stream) == frames


def test_equality_is_by_content():
    one, again = scan(ranges=[1.0, math.nan, 2.0]), scan(ranges=[1.0, math.nan, 2.0])
    assert one == again
    assert one != scan(ranges=[1.0, math.nan, 2.5])
    assert one != "a scan"

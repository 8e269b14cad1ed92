# SPDX-License-Identifier: Apache-2.0
"""What goes over the pipe comes back the same, to the last bit; what is no answer is told apart."""

import json
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slam.errors import SlamFailedError
from slam.frames import Features, Frame, LaserSpec, Odometry, Scan
from slam.guests import protocol
from slam.system import Estimate, Raster
from slam.trajectory import Trajectory

doubles = st.floats(allow_nan=False, allow_infinity=False)
poses = st.tuples(doubles, doubles, doubles)
stamps = st.integers(-(2**62), 2**62)


def through(line: bytes) -> dict[str, object]:
    assert line.endswith(b"\n")
    assert line.count(b"\n") == 1
    json.loads(line, parse_constant=lambda word: pytest.fail(f"{word} is no JSON"))
    return protocol.message_of(line)


@settings(max_examples=60, deadline=None)
@given(
    stamps,
    poses,
    st.lists(st.floats(0.0, width=32) | st.just(math.nan), min_size=1, max_size=9),
    st.booleans(),
)
def test_a_frame_survives_the_pipe(stamp_ns, wheels, ranges, bare):
    spec = LaserSpec(
        n_beams=len(ranges),
        angle_min=-math.pi / 2,
        angle_increment=0.1 / 3.0,
        range_max=80.0,
        beam_time_offsets=np.arange(len(ranges)) / 37.5 / 3.0,
        T_robot_laser=np.array([0.1, -1e-17, 2.0 / 3.0]),
    )
    odometry = Odometry(
        stamp_ns=stamp_ns,
        T_odom_robot=np.array(wheels),
        increment_covariance=None if bare else np.diag([0.1, 1e-300, 1.0 / 3.0]),
        twist=None if bare else np.array([0.1, 0.2, 0.3]),
    )
    intensities = None if bare else np.full(len(ranges), np.nan, np.float32)
    scan = Scan(stamp_ns=stamp_ns, ranges=ranges, spec=spec, intensities=intensities)
    frame = Frame(stamp_ns=stamp_ns, odometry=odometry, scan=scan)
    first = protocol.frame_of(through(protocol.frame_line(frame, None)), None)
    assert first == frame
    again = through(protocol.frame_line(frame, spec))
    assert "laser" not in again
    assert protocol.frame_of(again, first.scan.spec) == frame
    one_less = LaserSpec(n_beams=len(ranges), angle_min=0.0, angle_increment=0.1)
    assert "laser" in through(protocol.frame_line(frame, one_less))


@settings(max_examples=200, deadline=None)
@given(st.integers(0, 2**31 - 1))
def test_every_float32_survives(bits):
    value = np.array([bits], dtype=np.int32).view(np.float32)
    spec = LaserSpec(n_beams=1, angle_min=0.0, angle_increment=0.1)
    odometry = Odometry(stamp_ns=0, T_odom_robot=np.zeros(3))
    frame = Frame(stamp_ns=0, odometry=odometry, scan=Scan(stamp_ns=0, ranges=value, spec=spec))
    assert protocol.frame_of(through(protocol.frame_line(frame, None)), None) == frame


def test_features_survive_without_their_identities():
    features = Features(
        stamp_ns=5,
        points_robot=np.array([[1.0, 2.0], [0.1, -0.3]]),
        covariances=np.array([np.eye(2) / 3.0, [[2.0, 0.1], [0.1, 1.0]]]),
        ids=np.array([3, 4]),
    )
    odometry = Odometry(stamp_ns=5, T_odom_robot=np.zeros(3))
    frame = Frame(
        stamp_ns=5, odometry=odometry, features=features, truth=np.array([9.25, 0.0, 0.0])
    )
    line = protocol.frame_line(frame, None)
    assert b"9.25" not in line
    assert protocol.frame_of(through(line), None) == frame.without_truth()


@settings(max_examples=60, deadline=None)
@given(stamps, poses, st.booleans())
def test_an_estimate_survives(stamp_ns, pose, converged):
    estimate = Estimate(
        stamp_ns=stamp_ns,
        T_map_robot=np.array(pose),
        covariance=np.array([[0.1, 1e-5, 0], [1e-5, 2.0 / 3.0, 0], [0, 0, 1e-9]]),
        converged=converged,
        diagnostics={"state": "tracking", "matched": np.float64(0.5), "gap": np.nan},
    )
    message = through(protocol.line(protocol.estimate_message(estimate)))
    back = protocol.estimate_of(message, stamp_ns)
    np.testing.assert_array_equal(back.T_map_robot, estimate.T_map_robot)
    np.testing.assert_array_equal(back.covariance, estimate.covariance)
    assert back.converged is converged
    assert back.diagnostics == {"state": "tracking", "matched": 0.5, "gap": None}


def test_a_map_and_a_trajectory_survive():
    values = np.array([[np.nan, 0.0, 1.0], [0.1, 1.0 / 3.0, np.nan]], np.float32)
    raster = Raster(values=values, resolution_m=0.05, T_map_origin=np.array([-1.0, 0.1, 0.0]))
    back = protocol.map_of(through(protocol.map_message(raster)))
    np.testing.assert_array_equal(back.values, values)
    np.testing.assert_array_equal(back.T_map_origin, raster.T_map_origin)
    assert back.resolution_m == 0.05
    assert protocol.map_of(through(protocol.map_message(None))) is None
    final = Trajectory(stamps_ns=np.array([1, 2**60]), poses=np.array([[0.1, 2, 3], [4, 5, 1e-9]]))
    again = protocol.trajectory_of(through(protocol.line(protocol.trajectory_message(final))))
    np.testing.assert_array_equal(again.stamps_ns, final.stamps_ns)
    np.testing.assert_array_equal(again.poses, final.poses)


GOOD = {"type": "estimate", "stamp_ns": 7, "T_map_robot": [1.0, 2.0, 3.0]}


@pytest.mark.parametrize(
    ("change", "outcome", "says"),
    [
        ({"stamp_ns": 8}, "bad", "answered for 8 ns instead of 7 ns"),
        ({"stamp_ns": 7.5}, "bad", "stamp_ns must be a whole number, got 7.5"),
        ({"stamp_ns": None}, "bad", "stamp_ns must be a whole number, got None"),
        ({"T_map_robot": [1.0, 2.0]}, "bad", "T_map_robot must be 3 values"),
        ({"T_map_robot": [1.0, 2.0, "3"]}, "bad", r"T_map_robot\[2\] must be a number"),
        ({"T_map_robot": [1.0, True, 3.0]}, "bad", r"T_map_robot\[1\] must be a number"),
        ({"T_map_robot": {"x": 1}}, "bad", "T_map_robot must be 3 values"),
        ({"T_map_robot": [10**400, 0, 0]}, "bad", r"T_map_robot\[0\] must be a number"),
        ({"T_map_robot": [None, 2.0, 3.0]}, "nan", "must be finite"),
        ({"T_map_robot": [1.0, math.nan, 3.0]}, "nan", "must be finite"),
        ({"covariance": [1.0] * 8}, "bad", "covariance must be a list of 9 values"),
        ({"covariance": [-1.0, 0, 0, 0, 1, 0, 0, 0, 1]}, "bad", "variances >= 0"),
        ({"covariance": [math.inf, 0, 0, 0, 1, 0, 0, 0, 1]}, "nan", "must be finite"),
        ({"converged": 1}, "bad", "converged must be True or False, got 1"),
        ({"diagnostics": "fine"}, "bad", "diagnostics must be a table"),
    ],
)
def test_what_is_no_estimate_is_told_apart(change, outcome, says):
    with pytest.raises(SlamFailedError, match=says) as got:
        protocol.estimate_of({**GOOD, **change}, 7)
    assert got.value.outcome == outcome


@pytest.mark.parametrize("word", ["nan", "-nan", "inf", "-inf", "NaN", "-Infinity", "nan(ind)"])
def test_numbers_as_c_prints_them_are_understood_to_be_none(word):
    line = f'{{"type":"estimate","stamp_ns":7,"T_map_robot":[1.5, {word},0]}}\n'.encode()
    with pytest.raises(SlamFailedError) as got:
        protocol.estimate_of(protocol.message_of(line), 7)
    assert got.value.outcome == "nan"


def test_no_number_is_looked_for_through_the_whole_line():
    """An open bracket after each of many nan would make the line read as often as it has some."""
    line = b'{"type":"estimate","stamp_ns":7,"T_map_robot":[nan(' + b"x" * 41 + b"),0,0]}"
    with pytest.raises(SlamFailedError, match="no JSON object"):
        protocol.message_of(line)


@pytest.mark.parametrize("line", [b"\n", b"ready.\n", b"[1]\n", b"\xff{}\n", b"{" * 100000, b"5\n"])
def test_garbage_is_no_message(line):
    with pytest.raises(SlamFailedError, match="no JSON object") as got:
        protocol.message_of(line)
    assert got.value.outcome == "bad"
    assert len(str(got.value)) < 200


@pytest.mark.parametrize(
    "change",
    [
        {"width": 3},
        {"width": -2, "height": -1},
        {"height": True, "width": 2},
        {"resolution_m": 0.0},
        {"resolution_m": "fine"},
        {"values": [0.0, 2.0]},
        {"T_map_origin": [0.0, 0.0]},
        {"values": 5},
        {"values": [True, 0.0]},
        {"width": protocol.MAX_CELLS + 1},
        {"width": protocol.MAX_CELLS, "height": 2},
        {"width": 10**3000, "height": 10**3000},
    ],
)
def test_what_is_no_map_is_bad(change):
    good = {"type": "map", "width": 2, "height": 1, "resolution_m": 0.1, "values": [0, -1],
            "T_map_origin": [0, 0, 0]}  # fmt: skip
    assert protocol.map_of(good) is not None
    with pytest.raises(SlamFailedError) as got:
        protocol.map_of({**good, **change})
    assert got.value.outcome == "bad"
    assert len(str(got.value)) < 250


@pytest.mark.parametrize(
    ("change", "outcome"),
    [
        ({"stamps_ns": [1, 1]}, "bad"),
        ({"stamps_ns": [1.0, 2]}, "bad"),
        ({"stamps_ns": [1, 2**70]}, "bad"),
        ({"poses": [0.0] * 5}, "bad"),
        ({"poses": [0.0, 0.0, None] * 2}, "nan"),
    ],
)
def test_what_is_no_trajectory_is_told_apart(change, outcome):
    good = {"type": "trajectory", "stamps_ns": [1, 2], "poses": [0.0] * 6}
    assert len(protocol.trajectory_of(good)) == 2
    with pytest.raises(SlamFailedError) as got:
        protocol.trajectory_of({**good, **change})
    assert got.value.outcome == outcome

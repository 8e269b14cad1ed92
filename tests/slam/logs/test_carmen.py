# SPDX-License-Identifier: Apache-2.0
"""CARMEN logs that are whole: poses, ranges, times and geometry come out as they went in."""

import lzma
import math
from itertools import pairwise

import numpy as np
import pytest

from slam import Frame, LaserSpec, Odometry, Scan, Stream, StreamMetadata, se2
from slam.errors import InvalidValueError, LogFormatError
from slam.frames import to_ns
from slam.logs import open_log, read_carmen, write_carmen


def read(tmp_path, text, name="a.log"):
    path = tmp_path / name
    path.write_text(text)
    return read_carmen(path)


def odometry(stream):
    return np.array([f.odometry.T_odom_robot for f in stream])


@pytest.mark.parametrize(
    ("folder", "log", "derived", "scans", "no_return", "stepped_back"),
    [
        ("intel", "intel-corrected.log.xz", "intel-poses-derived.txt.xz", 910, 4172, 4),
        ("fhw_museum", "fhw-corrected.log.xz", "fhw-poses-derived.txt.xz", 488, 647, 0),
    ],
)
def test_real_logs_give_the_derived_odometry(
    data_folder, folder, log, derived, scans, no_return, stepped_back
):
    stream = open_log(data_folder(folder) / log)
    with lzma.open(data_folder(folder) / derived, "rt") as file:
        table = np.loadtxt(file)
    table = table[np.argsort(table[:, 1], kind="stable")]  # the file is in the log's order
    frames = list(stream)

    assert len(frames) == stream.length == scans
    recovered = odometry(frames)
    np.testing.assert_allclose(recovered[:, :2], table[:, 2:4], atol=1e-3)
    np.testing.assert_allclose(se2.wrap_array(recovered[:, 2] - table[:, 4]), 0.0, atol=1e-5)
    np.testing.assert_allclose([f.truth for f in frames], table[:, 5:8], atol=1e-9)
    np.testing.assert_allclose([f.stamp for f in frames], table[:, 1], atol=1e-9)
    assert all(b.stamp_ns > a.stamp_ns for a, b in pairwise(frames))
    assert stream.metadata.extra["stamps_stepped_back"] == stepped_back
    assert stream.metadata.truth == "corrected poses of the log"
    assert np.isinf([f.scan.ranges for f in frames]).sum() == no_return
    assert stream.metadata.laser.angles[0] == pytest.approx(-math.pi / 2)
    assert stream.metadata.laser.angles[-1] == pytest.approx(math.radians(89.0))


def test_flaser_takes_the_robot_pose_and_finds_the_mount(tmp_path, carmen_text):
    stream = read(tmp_path, carmen_text.plain_log(offset=0.12))
    np.testing.assert_allclose(odometry(stream), carmen_text.path_poses(8), atol=1e-6)
    np.testing.assert_allclose(stream.metadata.laser.T_robot_laser, [0.12, 0.0, 0.0], atol=2e-6)
    assert stream.metadata.truth == ""
    assert all(frame.truth is None for frame in stream)
    assert [frame.stamp_ns for frame in stream] == [to_ns(k + 0.5) for k in range(8)]
    assert stream.metadata.laser.angle_increment == pytest.approx(math.radians(1.0))
    first = next(iter(stream)).scan.ranges
    np.testing.assert_allclose(first[:3], [2.0, 2.07, 2.14], rtol=1e-6)


def test_a_laser_pose_that_moves_on_the_robot_is_the_corrected_pose(tmp_path, carmen_text):
    poses = carmen_text.path_poses(6)
    drifting = [se2.compose([0.0, 0.0, 0.02 * k], pose) for k, pose in enumerate(poses)]
    log = [carmen_text.flaser(k, k, poses[k], drifting[k]) for k in range(6)]
    stream = read(tmp_path, "".join(log))
    np.testing.assert_allclose(odometry(stream), drifting, atol=1e-6)
    np.testing.assert_allclose([f.truth for f in stream], poses, atol=1e-6)
    assert stream.metadata.truth == "corrected poses of the log"


def chained_log(carmen_text, corrections):
    """A mapper's output: after each scan ODOM restarts from the corrected pose."""
    increments = [np.array([0.4, 0.01 * k, 0.1]) for k in range(len(corrections))]
    pose = np.array([1.0, 2.0, 0.5])
    raw, lines, corrected = [pose], [], []
    for k, (increment, correction) in enumerate(zip(increments, corrections, strict=True)):
        last = se2.compose(pose, increment)
        lines.append(carmen_text.odom(k, se2.compose(pose, increment * 0.5)))
        lines.append(carmen_text.odom(k + 0.5, last))
        pose = se2.compose(last, correction)
        corrected.append(pose)
        if k > 0:
            raw.append(se2.compose(raw[-1], increment))
        else:
            raw = [pose]
        lines.append(carmen_text.flaser(k, k + 0.5, pose, pose))
        lines.append(carmen_text.odom(0.0, pose))
        lines.append("NEFF 17.0\n")
    return "".join(lines), np.array(raw), np.array(corrected)


def test_raw_odometry_is_recovered_from_a_chained_log(tmp_path, carmen_text):
    corrections = [np.array([0.03, -0.02, 0.01 * (-1) ** k]) for k in range(12)]
    text, raw, corrected = chained_log(carmen_text, corrections)
    stream = read(tmp_path, text)
    np.testing.assert_allclose(odometry(stream), raw, atol=1e-5)
    np.testing.assert_allclose([f.truth for f in stream], corrected, atol=1e-6)
    assert stream.metadata.extra["ignored"] == {"NEFF": 12}


def test_a_standing_robot_is_not_taken_for_a_chained_log(tmp_path, carmen_text):
    pose = [1.0, 2.0, 0.3]
    lines = [carmen_text.odom(0.0, pose)]
    for k in range(5):
        lines += [carmen_text.flaser(k, k + 0.5, pose, pose), carmen_text.odom(k + 1.0, pose)]
    assert read(tmp_path, "".join(lines)).metadata.truth == ""


@pytest.mark.parametrize("tail", ["0 0 0 0 0", "0.1 0.2 0 0"])
@pytest.mark.parametrize("mode", ["", " 0"])
def test_robotlaser_brings_its_own_geometry(tmp_path, carmen_text, tail, mode):
    mount = np.array([0.2, -0.05, 0.1])
    poses = carmen_text.path_poses(5)
    log = [
        carmen_text.robotlaser(k, k, se2.compose(p, mount), p, tail=tail, mode=mode)
        for k, p in enumerate(poses)
    ]
    stream = read(tmp_path, "".join(log))
    spec = stream.metadata.laser
    np.testing.assert_allclose(odometry(stream), poses, atol=1e-6)
    np.testing.assert_allclose(spec.T_robot_laser, mount, atol=3e-6)
    assert (spec.n_beams, spec.range_max) == (181, 8.0)
    np.testing.assert_allclose(spec.angles[[0, -1]], [-math.pi / 2, math.pi / 2], atol=1e-4)


def test_rawlaser_gets_its_pose_from_odom_lines(tmp_path, carmen_text):
    twist = np.array([0.5, 0.0, 0.2])
    lines = [carmen_text.rawlaser(0, 0.5)]  # before the first ODOM: dropped
    for k in range(1, 6):
        lines.append(carmen_text.odom(k, se2.exp(twist, k)))
        lines.append(carmen_text.rawlaser(k, k + 0.25))
    stream = read(tmp_path, "".join(lines))
    expected = [se2.exp(twist, k + 0.25) for k in range(1, 5)]
    np.testing.assert_allclose(odometry(stream), expected, atol=1e-6)
    assert stream.metadata.extra["scans_without_odometry"] == 2  # the last ODOM is older too


def test_of_several_scan_messages_one_is_read_and_the_others_counted(tmp_path, carmen_text):
    poses = carmen_text.path_poses(3)
    lines = []
    for k, pose in enumerate(poses):
        lines += [carmen_text.rawlaser(k, k), carmen_text.robotlaser(k, k, pose, pose)]
    stream = read(tmp_path, "".join(lines))
    assert stream.length == 3
    assert stream.metadata.extra["ignored"] == {"RAWLASER1": 3}


def test_ranges_at_the_maximum_are_no_return_and_zero_is_an_error_code(tmp_path, carmen_text):
    text = carmen_text.plain_log(4).replace(" 2.07 ", " 0 ").replace(" 2.14 ", " 30.0 ")
    stream = read(tmp_path, "PARAM robot_front_laser_max 30.0 nohost 0\n" + text)
    ranges = np.array([frame.scan.ranges for frame in stream])
    assert np.isposinf(ranges).sum() == stream.metadata.extra["ranges_at_max"] > 0
    assert np.isnan(ranges).sum() == stream.metadata.extra["ranges_zero"] > 0
    assert stream.metadata.laser.range_max == 30.0
    assert stream.metadata.extra["range_max_source"] == "PARAM"


def test_a_saturation_code_below_the_maximum_is_found(tmp_path, carmen_text):
    text = "PARAM robot_front_laser_max 81.9 nohost 0\n" + carmen_text.plain_log(20)
    coded = text.replace(" 2.07 ", " 81.83 ")
    stream = read(tmp_path, coded)
    assert stream.metadata.laser.range_max == 81.83
    assert np.isposinf([f.scan.ranges for f in stream]).sum() == coded.count(" 81.83 ")
    untouched = read(tmp_path, text)
    assert untouched.metadata.laser.range_max == 81.9
    assert np.isfinite([f.scan.ranges for f in untouched]).all()


def made_stream():
    spec = LaserSpec(
        n_beams=5,
        angle_min=-1.0,
        angle_increment=0.5,
        range_max=30.0,
        T_robot_laser=[0.1, 0.2, 3.0],
    )
    frames = []
    for k in range(4):
        stamp_ns = 1_700_000_000_123_456_789 + 40_000_001 * k
        ranges = np.array([1.1, np.inf, np.nan, 29.9, 0.3], dtype=np.float32)
        frames.append(
            Frame(
                stamp_ns=stamp_ns,
                scan=Scan(stamp_ns=stamp_ns, ranges=ranges, spec=spec, intensities=np.arange(5)),
                odometry=Odometry(stamp_ns=stamp_ns, T_odom_robot=[0.1 * k, -1e-7 * k, 3.1]),
                truth=[1.0 + 0.1 * k, 2.0, -3.1],
            )
        )
    return Stream(metadata=StreamMetadata(source="test"), frames=lambda: frames, length=4)


@pytest.mark.parametrize("name", ["a.log", "a.log.gz", "a.log.xz"])
def test_written_logs_read_back_the_same(tmp_path, name):
    made = made_stream()
    write_carmen(tmp_path / name, made)
    first_bytes = (tmp_path / name).read_bytes()
    write_carmen(tmp_path / name, made)
    assert (tmp_path / name).read_bytes() == first_bytes
    stream = open_log(tmp_path / name)
    for a, b in zip(made, stream, strict=True):
        assert a.stamp_ns == b.stamp_ns
        np.testing.assert_array_equal(a.scan.ranges, b.scan.ranges)
        np.testing.assert_array_equal(a.scan.intensities, b.scan.intensities)
        np.testing.assert_array_equal(a.odometry.T_odom_robot, b.odometry.T_odom_robot)
        np.testing.assert_array_equal(a.truth, b.truth)
        np.testing.assert_allclose(b.scan.spec.T_robot_laser, [0.1, 0.2, 3.0], atol=1e-12)
        np.testing.assert_array_equal(a.scan.spec.angles, b.scan.spec.angles)
    assert stream.metadata.truth == "TRUEPOS of the log"


def test_a_stream_without_scans_is_not_written(tmp_path):
    frame = Frame(stamp_ns=0, odometry=Odometry(stamp_ns=0, T_odom_robot=[0.0, 0.0, 0.0]))
    stream = Stream(metadata=StreamMetadata(source="test"), frames=lambda: [frame])
    with pytest.raises(InvalidValueError, match="no scan"):
        write_carmen(tmp_path / "a.log", stream)
    assert list(tmp_path.iterdir()) == []


def short_odom(line):
    """``ODOM x y theta t``, as particle filters write it."""
    words = line.split()
    return " ".join([*words[:4], words[-3]]) + "\n"


@pytest.mark.parametrize("at", [0, 1, 6])
def test_a_short_odom_line_among_others_is_told_by_its_own_number(tmp_path, carmen_text, at):
    odom = [carmen_text.odom(k + 0.5, pose) for k, pose in enumerate(carmen_text.path_poses(7))]
    odom[at] = short_odom(odom[at])
    text = "# a header\n" + "".join(f"{line}NEFF 12.5\n" for line in odom)
    with pytest.raises(LogFormatError, match=rf"a\.log:{2 + 2 * at}: ODOM has 10 words, got 5"):
        read(tmp_path, text)


def test_the_own_log_of_a_particle_filter(tmp_path, carmen_text):
    poses = carmen_text.path_poses(6)
    lines = ["PARAM particles 30\n"]
    for k, pose in enumerate(poses):
        ranges, at = carmen_text.ranges(k), carmen_text.words(pose)
        lines += [short_odom(carmen_text.odom(k, pose)), "NEFF 12.5\n"]
        lines += [f"LASER_READING 181 {ranges} {at} {k}.000000\n"]
    stream = read(tmp_path, "".join(lines))
    np.testing.assert_allclose(odometry(stream), poses, atol=1e-6)
    assert [frame.stamp_ns for frame in stream] == [to_ns(k) for k in range(6)]
    assert stream.metadata.truth == ""
    assert stream.metadata.extra["ignored"] == {"NEFF": 6, "PARAM": 1}
    assert read_carmen(tmp_path / "a.log", strict=True).length == 6  # nothing of it is a repair
    with pytest.raises(LogFormatError, match=r":4: LASER_READING of 181 beams has 187 words"):
        read(tmp_path, "".join(lines).replace(" 0.000000\nODOM", " 0 0\nODOM", 1))


def test_the_filters_log_of_csail_has_the_scans_of_the_corrected_one(data_folder):
    folder = data_folder("mit_csail")
    own, corrected = (open_log(folder / f"csail-{name}.log.xz") for name in ("gfs", "corrected"))
    for a, b in zip(own, corrected, strict=True):
        np.testing.assert_array_equal(a.scan.ranges, b.scan.ranges)

# SPDX-License-Identifier: Apache-2.0
"""MRPT rawlogs: every version of their layouts, what MRPT's own programs write, and damage."""

import gzip
import math
import shutil
import struct
import subprocess
from itertools import pairwise

import numpy as np
import pytest

import tests.slam.logs.mrpt_objects as mrpt
from slam import LaserSpec, se2
from slam.errors import LogFormatError
from slam.guests import mrpt as written
from slam.logs import open_log, rawlog, read_rawlog

START, MS = 1_400_000_000_000_000_000, 1_000_000
RANGES = [1.0, 2.0, 3.0, 4.0, 30.0]


def put(path, *objects):
    path.write_bytes(b"".join(objects))
    return path


def drive(version=7, scans=4, **options):
    """Odometry at 20 Hz ahead at 1 m/s, a scan between each two."""
    out = []
    for k in range(scans + 1):
        out.append(mrpt.odometry(START + 50 * MS * k, (0.05 * k, 0.0, 0.0)))
        if k < scans:
            stamp_ns = START + (50 * k + 25) * MS
            out.append(mrpt.scan(stamp_ns, RANGES, version=version, **options))
    return out


@pytest.mark.parametrize("version", range(3, 8))
def test_observations_of_every_version_that_has_times(tmp_path, version):
    frames = list(open_log(put(tmp_path / "a.rawlog", *drive(version))))
    assert [f.stamp_ns for f in frames] == [START + (50 * k + 25) * MS for k in range(4)]
    wanted = [[0.05 * k + 0.025, 0.0, 0.0] for k in range(4)]
    np.testing.assert_allclose([f.odometry.T_odom_robot for f in frames], wanted, atol=1e-9)
    spec = frames[0].scan.spec
    np.testing.assert_allclose(spec.T_robot_laser, [0.2, 0.0, 0.0], atol=1e-7)
    np.testing.assert_allclose(spec.angles, np.linspace(-1.0, 1.0, 5), atol=1e-6)
    np.testing.assert_array_equal(frames[0].scan.ranges, np.float32([1, 2, 3, 4, math.inf]))


@pytest.mark.parametrize("version", [0, 1, 2])
def test_scans_from_before_they_had_times_are_kept_in_order(tmp_path, version):
    steps = [mrpt.movement((0.5, 0.0, 0.0), 0, version=v) for v in (1, 3, 6, 7)]
    scans = [mrpt.frame(mrpt.scan(0, RANGES, version=version), version=1) for _ in steps]
    both = [part for pair in zip(steps, scans, strict=True) for part in pair]
    stream = read_rawlog(put(tmp_path / "a.rawlog", *both))
    frames = list(stream)
    assert stream.metadata.extra["stamps_equal_spread"] == 3
    np.testing.assert_allclose(
        [f.odometry.T_odom_robot[0] for f in frames], [0.5, 1.0, 1.5, 2.0], atol=1e-6
    )
    assert all(b.stamp_ns > a.stamp_ns for a, b in pairwise(frames))


@pytest.mark.parametrize("matched", [False, True])
def test_actions_and_sensory_frames(tmp_path, matched):
    step = np.array([0.1, 0.0, 0.2])
    parts, poses = [], [np.zeros(3)]
    for k in range(5):
        poses.append(se2.compose(poses[-1], step))
        parts.append(mrpt.movement(step, START + 100 * MS * k, matched=matched))
        inside = [mrpt.image(START), mrpt.scan(START + 100 * MS * k, RANGES)]
        parts.append(mrpt.frame(*inside))
    stream = read_rawlog(put(tmp_path / "a.rawlog", *parts))
    got = [f.odometry.T_odom_robot for f in stream]
    np.testing.assert_allclose(got, poses[1:], atol=1e-12)
    assert stream.metadata.extra["ignored"] == {"CObservationImage": 5}


def test_names_without_namespaces_and_objects_without_ends(tmp_path):
    """From before MRPT 0.5.5."""
    pose = mrpt.pose3d((0.1, 0.0, 0.0), 0, old=True)
    scans = [
        mrpt.scan(START + k * MS, RANGES, version=3, mount=pose, name="CObservation2DRangeScan",
                  old=True)
        for k in range(3)
    ]  # fmt: skip
    inside = struct.pack("<I", 3) + b"".join(scans)
    stream = read_rawlog(
        put(tmp_path / "a.rawlog", mrpt.made("CSensoryFrame", 2, inside, old=True))
    )
    assert stream.length == 3
    assert not stream.metadata.odometry


def test_scanners_mounted_anyhow(tmp_path):
    turned = {"counter_clockwise": False, "mount": mrpt.pose3d((0.0, 0.1, math.pi), 2)}
    scan = next(iter(read_rawlog(put(tmp_path / "a.rawlog", *drive(**turned))))).scan
    np.testing.assert_array_equal(scan.ranges, np.float32([math.inf, 4, 3, 2, 1]))
    np.testing.assert_allclose(scan.spec.T_robot_laser, [0.0, 0.1, math.pi], atol=1e-9)
    hanging = {"mount": mrpt.pose3d((0.0, 0.0, 0.0), 2, roll=math.pi)}
    scan = next(iter(read_rawlog(put(tmp_path / "b.rawlog", *drive(**hanging))))).scan
    np.testing.assert_array_equal(scan.ranges, np.float32([math.inf, 4, 3, 2, 1]))
    tilted = mrpt.scan(START, RANGES, label="TILTED", mount=mrpt.pose3d((0, 0, 0), 3, roll=0.5))
    stream = read_rawlog(put(tmp_path / "c.rawlog", tilted, *drive()))
    assert stream.length == 4
    assert stream.metadata.extra["ignored"] == {"CObservation2DRangeScan TILTED": 1}
    moved = mrpt.scan(START + 80 * MS, RANGES, mount=mrpt.pose3d((2.0, 0.0, 0.0)))
    with pytest.raises(LogFormatError, match=r"d.rawlog:10: the scanner moves on the robot"):
        read_rawlog(put(tmp_path / "d.rawlog", *drive(), moved))


def test_invalid_beams_are_error_codes_and_turned_flags_are_noticed(tmp_path):
    flags = [True, False, True, True, False]
    scan = next(iter(read_rawlog(put(tmp_path / "a.rawlog", *drive(valid=flags))))).scan
    np.testing.assert_array_equal(scan.ranges, np.float32([1, math.nan, 3, 4, math.inf]))
    opposite = [False, False, False, False, True]  # of the first carmen2rawlog
    scan = next(iter(read_rawlog(put(tmp_path / "b.rawlog", *drive(valid=opposite))))).scan
    np.testing.assert_array_equal(scan.ranges, np.float32([1, 2, 3, 4, math.inf]))


def test_what_we_write_for_mrpt_reads_back(tmp_path):
    spec = LaserSpec(n_beams=5, angle_min=-1.0, angle_increment=0.5, range_max=30.0,
                     T_robot_laser=[0.1, 0.0, 0.0])  # fmt: skip
    model = written.MotionModel(
        m_per_m=0.1, m_per_rad=0.1, rad_per_m=0.1, rad_per_rad=0.1, least_m=0.01, least_rad=0.01
    )
    parts = []
    for k in range(3):
        parts.append(written.action(START + k * 100 * MS, np.array([0.1, 0.0, 0.1]), model))
        parts.append(written.sensed(START + k * 100 * MS, np.array([1, 2, 3, math.inf, 5]), spec))
    frames = list(open_log(put(tmp_path / "frames.rawlog", *parts)))
    assert [f.stamp_ns for f in frames] == [START + k * 100 * MS for k in range(3)]
    np.testing.assert_allclose(frames[0].odometry.T_odom_robot, [0.1, 0.0, 0.1], atol=1e-9)
    np.testing.assert_array_equal(frames[0].scan.ranges, np.float32([1, 2, 3, math.nan, 5]))
    np.testing.assert_allclose(frames[0].scan.spec.angles, spec.angles, atol=1e-6)


@pytest.mark.skipif(shutil.which("carmen2rawlog") is None, reason="MRPT's programs are not here")
def test_a_log_that_mrpt_converted_has_the_same_poses_and_scans(tmp_path, carmen_text):
    poses = carmen_text.path_poses(6)
    lines = ["PARAM laser_front_laser_resolution 1.0 host 0\n"]
    for k, pose in enumerate(poses):
        lines.append(carmen_text.flaser(k, 0.2 * k, se2.compose(pose, [0.2, 0.0, 0.0]), pose))
    (tmp_path / "a.log").write_text("".join(lines))
    command = ["carmen2rawlog", "-q", "-w", "-i", tmp_path / "a.log", "-o", tmp_path / "a.rawlog"]
    subprocess.run(command, check=True, capture_output=True)
    frames, ours = list(open_log(tmp_path / "a.rawlog")), list(open_log(tmp_path / "a.log"))
    for a, b in zip(frames, ours, strict=True):
        np.testing.assert_allclose(a.odometry.T_odom_robot, b.odometry.T_odom_robot, atol=1e-6)
        np.testing.assert_allclose(a.scan.ranges, b.scan.ranges, atol=1e-6)
    np.testing.assert_allclose(frames[0].scan.spec.T_robot_laser, [0.2, 0, 0], atol=1e-5)


def test_packed_torn_and_bounded(tmp_path, monkeypatch, caplog):
    whole = b"".join(drive())
    path = tmp_path / "a.mrpt.gz"
    path.write_bytes(gzip.compress(whole))
    assert open_log(path).length == 4
    (tmp_path / "by content").write_bytes(gzip.compress(whole))
    assert open_log(tmp_path / "by content").length == 4
    assert not caplog.records

    cut = put(tmp_path / "cut.rawlog", whole[:-300])
    stream = read_rawlog(cut)
    assert stream.length == 3
    assert stream.metadata.extra["torn_last_line"] == 1
    assert len(caplog.records) == 1
    with pytest.raises(LogFormatError, match=r"cut.rawlog:\d+: object .* \(refused by --strict"):
        read_rawlog(cut, strict=True)
    path.write_bytes(gzip.compress(whole)[:-30])
    assert read_rawlog(path).length in (2, 3, 4)

    monkeypatch.setattr(rawlog, "MAX_RAWLOG_BYTES", 1000)
    path.write_bytes(gzip.compress(whole + bytes(1 << 22)))
    with pytest.raises(LogFormatError, match="unpacks to more than 1000 bytes"):
        read_rawlog(path)


def test_what_is_no_rawlog_or_holds_no_scan_is_named(tmp_path):
    for name, data, match in (
        ("empty", b"", "is empty"),
        ("noise", bytes(range(256)), r"noise.rawlog:1: "),
        ("newer", mrpt.made("mrpt::obs::CObservation2DRangeScan", 9, b""), "version 9; 0 to 7"),
        ("other", mrpt.image(START), "no planar scan found.*CObservationImage"),
        ("many", mrpt.scan(START, RANGES).replace(struct.pack("<I", 5), b"\xff" * 4, 1), "beams"),
    ):
        (tmp_path / f"{name}.rawlog").write_bytes(data)
        with pytest.raises(LogFormatError, match=match):
            open_log(tmp_path / f"{name}.rawlog")
    with pytest.raises(LogFormatError, match="no such file"):
        open_log(tmp_path / "missing.rawlog")

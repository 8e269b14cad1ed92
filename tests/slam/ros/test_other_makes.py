# SPDX-License-Identifier: Apache-2.0
"""Nodes of other makes: Fast DDS in C++ with types of its own generator, zenoh-ros2-sdk."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from slam import se2
from slam.ros import slam as ros2
from slam.ros.child import ROUTER, Domain
from slam.ros.link import Topic, open_link
from slam.ros.robot import Robot
from slam.system import create
from tests.slam.ros.frames import SPEC, driven
from tests.slam.ros.idl import idl_of

HERE = Path(__file__).parent
KINDS = ("sensor_msgs/msg/LaserScan", "geometry_msgs/msg/Twist", "tf2_msgs/msg/TFMessage")
CMD_VEL = Topic(name="/cmd_vel", kind="geometry_msgs/msg/Twist", depth=1000)
SCANS = 1000
EPOCH_S = 1_700_000_000
pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def node(tmp_path_factory) -> Path:
    """The C++ node, built."""
    pytest.importorskip("cyclonedds", reason="needs the extra ros2")
    if not shutil.which("fastddsgen") or not shutil.which("g++"):
        pytest.skip("needs fastddsgen, libfastrtps-dev and g++ (Debian has them)")
    folder = tmp_path_factory.mktemp("node")
    (folder / "ros.idl").write_text(idl_of(KINDS))
    words = ["g++", "-std=c++17", "-O0", "-w", "-I.", str(HERE / "node.cpp"), "ros.cxx"]
    libraries = ["rosPubSubTypes.cxx", "-lfastrtps", "-lfastcdr", "-o", "node"]
    for command in (["fastddsgen", "-replace", "ros.idl"], [*words, *libraries]):
        subprocess.run(command, cwd=folder, check=True, capture_output=True, timeout=300)
    return folder / "node"


def read(path: Path) -> list[tuple[int, np.ndarray, np.ndarray, np.ndarray, bytes]]:
    """What the node wrote of each scan: stamp, its seven numbers, ranges, intensities, frame."""
    data, at, found = path.read_bytes(), 8, []
    while at < len(data):
        sec, nanosec, n, m = np.frombuffer(data, "<u4", 4, at).tolist()
        numbers, at = np.frombuffer(data, "<f4", 7, at + 16), at + 44
        ranges, more = np.frombuffer(data, "<f4", n, at), np.frombuffer(data, "<f4", m, at + 4 * n)
        end = data.index(b"\n", at + 4 * (n + m))
        stamp_ns = (sec - EPOCH_S) * 10**9 + nanosec
        found.append((stamp_ns, numbers, ranges, more, data[at + 4 * (n + m) : end]))
        at = end + 9
    return found


def test_fast_dds_gets_every_field_of_every_scan_and_drives(node, tmp_path):
    domain = Domain("dds", own=True, wait_s=10.0)
    link = open_link("dds", domain=domain.number)
    link.subscribe(CMD_VEL)
    robot, out = Robot(link), tmp_path / "scans"
    child = subprocess.Popen([node, out, str(SCANS)], env={**os.environ, **domain.environment()})
    while not link.listeners(robot.topics["/scan"]):
        assert child.poll() is None
        time.sleep(0.02)
    time.sleep(1.0)
    frames, twists = driven(SCANS), 0
    for frame in frames:
        robot.send(frame)
        time.sleep(1.0 / 37.5)
        twists += len(link.take(CMD_VEL))
    assert child.wait(30.0) == 0
    time.sleep(0.5)
    twists += len(link.take(CMD_VEL))
    link.close()
    domain.free()
    got = read(out)
    assert len(got) == SCANS
    assert twists == SCANS
    end = SPEC.angle_min + 360 * SPEC.angle_increment
    numbers = np.array([SPEC.angle_min, end, SPEC.angle_increment, 0.0, 0.0, 0.0, 80.0], "f4")
    for frame, (stamp_ns, said, ranges, intensities, frame_id) in zip(frames, got, strict=True):
        assert stamp_ns == frame.stamp_ns
        np.testing.assert_array_equal(said, numbers)
        np.testing.assert_array_equal(ranges, frame.scan.ranges)
        assert len(intensities) == 0
        assert frame_id == b"laser"


def dead_reckoned(name: str, n: int) -> None:
    """The SLAM of that name says what odometry says of each of n frames."""
    slam, frames = create(name), driven(n)
    answered = 0
    for frame in frames:
        estimate = slam.update(frame)
        answered += estimate.diagnostics["answered"]
        wanted = se2.between(frames[0].odometry.T_odom_robot, frame.odometry.T_odom_robot)
        np.testing.assert_allclose(estimate.T_map_robot, wanted, atol=1e-12)
    slam.close()
    assert answered == n


def test_fast_dds_is_a_slam(node, monkeypatch):
    monkeypatch.setattr(ros2, "ANSWER_S", 20.0)  # a busy machine
    dead_reckoned(f"ros2:{node}", 100)


def test_another_make_of_zenoh_is_a_slam(monkeypatch):
    pytest.importorskip("zenoh_ros2_sdk", reason="needs zenoh-ros2-sdk")
    monkeypatch.setattr(ros2, "ANSWER_S", 20.0)
    monkeypatch.setattr("slam.ros.child.Domain.router", ROUTER + 501)
    dead_reckoned(f"ros2-zenoh:{sys.executable} {HERE / 'zenoh_client.py'} {ROUTER + 501}", 100)

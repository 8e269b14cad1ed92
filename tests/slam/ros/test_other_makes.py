# SPDX-License-Identifier: Apache-2.0
"""Nodes of other makes: Fast DDS in C++ with types of its own generator, zenoh-ros2-sdk."""

import shlex
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from slam import se2
from slam.ros import slam as ros2
from slam.ros.link import Topic
from slam.ros.node import TF, Node
from slam.ros.robot import Robot
from slam.ros.template import said_ns
from slam.system import create
from tests.slam.ros.clients import ANYWHERE, PREFIXES, met, on, started
from tests.slam.ros.frames import SPEC, driven

CMD_VEL = Topic(name="/cmd_vel", kind="geometry_msgs/msg/Twist", depth=1000)
ANSWERS = replace(TF, depth=1000)
SCANS = 200
EPOCH_S = 1_700_000_000
pytestmark = pytest.mark.slow


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


def test_one_gets_every_field_and_drives_while_another_is_scored(client, tmp_path):
    middleware, words = client
    with on(middleware) as (domain, link):
        link.subscribe(CMD_VEL)
        link.subscribe(ANSWERS)
        robot, slam, out = Robot(link), Node(link), tmp_path / "scans"
        with (
            started([*words, out, SCANS], domain, **ANYWHERE) as drives,
            started(words, domain),
        ):
            met(link, robot, 2 if middleware == "dds" else 1)  # Zenoh does not count them
            frames, twists, answers, poses = driven(SCANS), 0, 0, []
            for frame in frames:
                slam.sent(frame.odometry, said_ns(frame.stamp_ns))
                robot.send(frame)
                time.sleep(1.0 / 37.5)
                slam.answered()
                poses.append(slam.estimate().T_map_robot)
                twists, answers = (
                    twists + len(link.take(CMD_VEL)),
                    answers + len(link.take(ANSWERS)),
                )
            assert drives.wait(30.0) == 0
            time.sleep(0.5)
            twists, answers = twists + len(link.take(CMD_VEL)), answers + len(link.take(ANSWERS))
    got = read(out)
    assert (len(got), twists, answers) == (SCANS, SCANS, SCANS)
    wanted = [se2.between(frames[0].odometry.T_odom_robot, f.odometry.T_odom_robot) for f in frames]
    np.testing.assert_allclose(poses, wanted, atol=1e-12)
    end = SPEC.angle_min + 360 * SPEC.angle_increment
    numbers = np.array([SPEC.angle_min, end, SPEC.angle_increment, 0.0, 0.0, 0.0, 80.0], "f4")
    for frame, (stamp_ns, said, ranges, intensities, frame_id) in zip(frames, got, strict=True):
        assert stamp_ns == frame.stamp_ns
        np.testing.assert_array_equal(said, numbers)
        np.testing.assert_array_equal(ranges, frame.scan.ranges)
        assert len(intensities) == 0
        assert frame_id == b"laser"


def test_another_make_is_a_slam(client, monkeypatch):
    middleware, words = client
    monkeypatch.setattr(ros2, "ANSWER_S", 20.0)  # a busy machine
    slam, frames = create(f"{PREFIXES[middleware]}:{shlex.join(map(str, words))}"), driven(100)
    answered = 0
    for frame in frames:
        estimate = slam.update(frame)
        answered += estimate.diagnostics["answered"]
        wanted = se2.between(frames[0].odometry.T_odom_robot, frame.odometry.T_odom_robot)
        np.testing.assert_allclose(estimate.T_map_robot, wanted, atol=1e-12)
    slam.close()
    assert answered == 100

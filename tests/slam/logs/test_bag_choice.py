# SPDX-License-Identifier: Apache-2.0
"""Which scanner and which odometry of a bag are read, and where they stand on the robot."""

import logging
import math

import numpy as np
import pytest

import tests.slam.logs.foreign_bags as bags
from slam import se2
from slam.errors import LogFormatError
from slam.logs import read_bag

MS = 1_000_000
START = bags.START_NS
RANGES = [1.0, 2.0, 3.0, 2.5, 1.5]
TWIST = np.array([1.0, 0.0, 0.5])
ZERO = (0.0, 0.0, 0.0)
MOUNT = (0.2, -0.1, math.pi / 6.0)  # between quarter turns


def at(k, backwards=False):
    """Where the robot is at message k, 100 ms each."""
    pose = se2.exp(TWIST, 0.1 * k)
    return se2.inverse(pose) if backwards else pose


def write(path, make, driven, n=6, first=()):
    """A bag of what ``driven(k, ns)`` says each 100 ms, and of scans between."""
    out = list(first)
    for k in range(n):
        out += driven(k, START + k * 100 * MS)
    kind = bags.write_ros1 if make.ros1 else bags.write_ros2
    return kind(path, out)


def scan_of(make, ns, frame="laser", topic="/scan", ranges=RANGES):
    return make.scan(ns + 50 * MS, ranges, header=make.header(ns + 50 * MS, frame), topic=topic)


def check(stream, n=5, mount=MOUNT):
    """Odometry lies on the arc between the messages, at each scan."""
    frames = list(stream)
    assert len(frames) == n
    for k, frame in enumerate(frames):
        wanted = se2.exp(TWIST, 0.1 * k + 0.05)
        np.testing.assert_allclose(frame.odometry.T_odom_robot, wanted, atol=1e-9)
    np.testing.assert_allclose(stream.metadata.laser.T_robot_laser, mount, atol=1e-9)
    return stream


def edges(*rows):
    """Messages of /tf: parent, child, pose or "drive", "back" for one that moves."""

    def said(make, k, ns):
        poses = {"drive": at(k), "back": at(k, backwards=True)}
        return [make.moved(ns, a, b, poses.get(p, p) if isinstance(p, str) else p)
                for a, b, p in rows]  # fmt: skip

    return said


TREES = {
    "plain": (edges(("odom", "base_link", "drive"), ("base_link", "laser", MOUNT)), "base_link"),
    "upside down": (
        edges(("base_link", "odom", "back"), ("base_link", "laser", MOUNT)), "base_link"
    ),
    "a chain": (
        edges(("map", "odom_combined", (3.0, 4.0, 1.0)),
              ("odom_combined", "base_footprint", "drive"),
              ("base_footprint", "base_link", ZERO), ("base_link", "laser", MOUNT)),
        "base_footprint",
    ),
    "two parts": (
        edges(("odom", "wheels", (1.0, 0.0, 0.0)), ("wheels", "base_link", "drive"),
              ("base_link", "laser", MOUNT)),
        "base_link",
    ),
    "of a namespace": (
        edges(("r1/odom", "r1/base_link", "drive"), ("r1/base_link", "r1/laser", MOUNT),
              ("r0/odom", "r0/base_link", (9.0, 9.0, 0.0)), ("map", "r0/odom", ZERO),
              ("map", "r1/odom", ZERO)),
        "r1/base_link",
    ),
}  # fmt: skip


@pytest.mark.parametrize("ros1", [False, True])
@pytest.mark.parametrize("name", TREES)
def test_odometry_on_tf_alone_is_followed(tmp_path, name, ros1):
    make = bags.Maker(ros1=ros1)
    said, robot = TREES[name]
    frame = "r1/laser" if name == "of a namespace" else "laser"
    path = write(
        tmp_path / "a.bag", make, lambda k, ns: [*said(make, k, ns), scan_of(make, ns, frame)]
    )
    stream = read_bag(path)
    if name == "two parts":
        x = [frame.odometry.T_odom_robot[0] - 1.0 for frame in stream]
        np.testing.assert_allclose(
            x, [se2.exp(TWIST, 0.1 * k + 0.05)[0] for k in range(5)], atol=1e-9
        )
    else:
        check(stream)
    assert stream.metadata.extra["odometry"].endswith(f" -> {robot} of /tf")


def test_a_frame_of_another_name_is_read_when_it_is_asked_for(tmp_path):
    make = bags.Maker()
    said = edges(("world", "base_link", "drive"), ("base_link", "laser", MOUNT))
    path = write(tmp_path / "a", make, lambda k, ns: [*said(make, k, ns), scan_of(make, ns)])
    with pytest.raises(LogFormatError, match="if it is another one: --odometry /tf:world"):
        read_bag(path, strict=True)
    check(read_bag(path, odometry="/tf:world"))
    with pytest.raises(LogFormatError, match=r"no odometry on /tf:moon; frames are: base_link, la"):
        read_bag(path, odometry="/tf:moon")


@pytest.mark.parametrize("base", ["base_link", "base_footprint"])
def test_odometry_that_does_not_say_what_moves_is_of_the_base(tmp_path, base):
    make = bags.Maker()
    path = write(
        tmp_path / "a", make,
        lambda k, ns: [make.odometry(ns, at(k), child=""), scan_of(make, ns)],
        first=[make.moved(START, base, "laser", MOUNT, "/tf_static")],
    )  # fmt: skip
    assert check(read_bag(path)).metadata.mounting == f"{base} -> laser of /tf_static"


def test_a_base_below_its_odometry_s_is_reached_upwards(tmp_path):
    make = bags.Maker()
    links = [("base_footprint", "base_link", (0.5, 0.0, 0.0)), ("base_footprint", "laser", MOUNT)]
    path = write(
        tmp_path / "a", make, lambda k, ns: [make.odometry(ns, at(k)), scan_of(make, ns)],
        first=[make.moved(START, *link, "/tf_static") for link in links],
    )  # fmt: skip
    check(read_bag(path), mount=(MOUNT[0] - 0.5, *MOUNT[1:]))


def of_two(make, k, ns, names=("a", "b"), frames=("a/", "b/")):
    """Two robots, of which the second has more messages."""
    out = []
    for robot, of, mine in zip(names, frames, (True, False), strict=True):
        pose = at(k) if mine else np.array([-0.3 * k, 0.0, 0.2])
        out.append(make.odometry(ns, pose, topic=f"/{robot}/odom", child=f"{of}base_link"))
        out.append(make.moved(ns, f"{of}base_link", f"{of}laser", MOUNT if mine else ZERO,
                              "/tf" if of else f"/{robot}/tf"))  # fmt: skip
        if mine or k % 2:
            out.append(scan_of(make, ns, f"{of}laser", f"/{robot}/scan"))
    out.append(make.odometry(ns + MS, (-0.3 * k, 0.0, 0.2), topic=f"/{names[1]}/odom",
                             child=f"{frames[1]}base_link"))  # fmt: skip
    return out


@pytest.mark.parametrize("frames", [("a/", "b/"), ("", "")])
def test_of_two_robots_scans_and_odometry_of_one_are_read(tmp_path, frames):
    make = bags.Maker()
    path = write(tmp_path / "a", make, lambda k, ns: of_two(make, k, ns, frames=frames))
    stream = check(read_bag(path))
    assert stream.metadata.extra["passed_over"] == ["/b/scan", "/b/odom"]
    other = read_bag(path, odometry="/b/odom")
    assert other.metadata.extra["scan"] == "/b/scan"
    assert other.metadata.laser.T_robot_laser.tolist() == [0.0, 0.0, 0.0]


def test_odometry_that_can_only_be_another_robot_s_is_none(tmp_path):
    make = bags.Maker()
    path = write(
        tmp_path / "a", make,
        lambda k, ns: [make.odometry(ns, at(k), topic="/odom", child="b/base_link"),
                       scan_of(make, ns, "a/laser")],
    )  # fmt: skip
    with pytest.raises(LogFormatError, match="of the scanner's own robot: /odom are of others"):
        read_bag(path, strict=True)


def test_two_scanners_on_one_topic_have_each_its_place(tmp_path, caplog):
    make = bags.Maker()
    back = (-0.3, 0.0, math.pi)
    path = write(
        tmp_path / "a", make,
        lambda k, ns: [
            make.odometry(ns, at(k)), scan_of(make, ns, "front"),
            scan_of(make, ns + MS, "rear" if k < 4 else "top", ranges=[4.0] * 3),
        ],
        first=[make.moved(START, "base_link", name, mount, "/tf_static")
               for name, mount in (("front", MOUNT), ("rear", back))],
    )  # fmt: skip
    with caplog.at_level(logging.WARNING):
        stream = check(read_bag(path))
    assert stream.metadata.extra["scan"] == "/scan:front"
    assert "/scan:rear" in stream.metadata.extra["passed_over"]
    rear = read_bag(path, scan="/scan:rear")
    np.testing.assert_allclose(rear.metadata.laser.T_robot_laser, back)
    assert [frame.scan.spec.n_beams for frame in rear] == [3] * 4
    with pytest.raises(LogFormatError, match=r"no scan on /scan of frame side; there are: front, "):
        read_bag(path, scan="/scan:side")


def test_a_scanner_that_comes_later_is_told(tmp_path):
    make = bags.Maker()
    path = write(
        tmp_path / "a", make,
        lambda k, ns: [make.odometry(ns, at(k)), scan_of(make, ns, "front" if k < 15 else "rear")],
        n=20, first=[make.moved(START, "base_link", "front", MOUNT, "/tf_static")],
    )  # fmt: skip
    check(read_bag(path), n=15)
    with pytest.raises(LogFormatError, match=r"5 scans of another frame than front \(refused"):
        read_bag(path, strict=True)


def test_two_robots_on_one_topic_of_odometry_are_told_apart(tmp_path):
    make = bags.Maker()
    path = write(
        tmp_path / "a", make,
        lambda k, ns: [make.odometry(ns + 1, (k, 0.0, 0.0), child="b/base"),
                       make.odometry(ns, at(k), child="a/base"), scan_of(make, ns, "a/laser")],
        first=[make.moved(START, "a/base", "a/laser", MOUNT, "/tf_static")],
    )  # fmt: skip
    stream = check(read_bag(path))
    assert stream.metadata.extra["odometry"] == "/odom:a/base"
    assert stream.metadata.extra["passed_over"] == ["/odom:b/base"]

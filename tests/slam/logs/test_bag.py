# SPDX-License-Identifier: Apache-2.0
"""Anybody's bag: topics at their own rates, scanners mounted anyhow, and every kind of damage."""

import math
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import tests.slam.logs.foreign_bags as bags
from slam import create, se2
from slam.errors import LogFormatError
from slam.frames import Frame
from slam.logs import open_log, read_bag
from slam.logs.bag_laser import Stamped, increment_covariance
from slam.logs.bag_tf import mounting

START, MS = bags.START_NS, 1_000_000
RANGES = [1.0, 2.0, 3.0, 4.0, 5.0]
FLAT = (0.0, 0.0, 0.0, 1.0)


def drive(make: Any, scans: int = 5, **scan: Any) -> list[Any]:
    """Scans at 10 Hz between odometry at 50 Hz: 1 m/s ahead while turning 0.5 rad/s."""
    out = [make.transform(START, "base_link", "laser", (0.2, 0.0, 0.3), FLAT)]
    for k in range(5 * scans + 2):
        pose = se2.exp(np.array([1.0, 0.0, 0.5]), 0.02 * k)
        out.append(make.odometry(START + 20 * MS * k, pose))
        if k % 5 == 0 and k < 5 * scans:
            out.append(make.scan(START + 20 * MS * k + 7 * MS, **{"ranges": RANGES, **scan}))
    return out


def read(path: Path, **options: Any) -> list[Frame]:
    return list(read_bag(path, **options))


@pytest.mark.parametrize("kind", ["sqlite3", "mcap", "ros1"])
def test_odometry_is_interpolated_to_each_scan_in_every_format(tmp_path, kind):
    make = bags.Maker(ros1=kind == "ros1")
    if kind == "ros1":
        path = bags.write_ros1(tmp_path / "a.bag", drive(make))
    else:
        path = bags.write_ros2(tmp_path / "a", drive(make), kind)
    stream = open_log(path)
    frames = list(stream)
    assert len(frames) == 5 == stream.length
    for k, frame in enumerate(frames):
        assert frame.stamp_ns == START + 100 * MS * k + 7 * MS
        wanted = se2.exp(np.array([1.0, 0.0, 0.5]), 0.1 * k + 0.007)
        np.testing.assert_allclose(frame.odometry.T_odom_robot, wanted, atol=1e-9)
        assert frame.odometry.increment_covariance is None
        assert frame.scan.ranges.tolist() == RANGES
    assert stream.metadata.laser.T_robot_laser.tolist() == [0.2, 0.0, 0.0]
    assert stream.metadata.source == ("rosbag1" if kind == "ros1" else "rosbag2")
    slam = create("shunting")
    assert all(np.isfinite(slam.update(frame).T_map_robot).all() for frame in frames)


def test_beams_of_a_clockwise_scanner_are_turned_round(tmp_path):
    make = bags.Maker()
    changes = {"angle_min": 1.0, "angle_max": -1.0, "angle_increment": -0.5}
    path = bags.write_ros2(tmp_path / "a", drive(make, time_increment=0.001, **changes))
    scan = read(path)[0].scan
    assert scan.ranges.tolist() == RANGES[::-1]
    np.testing.assert_allclose(scan.spec.angles, np.linspace(-1.0, 1.0, 5), atol=1e-6)
    np.testing.assert_allclose(scan.spec.beam_time_offsets, [0.004, 0.003, 0.002, 0.001, 0.0])


def test_a_scanner_that_hangs_upside_down_sees_left_as_right(tmp_path):
    make = bags.Maker()
    messages = drive(make, intensities=np.arange(5, dtype=np.float32))
    messages[0] = make.transform(START, "base_link", "plate", (0.1, 0.0, 0.5), FLAT)
    hanging = make.transform(START, "plate", "laser", (0.1, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0))
    path = bags.write_ros2(tmp_path / "a", [hanging, *messages])
    frame = read(path)[0]
    np.testing.assert_allclose(frame.scan.spec.T_robot_laser, [0.2, 0.0, 0.0], atol=1e-12)
    assert frame.scan.ranges.tolist() == RANGES[::-1]
    assert frame.scan.intensities.tolist() == [4.0, 3.0, 2.0, 1.0, 0.0]


def test_negative_ranges_become_error_codes(tmp_path):
    changes = {"ranges": np.array([-math.inf, -1.0, 1.0, math.inf, math.nan], dtype=np.float32)}
    frame = read(bags.write_ros2(tmp_path / "a", drive(bags.Maker(), **changes)))[0]
    np.testing.assert_array_equal(
        frame.scan.ranges, np.float32([math.nan, math.nan, 1.0, math.inf, math.nan])
    )


def test_topics_are_guessed_and_can_be_named(tmp_path):
    make = bags.Maker()
    messages = drive(make)
    messages += [make.scan(START + 7 * MS, [9.0] * 5, topic="/rear/scan")]
    messages += [make.odometry(START + k * 500 * MS, (k, 0, 0), topic="/wheel") for k in range(3)]
    messages += [
        make.odometry(START + k * 500 * MS, (k, 5, 0), topic="/base_pose_ground_truth")
        for k in range(3)
    ]
    path = bags.write_ros2(tmp_path / "a", sorted(messages, key=lambda m: m[2]))
    guessed = read_bag(path)
    assert guessed.metadata.extra["scan"] == "/scan"
    assert guessed.metadata.extra["odometry"] == "/odom"
    assert guessed.metadata.truth == "/base_pose_ground_truth"
    np.testing.assert_allclose(next(iter(guessed)).truth, [0.014, 5.0, 0.0], atol=1e-9)
    named = read(path, scan="/rear/scan", odometry="/wheel")
    assert [frame.scan.ranges[0] for frame in named] == [9.0]
    np.testing.assert_allclose(named[0].odometry.T_odom_robot, [0.014, 0.0, 0.0], atol=1e-9)
    with pytest.raises(LogFormatError, match=r"/odom is nav_msgs/msg/Odometry, expected sensor"):
        read_bag(path, scan="/odom")
    with pytest.raises(LogFormatError, match=r"no topic /front; there are: .*/rear/scan"):
        read_bag(path, scan="/front")


def test_a_bag_without_scans_or_the_odometry_asked_for_says_what_it_has(tmp_path):
    make = bags.Maker()
    only = [make.odometry(START, (0, 0, 0))]
    with pytest.raises(LogFormatError, match=r"no message of type sensor_msgs.*topics: /odom"):
        read_bag(bags.write_ros2(tmp_path / "a", only))
    bag = bags.write_ros2(tmp_path / "b", [make.scan(START, RANGES)])
    with pytest.raises(LogFormatError, match=r"no topic /odom; there are: /scan"):
        read_bag(bag, odometry="/odom")
    with pytest.raises(LogFormatError, match=r"no message of nav_msgs.*--strict"):
        open_log(bag, strict=True)
    with pytest.raises(LogFormatError, match="no message of type"):
        read_bag(bags.write_ros2(tmp_path / "c", []))
    apart = [make.scan(START, RANGES), make.odometry(START + 5000 * MS, (0, 0, 0))]
    with pytest.raises(LogFormatError, match="no scan lies within"):
        read(bags.write_ros2(tmp_path / "d", apart))


def test_accumulated_covariances_give_back_those_of_the_increments():
    rng = np.random.default_rng(4)
    pose, P = np.array([1.0, -2.0, 0.4]), np.diag([0.1, 0.2, 0.05])
    for _ in range(5):
        root = 0.01 * rng.normal(size=(3, 3))
        step, Q = rng.normal(size=3) * 0.1, root @ root.T
        after, P_after = se2.compose(pose, step), se2.propagate(P, pose, step, Q)
        found = increment_covariance(Stamped(0, pose, None, P), Stamped(1, after, None, P_after))
        np.testing.assert_allclose(found, Q, atol=1e-14)
        pose, P = after, P_after


def test_a_covariance_that_does_not_accumulate_says_nothing():
    P = np.diag([0.1, 0.1, 0.1])
    here, there = np.zeros(3), np.array([1.0, 0.0, 0.0])
    assert increment_covariance(Stamped(0, here, None, P), Stamped(1, there, None, P)) is None
    assert increment_covariance(None, Stamped(1, there, None, P)) is None
    shrunk = increment_covariance(Stamped(0, here, None, P), Stamped(1, there, None, 0.5 * P))
    assert np.diagonal(shrunk).min() >= 0.0  # a filter's, not an odometry's: still a covariance
    odd = 0.01 * np.array([[1.0, 0.9, 0.9], [0.9, 1.0, -0.9], [0.9, -0.9, 1.0]])
    mended = increment_covariance(Stamped(0, here, None, P), Stamped(1, here, None, P + odd))
    assert np.linalg.eigvalsh(mended).min() >= 0.0
    np.testing.assert_allclose(np.diagonal(mended), 0.01)


@pytest.mark.parametrize("scans_first", [True, False])
@pytest.mark.parametrize("a_message", [1, 30_000])
def test_a_chain_of_many_transforms_is_refused_by_their_number(tmp_path, a_message, scans_first):
    make, links = bags.Maker(), []
    for k in range(30_000):
        topic, kind, ns, message = make.transform(
            START, f"f{k}", f"f{k + 1}", (0.0, 0.0, 0.0), FLAT
        )
        links.append((topic, kind, ns, message))
        if a_message > 1:
            links[0][3].transforms.append(message.transforms[0])
    del links[30_000 // a_message :]
    driven = drive(make)[1:]
    path = bags.write_ros2(tmp_path / "a", driven + links if scans_first else links + driven)
    with pytest.raises(LogFormatError, match=r"more than 2000 transforms between frames"):
        read_bag(path)


@pytest.mark.parametrize("n", [1, 2, 300, 1999])
def test_a_chain_of_transforms_is_walked_from_the_robot_to_the_laser(n):
    make, rng = bags.Maker(), np.random.default_rng(n)
    links, wanted = {}, np.zeros(3)
    for k in rng.permutation(n).tolist():
        moved = (1e-3 * float(k), 0.5, 0.0)
        message = make.transform(START, f"f{k}", f"f{k + 1}", moved, FLAT)[3]
        links[f"f{k}", f"f{k + 1}"] = message.transforms[0].transform
        wanted[:2] += moved[:2]
    links["f0", "elsewhere"] = links["f0", "f1"]
    T_robot_laser, hangs = mounting(links, "f0", f"f{n}")
    np.testing.assert_allclose(T_robot_laser, wanted, atol=1e-9)
    assert not hangs
    T_laser_robot, _ = mounting(links, f"f{n}", "f0")
    np.testing.assert_allclose(T_laser_robot, -wanted, atol=1e-9)
    assert mounting(links, "f0", "f0") is None


@pytest.mark.parametrize("kind", ["sqlite3", "mcap", "ros1"])
def test_truncated_anywhere_is_one_clear_error_or_a_shorter_log(tmp_path, kind):
    make = bags.Maker(ros1=kind == "ros1")
    if kind == "ros1":
        file = bags.write_ros1(tmp_path / "a.bag", drive(make, 20))
    else:
        (file,) = (
            p
            for p in bags.write_ros2(tmp_path / "a", drive(make, 20), kind).iterdir()
            if p.suffix != ".yaml"
        )
    data, before = file.read_bytes(), -1
    for part in (0.0, 0.001, 0.1, 0.5, 0.9, 0.99):
        damaged = tmp_path / f"cut{file.suffix}"
        damaged.write_bytes(data[: int(part * len(data))])
        found = {}
        for strict in (True, False):
            found[strict] = 0
            with suppress(LogFormatError):
                found[strict] = len(read(damaged, strict=strict))
        assert found[True] in (0, 20)  # of SQLite, the last pages are an index
        assert before <= found[False] <= 20
        before = found[False]
    assert before > 5

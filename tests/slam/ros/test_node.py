# SPDX-License-Identifier: Apache-2.0
"""What an outside node says, and what is made of it: timely, late, silent, wrong, twice."""

import sys
from pathlib import Path

import numpy as np
import pytest

from slam import se2
from slam.errors import InvalidValueError, LogFormatError, MissingDependencyError, SlamFailedError
from slam.estimate import Raster
from slam.frames import NS_PER_S
from slam.ros import slam as ros2
from slam.ros.link import Taken, Topic, open_link
from slam.ros.messages import (
    MAP,
    ODOM,
    ClockMessage,
    MapMessage,
    PoseMessage,
    TransformMessage,
)
from slam.ros.node import GRID, POSES, TF, Node, StampedPose, decoded
from slam.ros.recorded import RecordedSlam, aligned
from slam.ros.robot import Robot
from slam.ros.slam import Domain
from slam.ros.template import said_ns
from slam.system import create
from tests.slam.ros.frames import InMemory, driven

SAID = np.array([0.5, -0.25, 0.1])  # map -> odom


def transform(stamp_ns: int, pose=SAID, sender: str = "a") -> Taken:
    return Taken(bytes(TransformMessage((MAP, ODOM, 0.0))(stamp_ns, np.asarray(pose))), sender)


@pytest.fixture
def node() -> tuple[Node, InMemory]:
    link = InMemory()
    return Node(link), link


FIRST, SECOND = driven(2)


def test_the_frame_of_the_first_pose_is_ours_whatever_the_nodes_map_is(node):
    node, link = node
    node.sent(FIRST.odometry, said_ns(FIRST.stamp_ns))
    assert not node.answered()
    link.come[TF.name] = [transform(FIRST.stamp_ns)]
    assert node.answered()
    assert node.estimate().T_map_robot == pytest.approx(np.zeros(3), abs=1e-15)
    node.sent(SECOND.odometry, said_ns(SECOND.stamp_ns))
    link.come[TF.name] = [transform(SECOND.stamp_ns, SAID + np.array([0.1, 0.0, 0.0]))]
    assert node.answered()
    moved = se2.between(FIRST.odometry.T_odom_robot, SECOND.odometry.T_odom_robot)
    shifted = node.estimate().T_map_robot - moved
    assert np.hypot(*shifted[:2]) == pytest.approx(0.1)


def test_a_late_transform_is_no_answer_and_still_stands(node):
    node, link = node
    node.sent(FIRST.odometry, said_ns(FIRST.stamp_ns))
    node.sent(SECOND.odometry, said_ns(SECOND.stamp_ns))
    link.come[TF.name] = [transform(FIRST.stamp_ns)]
    assert not node.answered()
    assert node.T_own_odom is not None


def test_a_clock_an_hour_off_is_named(node):
    node, link = node
    node.sent(FIRST.odometry, said_ns(FIRST.stamp_ns))
    link.come[TF.name] = [transform(FIRST.stamp_ns + 3600 * NS_PER_S)]
    assert not node.answered()
    assert node.T_own_odom is None
    assert "3600 s ahead: run it with use_sim_time:=true" in node.why_silent()


def test_malformed_samples_and_a_second_publisher_are_counted_and_left_out(node, caplog):
    node, link = node
    node.sent(FIRST.odometry, said_ns(FIRST.stamp_ns))
    whole = transform(FIRST.stamp_ns)
    nan = transform(FIRST.stamp_ns, [np.nan, 0.0, 0.0], sender="c")
    other = transform(FIRST.stamp_ns, [9.0, 9.0, 0.0], sender="b")
    link.come[TF.name] = [Taken(whole.data[:30], "c"), Taken(b"", "c"), nan, whole, other]
    assert node.answered()
    assert node.odd == {"malformed": 3, "from_others": 1}
    assert node.estimate().T_map_robot == pytest.approx(np.zeros(3), abs=1e-15)
    assert "a second node states map -> odom" in caplog.text


def test_a_pose_is_an_answer_and_states_the_covariance(node):
    node, link = node
    node.sent(FIRST.odometry, said_ns(FIRST.stamp_ns))
    spread = np.diag([0.01, 0.02, 0.03])
    pose = PoseMessage(MAP)(FIRST.stamp_ns, np.array([1.0, 2.0, 0.0]), spread)
    link.come[POSES[0].name] = [Taken(bytes(pose), "a")]
    assert node.answered()
    assert node.estimate().T_map_robot == pytest.approx(np.zeros(3), abs=1e-15)
    assert np.sort(np.diag(node.estimate().covariance)) == pytest.approx([0.01, 0.02, 0.03])


@pytest.mark.parametrize(
    "spread",
    [
        np.diag([-0.01, 0.02, 0.03]),
        np.diag([0.01, 0.02, -1e-3]),
        np.diag([np.nan, 0.02, 0.03]),
        np.diag([0.01, np.inf, 0.03]),
        np.diag([1e308, 0.02, 0.03]),
        np.array([[0.01, 0.02, 0.0], [0.0, 0.02, 0.0], [0.0, 0.0, 0.03]]),
        np.array([[0.01, 0.02, 0.0], [0.02, 0.02, 0.0], [0.0, 0.0, 0.03]]),
        np.full((3, 3), -1.0),
    ],
)
def test_a_pose_whose_covariance_cannot_be_is_counted_and_left_out(node, spread, caplog):
    node, link = node
    node.sent(FIRST.odometry, said_ns(FIRST.stamp_ns))
    say = PoseMessage(MAP)
    whole = np.diag([0.01, 0.02, 0.03])
    for cov in (whole, spread, spread):
        pose = say(FIRST.stamp_ns, np.array([1.0, 2.0, 0.0]), cov)
        link.come[POSES[0].name].append(Taken(bytes(pose), "whoever"))
    assert node.answered()
    assert np.sort(np.diag(node.estimate().covariance)) == pytest.approx([0.01, 0.02, 0.03])
    assert node.odd == {"malformed": 2}
    assert caplog.text.count("/pose: left out: pose.covariance must be") == 1


def test_its_map_comes_back(node):
    node, link = node
    node.sent(FIRST.odometry, said_ns(FIRST.stamp_ns))
    values = np.array([[0.0, 1.0, np.nan], [0.5, 0.25, 0.0]], dtype=np.float32)
    raster = Raster(values=values, resolution_m=0.1, T_map_origin=np.array([-1.0, -2.0, 0.0]))
    link.come[GRID.name] = [Taken(bytes(MapMessage(raster)(FIRST.stamp_ns)), "a")]
    link.come[TF.name] = [transform(FIRST.stamp_ns, np.zeros(3))]
    assert node.answered()
    found = node.map()
    np.testing.assert_array_equal(found.values, values)
    assert found.T_map_origin == pytest.approx(raster.T_map_origin, abs=1e-9)


def test_a_robot_sends_what_a_bag_holds_and_no_truth_where_a_frame_has_none():
    link = InMemory()
    robot = Robot(link)
    for frame in driven(3):
        robot.send(frame)
    assert {name: len(sent) for name, sent in link.sent.items() if sent} == {
        "/ground_truth/time": 1, "/tf_static": 1, "/clock": 3, "/tf": 3, "/odom": 3,
        "/odom_increment": 3, "/ground_truth/pose": 3, "/ground_truth/tf": 3, "/scan": 3,
        "/scan_turn": 3,
    }  # fmt: skip


@pytest.mark.parametrize(("second", "said"), [(0, 1_700_000_000), (1_800_000_000, 1_800_000_000)])
def test_times_of_a_simulation_are_said_later_and_those_of_a_log_as_they_are(second, said):
    clock = decoded(ClockMessage.KIND, bytes(ClockMessage()(second * NS_PER_S))).clock
    assert (clock.sec, clock.nanosec) == (said, 0)


def test_of_a_recorded_stack_the_newest_transform_stands():
    frames = driven(40)
    said = [StampedPose(f.stamp_ns, SAID) for f in frames[::10]]
    slam = RecordedSlam(said)
    estimates = [slam.update(frame) for frame in frames]
    assert all(e.converged for e in estimates)
    wanted = [se2.between(frames[0].odometry.T_odom_robot, f.odometry.T_odom_robot) for f in frames]
    np.testing.assert_allclose([e.T_map_robot for e in estimates], wanted, atol=1e-12)
    hour_ns = 3600 * NS_PER_S
    late = [s._replace(stamp_ns=s.stamp_ns + hour_ns) for s in said]
    bag, first_ns = Path("bag"), frames[0].stamp_ns
    with pytest.raises(LogFormatError, match=r"bag: .* 3600\.000 s after .* --clock-offset -3600"):
        aligned(bag, late, first_ns, offset_s=0.0, epoch_ns=0)
    assert aligned(bag, late, first_ns, offset_s=-3600.0, epoch_ns=0) == said


def test_recorded_poses_are_carried_on_by_odometry():
    frames = driven(40)
    said = [StampedPose(f.stamp_ns, f.odometry.T_odom_robot) for f in frames[::10]]
    slam = RecordedSlam(said, poses=True)
    for frame in frames:
        estimate = slam.update(frame)
    np.testing.assert_allclose(estimate.T_map_robot, frames[-1].odometry.T_odom_robot, atol=1e-12)


@pytest.mark.parametrize(
    ("variable", "value", "match"),
    [
        ("ROS_DOMAIN_ID", "233", "0..232, got 233"),
        ("ROS_DOMAIN_ID", "x", "whole number, got 'x'"),
        ("ROS_NAMESPACE", "a b", "names between '/', got 'a b'"),
    ],
)
def test_what_the_environment_says_wrong_is_named(monkeypatch, variable, value, match):
    monkeypatch.setenv(variable, value)
    with pytest.raises(InvalidValueError, match=match):
        open_link("dds")


def test_without_the_extra_the_error_says_how_to_get_it(monkeypatch):
    monkeypatch.setitem(sys.modules, "slam.ros.dds_link", None)
    with pytest.raises(MissingDependencyError, match=r"pip install 'mobilia\[ros2\]'"):
        open_link("dds")


def test_clock_and_transforms_are_the_same_for_all_robots():
    names = [Topic(name=n, kind="").within("/one") for n in ("/scan", "/tf", "/clock")]
    assert names == ["/one/scan", "/tf", "/clock"]


class TestOverDds:
    """Real processes on the loopback."""

    @pytest.fixture(autouse=True)
    def installed(self, monkeypatch):
        pytest.importorskip("cyclonedds", reason="needs the extra ros2")
        monkeypatch.setattr(ros2, "ANSWER_S", 0.2)

    def test_nobody_there_is_hung(self):
        with pytest.raises(SlamFailedError, match="nobody listens to /scan") as raised:
            create("ros2", first_limit_s=0.3).update(FIRST)
        assert raised.value.outcome == "hung"

    def test_a_node_that_ends_is_named_with_its_last_words(self):
        slam = create(f"ros2:{sys.executable} -c 'import sys; sys.exit(\"no map\")'")
        with pytest.raises(SlamFailedError, match=r"ended with status 1.*no map") as raised:
            slam.update(FIRST)
        assert raised.value.outcome == "raised"
        with pytest.raises(SlamFailedError, match="is over"):
            slam.update(SECOND)


@pytest.mark.slow
@pytest.mark.parametrize("middleware", ["dds", "zenoh"])
def test_a_node_of_ours_says_what_the_same_code_says_here(middleware, monkeypatch):
    monkeypatch.setattr(ros2, "ANSWER_S", 20.0)  # a busy machine
    pytest.importorskip({"dds": "cyclonedds", "zenoh": "zenoh"}[middleware])
    prefix = {"dds": "ros2", "zenoh": "ros2-zenoh"}[middleware]
    served = create(f"{prefix}:{sys.executable} -m slam.ros.serve odometry {middleware}")
    own = create("odometry")
    for frame in driven(50):
        a, b = served.update(frame), own.update(frame)
        assert a.diagnostics == {"answered": True}
        np.testing.assert_allclose(a.T_map_robot, b.T_map_robot, atol=1e-12)
        np.testing.assert_allclose(a.covariance, b.covariance, atol=1e-12)
    served.close()


def test_a_domain_rests_until_the_node_that_was_ended_there_is_forgotten() -> None:
    first = Domain("dds", own=True, wait_s=5.0)
    first.free()
    second = Domain("dds", own=True, wait_s=5.0)
    second.free()
    assert first.number != second.number

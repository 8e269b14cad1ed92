# SPDX-License-Identifier: Apache-2.0
"""What goes wrong between real processes, with nodes of other makes: what is said, what goes on."""

import os
import shlex
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import closing, nullcontext
from dataclasses import replace
from fcntl import LOCK_EX
from itertools import count

import numpy as np
import pytest

from slam import se2
from slam.errors import SlamFailedError
from slam.frames import NS_PER_S
from slam.ros import slam as ros2
from slam.ros.link import open_link
from slam.ros.messages import MAP, ODOM, TransformMessage
from slam.ros.node import TF, Node, decoded, transform_of
from slam.ros.robot import Robot
from slam.ros.template import said_ns
from slam.system import create
from tests.slam.ros.clients import PREFIXES, met, on, started
from tests.slam.ros.conftest import network
from tests.slam.ros.frames import driven

CABLES = count()
HZ = 37.5
CUT_S = 5.0
ANSWERS = replace(TF, depth=1000)
BY = (
    "<CycloneDDS><Domain><General><Interfaces><NetworkInterface address='{}'/></Interfaces>"
    "</General><Discovery>{}</Discovery></Domain></CycloneDDS>"
)
SEES = """
import sys, time
from cyclonedds.builtin import BuiltinDataReader, BuiltinTopicDcpsPublication
from cyclonedds.domain import DomainParticipant
participant = DomainParticipant(int(sys.argv[1]))
reader = BuiltinDataReader(participant, BuiltinTopicDcpsPublication)
end, seen = time.monotonic() + float(sys.argv[2]), set()
while time.monotonic() < end and "rt/scan" not in seen:
    time.sleep(0.1)
    seen |= {found.topic_name for found in reader.take(100)}
print(*seen)
"""  # as ros2 topic list does
pytestmark = pytest.mark.slow


def test_a_node_that_is_killed_ends_its_own_run(client, monkeypatch):
    monkeypatch.setattr(ros2, "ANSWER_S", 20.0)
    middleware, words = client
    killed = shlex.join(["timeout", "-s", "KILL", "4", *map(str, words)])
    slam = create(f"{PREFIXES[middleware]}:{killed}")

    def drive() -> None:
        for frame in driven(1000):
            slam.update(frame)
            time.sleep(1.0 / HZ)

    with pytest.raises(SlamFailedError, match="its process was ended by SIGKILL") as raised:
        drive()
    assert raised.value.outcome == "raised"


def test_of_many_that_speak_only_the_first_that_makes_sense_is_believed(client, caplog):
    middleware, words = client
    with on(middleware) as (domain, link):
        robot, node = Robot(link, paced=True), Node(link)
        other = open_link(middleware, domain=domain.number, router=domain.router)
        other.advertise(TF)
        say = TransformMessage((MAP, ODOM, 0.0))
        with closing(other), started(words, domain):
            met(link, robot)
            for k, frame in enumerate(driven(100)):
                node.sent(frame.odometry, said_ns(frame.stamp_ns))
                robot.send(frame)
                while not node.answered():
                    time.sleep(0.001)
                T_first_odom = se2.between(driven(1)[0].odometry.T_odom_robot, np.zeros(3))
                np.testing.assert_allclose(node.T_own_odom, T_first_odom, atol=1e-12)
                if k >= 10:  # the node of the other make has spoken first
                    off = bytes(say(frame.stamp_ns, np.full(3, 9.0)))
                    late = bytes(say(frame.stamp_ns - 3600 * NS_PER_S, np.zeros(3)))
                    for data in (off, late, off[:40]):
                        other.publish(TF, data)
            time.sleep(0.5)
            node.answered()
    assert node.odd.pop("clock_off_s") == pytest.approx(-3600.0, abs=10.0)
    torn = 90 if middleware == "zenoh" else 0  # Cyclone DDS itself leaves them out
    assert node.odd == {"from_others": 90} | ({"malformed": torn} if torn else {})
    assert "a second node states map -> odom" in caplog.text


@pytest.fixture
def alone(request) -> Iterator[None]:
    """No client of another test; ``client`` sees to it where there is one of this."""
    with network(LOCK_EX) if "client" not in request.fixturenames else nullcontext():
        yield


@pytest.fixture
def cable(alone) -> Iterator[tuple[list[str], str, str, Callable[[str], None]]]:
    """Another machine: words that start a program on it, our address, its address, and a switch."""
    pid, one = os.getpid(), next(CABLES)  # the last one may still be going
    space, ours, theirs = f"mobilia{pid}-{one}", f"mob{pid}{one}a", f"mob{pid}{one}b"
    inside = ["ip", "netns", "exec", space]
    if (
        os.geteuid()
        or not shutil.which("ip")
        or subprocess.run(["ip", "netns", "add", space]).returncode
    ):
        pytest.skip("needs ip netns, and to be root")
    net = f"10.213.{(pid + one) % 256}"
    here, there = f"{net}.1", f"{net}.2"
    for line in (
        f"ip link add {ours} type veth peer name {theirs} netns {space}",
        f"ip addr add {here}/24 dev {ours}", f"ip link set {ours} up",
        *(" ".join([*inside, "ip", words]) for words in (
            f"addr add {there}/24 dev {theirs}", f"link set {theirs} up", "link set lo up",
        )),
    ):  # fmt: skip
        subprocess.run(line.split(), check=True)
    yield (
        inside,
        here,
        there,
        lambda how: subprocess.run(["ip", "link", "set", ours, how], check=True),
    )
    subprocess.run(["ip", "link", "del", ours], check=True)  # at once; with the space it is later
    subprocess.run(["ip", "netns", "del", space], check=True)


@pytest.mark.parametrize(
    ("asks", "sees"), [("", False), ("<Peers><Peer address='{}'/></Peers>", False), ("", True)]
)
def test_another_machine_sees_the_robot_where_it_may(cable, asks, sees, monkeypatch):
    pytest.importorskip("cyclonedds", reason="needs the extra ros2")
    inside, here, there, _ = cable
    if sees:
        monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "SUBNET")
        monkeypatch.setenv("CYCLONEDDS_URI", BY.format(here, ""))
    with on("dds") as (domain, link):
        Robot(link)

        def seen(*words: str, for_s: float) -> bool:
            looks = [*words, sys.executable, "-c", SEES, str(domain.number), str(for_s)]
            return "rt/scan" in subprocess.check_output(looks, text=True).split()

        assert seen(for_s=30.0)
        monkeypatch.setenv("CYCLONEDDS_URI", BY.format(there, asks.format(here)))
        assert seen(*inside, for_s=30.0 if sees else 2.5) == sees


def test_a_cut_of_five_seconds_holds_nothing_up_and_scans_flow_again(client, cable, monkeypatch):
    (middleware, words), (inside, here, there, switch) = client, cable
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "SUBNET")
    monkeypatch.setenv("CYCLONEDDS_URI", BY.format(here, "<SPDPInterval>1s</SPDPInterval>"))
    monkeypatch.setenv("NODE_IP", there)
    monkeypatch.setenv("ROBOT_IP", here)
    with on(middleware) as (domain, link):
        monkeypatch.setattr(type(domain), "environment", lambda domain: {
            "ROS_DOMAIN_ID": str(domain.number),
            "ZENOH_CONFIG_OVERRIDE": f'connect/endpoints=["tcp/{here}:{domain.router}"]',
        })  # fmt: skip
        link.subscribe(ANSWERS)
        robot = Robot(link)
        with started([*inside, *words], domain):
            met(link, robot)
            down, up = round(HZ * 2.0), round(HZ * (2.0 + CUT_S))
            frames, sent_s, came = driven(up + round(HZ * 30.0)), [], set()
            stamps = [said_ns(frame.stamp_ns) for frame in frames]
            before, after = set(stamps[:down]), set(stamps[up:])
            began_s = time.monotonic()
            for k, frame in enumerate(frames):
                time.sleep(max(0.0, began_s + k / HZ - time.monotonic()))
                if k in (down, up):
                    switch("down" if k == down else "up")
                robot.send(frame)
                sent_s.append(time.monotonic())
                for taken in link.take(ANSWERS):
                    came.add(transform_of(decoded(TF.kind, taken.data), MAP, ODOM).stamp_ns)
                if len(came & after) > HZ:
                    break
    late_s = float(np.diff(sent_s).max())
    print(
        f"{middleware}: over {sent_s[-1] - sent_s[up]:.1f} s after the cable, late {late_s:.2f} s"
    )
    assert len(came & before) >= 0.9 * down
    assert len(came & after) > HZ
    assert late_s < CUT_S / 2  # the world goes on

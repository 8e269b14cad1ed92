# SPDX-License-Identifier: Apache-2.0
"""What others on a network of ROS 2 ask of a live view, and what is refused."""

import threading
import time
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from scripts.live.playback import Drive, Inbox, Kidnap, MoveDoor, Push
from scripts.live.session import Hands, Opener
from scripts.live.view import TAKES, Network
from sim.moments import Moment
from sim.recording.bag import BagWriter
from sim.simulation import Simulation
from slam.ros.link import MIDDLEWARES, Taken, open_link
from slam.ros.messages import PoseMessage
from slam.ros.node import TF, decoded, transform_of
from slam.ros.serve import Served
from slam.ros.slam import Domain
from slam.ros.template import STORE, message, said_ns
from slam.system import create
from tests.scripts.live.test_session import carmen
from tests.slam.ros.frames import SPEC, InMemory, driven


@pytest.fixture
def network() -> tuple[Network, InMemory]:
    link = InMemory()
    return Network(link), link


def said(kind: str, **fields) -> Taken:
    return Taken(bytes(STORE.serialize_cdr(message(kind, **fields), kind)), "a")


def twist(v: float, omega: float = 0.0) -> Taken:
    kind = "geometry_msgs/msg/Twist"
    return said(kind, linear={"x": v}, angular={"z": omega})


def stamped(v: float) -> Taken:
    return said("geometry_msgs/msg/TwistStamped", twist={"linear": {"x": v}})


def word(text: str) -> Taken:
    return said("std_msgs/msg/String", data=text)


def test_messages_are_what_a_page_may_ask_for(network):
    (network, link), inbox = network, Inbox()
    there = PoseMessage()(0, np.array([1.0, 2.0, 0.5]), np.eye(3))
    link.come |= {
        "/cmd_vel": [twist(9.0), twist(0.3, 0.1)],
        "/initialpose": [Taken(bytes(there), "a")],
        "/mobilia/push": [word("")],
        "/mobilia/door": [word("shut door:1")],
    }
    assert list(network.requests(inbox.refuse)) == [
        Drive(v=0.3, omega=0.1), Kidnap(pose=(1.0, 2.0, 0.5)), Push(name=""),
        MoveDoor(opened=False, name="door:1"),
    ]  # fmt: skip
    assert inbox.refused() is None
    link.come[TAKES[1][0]] = [stamped(0.2)]
    assert list(network.requests(inbox.refuse)) == [Drive(v=0.2, omega=0.0)]


@pytest.mark.parametrize(
    ("topic", "taken", "match"),
    [
        ("/cmd_vel", twist(np.nan), "/cmd_vel: Drive.v must be a number"),
        ("/cmd_vel", Taken(b"\x00\x01\x00\x00abc", "a"), "7 bytes that are no geometry_msgs"),
        ("/mobilia/door", word("ajar"), "'open' or 'shut'"),
        ("/mobilia/push", word("x" * 101), "0 to 100 letters"),
    ],
)
def test_what_cannot_be_is_left_out_and_said(network, topic, taken, match):
    (network, link), inbox = network, Inbox()
    link.come[topic] = [taken]
    assert list(network.requests(inbox.refuse)) == []
    assert match in inbox.refused()
    assert inbox.refused() is None


def test_a_twist_moves_the_robot(network):
    network, link = network
    hands = Hands(Simulation("arena", dynamism=0.0))
    moments = hands.moments(2.0)
    before = next(moments).frame.truth
    for _ in range(30):
        link.come["/cmd_vel"] = [twist(0.3)]
        for request in network.requests(Inbox().refuse):
            hands.do(request)
        after = next(moments).frame.truth
    assert np.hypot(*(after - before)[:2]) > 0.1


def log(folder: Path) -> Path:
    """A log of 12 scans, five a second, with the times of its year."""
    path = folder / "made.log"
    path.write_text(carmen(12))
    return path


def bag(folder: Path) -> Path:
    """A bag of 40 scans."""
    with BagWriter(folder / "bag", SPEC, labels=False) as out:
        for frame in driven(40):
            out.write(Moment(frame=frame, poses=np.empty((0, 3)), moving=np.empty(0, bool)))
    return folder / "bag"


@pytest.mark.slow
@pytest.mark.parametrize("recorded", [log, bag])
@pytest.mark.parametrize("middleware", MIDDLEWARES)
def test_a_node_hears_every_scan_of_a_log_and_of_a_bag(middleware, recorded, tmp_path):
    pytest.importorskip("viser")
    pytest.importorskip({"dds": "cyclonedds", "zenoh": "zenoh"}[middleware])
    from scripts.live.view import View

    domain = Domain(middleware, own=True, wait_s=10.0)
    links = [open_link(middleware, domain=domain.number, router=domain.router) for _ in range(3)]
    own, other, third = links
    view = View(Opener(slams=["odometry"], path=recorded(tmp_path)), ("127.0.0.1", 0),
                network=Network(own))  # fmt: skip
    node, over = Served(other, create("odometry")), threading.Event()

    def serve() -> None:
        while not over.is_set():
            node.turn()

    thread, said = threading.Thread(target=serve), replace(TF, depth=1000)
    with closing(view), closing(third):
        third.subscribe(said)
        time.sleep(1.0)  # all have found each other
        thread.start()
        shown, answered, end_s = set(), set(), time.monotonic() + 20.0
        while not view.playback.ended:
            view.turn()
            shown.add(said_ns(view.playback.present.frame.stamp_ns))
        while answered != shown and time.monotonic() < end_s:
            third.wait(0.1)
            found = (decoded(TF.kind, taken.data) for taken in third.take(said))
            links = (transform_of(message, "map", "odom") for message in found)
            answered |= {link.stamp_ns for link in links if link is not None}
        over.set()
        thread.join()
        other.close()
    domain.free()
    assert answered == shown

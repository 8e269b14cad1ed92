# SPDX-License-Identifier: Apache-2.0
"""What others on a network of ROS 2 ask of a live view, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest

from scripts.live.hands import Hands
from scripts.live.network import Network
from scripts.live.requests import Drive, Kidnap, MoveDoor, Push
from sim.simulation import Simulation
from slam.ros.link import Taken
from slam.ros.navigation_messages import StartMessage
from slam.ros.template import STORE, message
from tests.slam.ros.frames import InMemory


@pytest.fixture
def network() -> tuple[Network, InMemory]:
    link = InMemory()
    return Network(link, height_m=0.36), link


def said(kind: str, **fields) -> Taken:
    return Taken(bytes(STORE.serialize_cdr(message(kind, **fields), kind)), "a")


def twist(v: float, omega: float = 0.0) -> Taken:
    kind = "geometry_msgs/msg/Twist"
    return said(kind, linear={"x": v}, angular={"z": omega})


def word(text: str) -> Taken:
    return said("std_msgs/msg/String", data=text)


def test_messages_are_what_a_page_may_ask_for(network):
    network, link = network
    there = StartMessage()(0, np.array([1.0, 2.0, 0.5]))
    link.come |= {
        "/cmd_vel": [twist(9.0), twist(0.3, 0.1)],
        "/initialpose": [Taken(bytes(there), "a")],
        "/mobilia/push": [word("")],
        "/mobilia/door": [word("shut door:1")],
    }
    assert list(network.requests()) == [
        Drive(v=0.3, omega=0.1), Kidnap(pose=(1.0, 2.0, 0.5)), Push(name=""),
        MoveDoor(opened=False, name="door:1"),
    ]  # fmt: skip
    assert network.refused() is None


@pytest.mark.parametrize(
    ("topic", "taken", "match"),
    [
        ("/cmd_vel", twist(np.nan), "/cmd_vel: drive: v must be a number"),
        ("/cmd_vel", Taken(b"\x00\x01\x00\x00abc", "a"), "7 bytes that are no geometry_msgs"),
        ("/mobilia/door", word("ajar"), "'open' or 'shut'"),
        ("/mobilia/push", word("x" * 101), "up to 100 letters"),
    ],
)
def test_what_cannot_be_is_left_out_and_said(network, topic, taken, match):
    network, link = network
    link.come[topic] = [taken]
    assert list(network.requests()) == []
    assert match in network.refused()
    assert network.refused() is None


def test_a_twist_moves_the_robot(network):
    network, link = network
    hands = Hands(Simulation("arena", dynamism=0.0))
    moments = hands.moments(2.0)
    before = next(moments).frame.truth
    for _ in range(30):
        link.come["/cmd_vel"] = [twist(0.3)]
        for request in network.requests():
            hands.do(request)
        after = next(moments).frame.truth
    assert np.hypot(*(after - before)[:2]) > 0.1

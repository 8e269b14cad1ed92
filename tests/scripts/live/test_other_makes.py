# SPDX-License-Identifier: Apache-2.0
"""Nodes of other makes, and the clients of docs/ros2.md, drive the robot of a live view."""

import os
import re
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from scripts.live.session import Opener, Session
from scripts.live.view import Network
from slam.ros.link import MIDDLEWARES, Link
from tests.slam.ros.clients import on, started
from tests.slam.ros.conftest import client, node

__all__ = ["client", "node"]  # fixtures
pytestmark = pytest.mark.slow
PAGE = (Path(__file__).parents[3] / "docs" / "ros2.md").read_text()
CLIENTS = dict(
    zip(MIDDLEWARES, re.findall(r"```python\n(.*?)```", PAGE, flags=re.DOTALL), strict=True)
)


@pytest.fixture
def session() -> Session:
    """A robot in an arena."""
    return Opener(slams=["odometry"], settings={"scene": "arena"}, seconds=60.0).open()


def driven_m(session: Session, link: Link, child: "subprocess.Popen[str]") -> float:
    """How far that process drives the robot until it ends."""
    network = Network(link)
    network.begin(session.static_map, session.scan_height_m)
    for shown in session.run():
        network.send(shown)
        time.sleep(1.0 / 37.5)
        for request in network.requests(print):
            session.hands.do(request)
        if child.poll() is not None:
            break
    child.kill()
    assert session.hands.client_drives
    return float(np.hypot(*(shown.frame.truth - session.moments.T_world_map)[:2]))


def test_their_stamped_twists_move_the_robot(client, session):
    middleware, words = client
    with (
        on(middleware) as (domain, link),
        started([*words, os.devnull, 60, "stamped"], domain) as drives,
    ):
        assert driven_m(session, link, drives) > 0.2


@pytest.mark.parametrize("middleware", MIDDLEWARES)
def test_a_client_of_the_page_counts_scans_and_drives(middleware, session):
    pytest.importorskip({"dds": "cyclonedds", "zenoh": "zenoh"}[middleware])
    with on(middleware) as (domain, link):
        text, number = CLIENTS[middleware], domain.number
        text = text.replace("Participant(0)", f"Participant({number})")
        text = text.replace('f"0/', f'f"{number}/').replace("7447", str(domain.router))
        words = [sys.executable, "-c", text]
        with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as child:
            assert driven_m(session, link, child) > 0.2
            said = child.stdout.read().splitlines()
    assert [re.sub(r"\d+\.\d\d", "d", line) for line in said] == [
        f"{k} nearest d m" for k in range(1, 101)
    ]

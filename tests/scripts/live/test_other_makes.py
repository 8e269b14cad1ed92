# SPDX-License-Identifier: Apache-2.0
"""Nodes of other makes drive the robot of a live view."""

import os
import time

import numpy as np
import pytest

from scripts.live.session import Opener
from scripts.live.view import Network
from tests.slam.ros.clients import on, started
from tests.slam.ros.conftest import client, node

__all__ = ["client", "node"]  # fixtures
pytestmark = pytest.mark.slow


def test_their_stamped_twists_move_the_robot(client):
    middleware, words = client
    session = Opener(slams=["odometry"], settings={"scene": "arena"}, seconds=600.0).open()
    with on(middleware) as (domain, link):
        network = Network(link)
        network.begin(session.static_map, session.scan_height_m)
        with started([*words, os.devnull, 60, "stamped"], domain) as drives:
            time.sleep(2.0)
            for shown in session.run():
                network.send(shown)
                time.sleep(1.0 / 37.5)
                for request in network.requests(print):
                    session.hands.do(request)
                if drives.poll() is not None:
                    break
    moved = shown.frame.truth - session.moments.T_world_map
    assert session.hands.client_drives
    assert np.hypot(*moved[:2]) > 0.2

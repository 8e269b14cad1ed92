# SPDX-License-Identifier: Apache-2.0
"""A client drives the robot, pushes a chair and looks back, over a real socket."""

from __future__ import annotations

import json
import math
import re
import struct
import sys
import threading
from collections.abc import Iterator

import numpy as np
import pytest

from scripts.experiments import live_client
from scripts.live import gate, opened, sdk
from scripts.live.client import Client, fields
from scripts.live.playback import Playback
from scripts.live.session import EPOCH_NS
from scripts.live.view import View
from slam.errors import InvalidValueError, MissingDependencyError

LOOPBACK = ("127.0.0.1", 0)


@pytest.fixture(scope="module")
def view() -> Iterator[View]:
    pytest.importorskip("foxglove", reason="needs the extra 'live'")
    session, shown_ns = opened.of_scene(["odometry"], {"scene": "arena", "dynamism": 0.0}, 600.0)
    view = View(sdk.require(), session, Playback(session.run()), LOOPBACK, shown_ns)
    over = threading.Event()

    def turn() -> None:
        while not over.is_set():
            view.turn()

    thread = threading.Thread(target=turn)
    thread.start()
    yield view
    over.set()
    thread.join()
    view.close()


@pytest.fixture
def client(view: View) -> Iterator[Client]:
    pytest.importorskip("websockets", reason="needs a WebSocket client")
    with Client.of(f"ws://127.0.0.1:{view.port}") as client:
        client.subscribe(
            "/playback", "/world", "/truth/pose", "/scan/points", "/tf", "/odometry/errors"
        )
        client.until(lambda: client.playback() and "/truth/pose" in client.newest)
        yield client
        client.call("/seek", back_s=0)
        client.call("/tour")
        client.call("/play")


def test_a_client_drives_the_robot_with_twists(client: Client):
    x, y = client.pose("/truth/pose")
    client.send(op="advertise", channels=[
        {"id": 7, "topic": "/cmd_vel", "encoding": "json", "schemaName": "geometry_msgs/Twist"}
    ])  # fmt: skip
    twist = json.dumps({"linear": {"x": 0.5}, "angular": {"z": 0.0}}).encode()

    def gone() -> bool:
        client.publish(7, twist)
        now = client.pose("/truth/pose")
        return math.hypot(now[0] - x, now[1] - y) > 0.2

    client.until(gone)
    assert client.playback()["driver"] == "client"
    assert client.call("/tour") == {"done": "the built-in driver drives"}
    client.until(lambda: client.playback()["driver"] == "tour")


def test_a_client_pushes_a_chair_and_sees_it_move(client: Client):
    assert client.call("/pause") == {"done": "paused"}
    name = next(name for name in client.entities if name.startswith("mover/chair"))
    x, y = client.middle(name)
    said = client.call("/push", name=name.partition("/")[2], speed_mps=1.0, heading_deg=90)
    assert "is pushed at 1 m/s to 90 deg" in said["done"]
    before = client.playback()["time_s"]
    client.call("/step", scans=20)
    client.until(lambda: client.playback()["time_s"] > before + 0.4)
    now = client.middle(name)
    assert now[1] - y > 0.1
    assert abs(now[0] - x) < 0.1


def test_looking_back_shows_the_past_and_touches_nothing(client: Client):
    client.call("/pause")
    client.until(lambda: not client.playback()["playing"])
    present = client.playback()["time_s"]
    client.call("/seek", time_s=0)
    client.until(lambda: client.playback()["time_s"] == 0.0)
    assert client.stamps["/playback"] >= EPOCH_NS
    assert client.stamps["/playback"] < EPOCH_NS + 10**9
    assert "an earlier moment is shown" in client.call("/push")
    assert "is not kept, only 0.00 to" in client.call("/seek", time_s=1e6)
    client.call("/seek", back_s=0)
    client.until(lambda: client.playback()["time_s"] >= present)  # a step may have been under way


def test_the_time_line_of_the_app_is_obeyed(client: Client):
    states = client.states
    seek = EPOCH_NS
    request = struct.pack("<BBfBQI", 3, 1, 2.0, 1, seek, 2) + b"ab"  # pause at twice the speed
    client.socket.send(request)
    client.until(lambda: client.states > states)
    client.until(lambda: client.playback()["time_s"] == 0.0 and not client.playback()["playing"])
    assert client.playback()["speed"] == 2.0
    client.send(op="setParameters", parameters=[{"name": "speed", "value": 1.0}], id="q")
    client.until(lambda: client.playback()["speed"] == 1.0 or client.call("/step"))


def test_points_carry_what_they_hit(client: Client):
    cloud = fields(client.newest["/scan/points"])
    assert cloud[2] == [b"laser"]
    (stride,) = cloud[4]
    points = np.frombuffer(cloud[6][0], np.uint8).reshape(-1, stride)
    names = [fields(part)[1][0].decode() for part in cloud[5]]
    assert names == ["x", "y", "z", "red", "green", "blue", "alpha", "label"]
    assert set(points[:, 16]) <= {1, 2, 3, 4}
    assert (points[:, 15] == 255).all()
    frames = [fields(part)[3][0] for part in fields(client.newest["/tf"])[1]]
    assert frames == [b"map", b"odom", b"base_link", b"laser", b"truth", b"truth_laser"]
    assert json.loads(client.newest["/odometry/errors"])["position_m"] >= 0.0


def test_bad_messages_are_told_and_kill_nothing(client: Client):
    client.socket.send("garbage")
    client.socket.send(b"\xff\x01")
    client.publish(99, b"{}")
    client.send(op="advertise", channels=[
        {"id": 1, "topic": "/cmd_vel", "encoding": "json", "schemaName": ""},
        {"id": 2, "topic": "/etc", "encoding": "json", "schemaName": ""},
    ])  # fmt: skip
    client.publish(1, b'{"linear": {"x": 1e999}}')
    client.until(lambda: any("must lie in" in said for said in client.said))
    client.publish(1, b"\x00" * 100_000)
    client.until(lambda: any("at most 16384 bytes" in said for said in client.said))
    assert "no door 'x'" in client.call("/open_door", name="x")
    assert "nothing called 'y'" in client.call("/push", name="y")
    assert "the robot cannot stand at" in client.call("/kidnap", x_m=1e5, y_m=0)
    client.send(op="setParameters", parameters=[{"name": "rm", "value": "-rf"}], id="q")
    client.until(lambda: any("parameters that can be set" in said for said in client.said))
    before = client.playback()["time_s"]
    client.until(lambda: client.playback()["time_s"] > before)


def test_without_the_sdk_one_line_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "foxglove", None)
    with pytest.raises(MissingDependencyError, match=r"pip install 'mobilia\[live\]'"):
        sdk.require()


def test_only_loopback_is_private():
    assert all(gate.is_loopback(host) for host in ("127.0.0.1", "localhost", "::1", "127.9.9.9"))
    assert not any(gate.is_loopback(host) for host in ("0.0.0.0", "192.168.1.2", "a.example", ""))


def test_a_port_that_is_taken_is_named(view: View):
    session = view.session
    with pytest.raises(InvalidValueError, match=f"cannot listen at 127.0.0.1:{view.port}"):
        View(sdk.require(), session, Playback(iter(())), ("127.0.0.1", view.port), (0, 1))


def test_the_client_of_the_page_drives_pushes_and_draws(tmp_path, monkeypatch, capsys):
    pytest.importorskip("foxglove", reason="needs the extra 'live'")
    pytest.importorskip("websockets", reason="needs a WebSocket client")
    monkeypatch.setattr(live_client, "TWISTS", 3)
    monkeypatch.setattr(live_client, "PUSH_SCANS", 40)
    live_client.main(["--out", str(tmp_path / "live.png")])
    said = capsys.readouterr().out
    way, rolled = (
        re.search(words, said) for words in (r"/truth/pose: ([\d.]+) m", r"([\d.]+) m moved")
    )
    assert way
    assert float(way[1]) > 0.1
    assert rolled
    assert float(rolled[1]) > 0.1
    assert "/events: client: the robot takes twists" in said
    assert (tmp_path / "live.png").read_bytes().startswith(b"\x89PNG")

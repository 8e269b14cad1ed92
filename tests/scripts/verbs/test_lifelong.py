# SPDX-License-Identifier: Apache-2.0
"""``mobilia lifelong`` and the sessions of ``mobilia run``: what is refused, a small building."""

import csv
import json
from types import SimpleNamespace

import numpy as np
import pytest

from scripts.single_run.run import Maps, SessionTrack, session_of
from slam.days.evidence import Snapshot
from slam.days.history import History
from slam.errors import InvalidValueError
from slam.frames import Stream, StreamMetadata
from slam.shunting import ShuntingSlam
from slam.trajectory import Trajectory

pytestmark = pytest.mark.slow


def test_the_time_of_a_session_is_given_or_the_logs_own():
    stream = Stream(
        metadata=StreamMetadata(source="test", extra={"epoch_ns": 5_000_000_000}), frames=list
    )
    maps = Maps(map_out="m.npz", at="1970-01-02T01:00")
    assert session_of("shunting", maps, stream).time_s == 25.0 * 3600.0
    assert session_of("shunting", Maps(map_out="m.npz"), stream).time_s == 5.0
    with pytest.raises(InvalidValueError, match="--at must be a time such as"):
        session_of("shunting", Maps(map_out="m.npz", at="nine"), stream)
    with pytest.raises(InvalidValueError, match="--at is about"):
        Maps(at="1970-01-02T01:00")
    with pytest.raises(InvalidValueError, match="'odometry' cannot go on in a map"):
        session_of("odometry", Maps(map_out="m.npz"), stream)


def test_a_session_that_is_not_later_than_the_map_is_asked_for_its_time(monkeypatch, tmp_path):
    (tmp_path / "m.npz").touch()
    seen = Snapshot(time_s=5.0, cells=np.zeros((1, 2), np.int32), standing=np.ones(1, np.float32))
    history = History(cell_m=0.1, sessions=(seen,))
    monkeypatch.setattr("scripts.single_run.run.read_history", lambda _: history)
    stream = Stream(
        metadata=StreamMetadata(source="test", extra={"epoch_ns": 5_000_000_000}), frames=list
    )
    monkeypatch.setattr(ShuntingSlam, "load", lambda _: ShuntingSlam())
    monkeypatch.setattr("slam.days.session.read_history", lambda _: history)
    with pytest.raises(InvalidValueError, match=r"later than the map's last .*at 5 s, got 5 s"):
        session_of("shunting", Maps(map_in=tmp_path / "m.npz"), stream)


def test_a_session_that_found_its_start_is_one_path_from_it():
    T_map_first = np.array([3.0, 1.0, 0.5 * np.pi])
    in_map = np.array([T_map_first, [3.0, 2.0, 0.5 * np.pi], [2.0, 2.0, np.pi]])
    path = Trajectory(stamps_ns=np.arange(3), poses=in_map)
    session = SimpleNamespace(T_map_first=T_map_first, trajectory=lambda: path)
    track = SessionTrack("shunting", session)
    wanted = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.5 * np.pi]]
    np.testing.assert_allclose(track.online().poses, wanted, atol=1e-12)
    assert track.final() is None


def test_a_small_building_is_lived_in(called, tmp_path):
    out = tmp_path / "life"
    words = "--sessions 2 --seconds 12 --first-seconds 30 --change 0.2 --motion 0"
    slams = "shunting,odometry"
    ended = called(
        "lifelong", "--scene", "apartment", "--slam", slams, *words.split(), "--out", out
    )
    assert ended.returncode == 0, ended.stderr
    rows = list(csv.DictReader((out / "lifelong.csv").read_text().splitlines()))
    assert [(r["slam"], r["session"]) for r in rows] == [
        ("shunting", "0"), ("odometry", "0"), ("shunting", "1"), ("odometry", "1"),
    ]  # fmt: skip
    assert [r["map"] for r in rows] == ["new", "anew", "merged", "anew"]
    assert rows[2]["place"] == "right"
    assert float(rows[2]["rmse_m"]) < 0.1
    assert json.loads((out / "lifelong.json").read_text())["settings"]["change"] == 0.2
    assert {"changes.csv", "changes.png", "mobility.png", "index.html", "map_shunting.npz"} <= {
        p.name for p in out.iterdir()
    }
    page = (out / "index.html").read_text()
    assert "starts anew: cannot load a map" in page
    assert "Session 1: " in page

# SPDX-License-Identifier: Apache-2.0
"""What is served is what is run: the same scans, whoever watches; logs as well."""

from __future__ import annotations

import json
import math
from itertools import islice

import numpy as np
import pytest

from scripts.live import opened
from scripts.live.hands import Hands
from scripts.live.requests import Drive, Kidnap, MoveDoor, Push, Touch
from scripts.live.session import EPOCH_NS, Path, stamps_of
from scripts.verbs.live import LAYOUT
from sim.moments import toured
from sim.recording.episode import record
from sim.recording.recipe import Recipe
from sim.simulation import Simulation
from slam.errors import InvalidValueError, NeedsLabelsError, UnknownNameError
from slam.frames import Frame

SETTINGS = {"scene": "arena", "dynamism": 0.5, "labels": True}


def scans(frames: list[Frame]) -> bytes:
    return b"".join(frame.scan.ranges.tobytes() for frame in frames if frame.scan is not None)


def some(moments, n: int) -> list[Frame]:
    return [moment.frame for moment in islice(moments, n)]


def test_a_world_that_nobody_touches_is_the_one_that_is_run_and_one_that_is_touched_is_repeatable():
    untouched = some(Hands(Simulation(**SETTINGS)).moments(1.0), 10)
    assert scans(untouched) == scans(some(toured(Simulation(**SETTINGS), 1.0), 10))
    twice = []
    for _ in range(2):
        hands = Hands(Simulation(**SETTINGS))
        moments = hands.moments(1.0)
        frames = some(moments, 3)
        hands.do(Push(speed=2.0, heading=0.5))
        hands.do(Drive(v=0.3, omega=1.0))
        frames += some(moments, 4)
        hands.do(Kidnap())
        twice.append(scans(frames + some(moments, 3)))
    assert twice[0] == twice[1]
    assert twice[0] != scans(untouched)


def test_a_twist_holds_for_a_second_then_the_robot_stands():
    hands = Hands(Simulation("arena", dynamism=0.0))
    hands.do(Drive(v=0.5, omega=0.0))
    frames = some(hands.moments(3.0), 75)
    at = np.array([frame.truth for frame in frames])
    early, late = np.hypot(*(at[20] - at[0])[:2]), np.hypot(*(at[-1] - at[-15])[:2])
    assert early > 0.05
    assert late < 0.01


def test_a_click_pushes_what_is_there_in_either_frame_and_nothing_far_away():
    simulation = Simulation("arena", dynamism=0.0)
    hands, world = Hands(simulation), simulation.world
    row = next(k for k, name in enumerate(world.mover_names) if name.startswith("chair"))
    x, y = world.mover_poses()[row, :2].tolist()
    assert hands.do(Touch(x=x, y=y)).startswith(world.mover_names[row])
    with pytest.raises(InvalidValueError, match="must be in 'world' or 'map'"):
        hands.do(Touch(x=x, y=y, frame="map"))
    hands.T_world_map = np.array([x, y, 1.0])
    assert hands.do(Touch(x=0.0, y=0.0, frame="map")).startswith(world.mover_names[row])
    with pytest.raises(InvalidValueError, match="nothing to push or to open within 1 m"):
        hands.do(Touch(x=1e5, y=0.0))
    with pytest.raises(UnknownNameError, match="there is no door ''"):
        hands.do(MoveDoor(opened=True))
    with pytest.raises(UnknownNameError, match="there is no goal 'moon' here, goals: "):
        hands.do(Kidnap(goal="moon"))


def carmen(n: int) -> str:
    """n scans of a wall around a robot that drives 5 cm a scan, 5 a second."""
    ranges = " ".join(["2.00"] * 180)
    lines = []
    for k in range(n):
        t, x = 1_100_000_000.0 + 0.2 * k, 0.05 * k
        pose = f"{x:.3f} 0.0 0.0 {x:.3f} 0.0 0.0"
        lines.append(f"FLASER 180 {ranges} {pose} {t:.6f} host {0.2 * k:.6f}\n")
    return "".join(lines)


def test_a_log_is_shown_with_its_own_stamps(tmp_path):
    log = tmp_path / "made.log"
    log.write_text(carmen(12))
    session, (first_ns, last_ns) = opened.of_file(["odometry"], log)
    shown = list(session.run())
    assert [moment.number for moment in shown] == list(range(12))
    assert shown[0].stamp_ns == first_ns
    assert shown[-1].stamp_ns == last_ns
    assert last_ns - first_ns == pytest.approx(2.2e9, abs=1e6)
    assert shown[-1].placed is None
    assert shown[-1].estimates["odometry"].T_map_robot[0] == pytest.approx(0.55)


def test_a_simulated_run_does_not_begin_at_zero():
    assert stamps_of(0, 2.0) == (EPOCH_NS, EPOCH_NS + 2 * 10**9)
    assert stamps_of(5 * EPOCH_NS, 2.0)[0] == 5 * EPOCH_NS


def test_a_path_is_thinned_and_ends_where_the_robot_is():
    path = Path()
    for k in range(5000):
        path.add(np.array([k, math.nan if k == 7 else 0.0, 0.0]))
    assert path.until(3, 100)[:, 0].tolist() == [0.0, 1.0, 2.0, 3.0]
    thin = path.until(4321, 100)
    assert len(thin) <= 103
    assert thin[-1, 0] == 4321.0


def test_the_layout_names_topics_and_services_that_there_are():
    layout = json.loads(LAYOUT.read_text())
    from scripts.live.published import TOPICS
    from scripts.live.requests import SERVICES

    panels = layout["configById"]
    called = {p["serviceName"] for name, p in panels.items() if name.startswith("CallService")}
    assert called <= {f"/{name}" for name in SERVICES}
    publish = panels["3D!mobilia"]["publish"]
    assert {publish["poseTopic"], publish["pointTopic"]} <= set(TOPICS)
    assert panels["Teleop!drive"]["topic"] in TOPICS
    for name, panel in panels.items():
        if name.startswith("CallService"):
            service = panel["serviceName"].lstrip("/")
            SERVICES[service].read(service, panel["requestPayload"].encode())


def test_a_bag_is_shown_with_its_truth_and_labels(tmp_path):
    recipe = Recipe(scene="arena", dynamism=0.5, seed=3, seconds=0.4)
    record(recipe, tmp_path)
    (bag,) = tmp_path.iterdir()
    session, _ = opened.of_file(["odometry"], bag)
    shown = list(session.run())
    assert len(shown) > 10
    assert shown[0].frame.labels is not None
    assert shown[-1].truth_map is not None
    assert shown[-1].errors("odometry")["position_m"] == pytest.approx(0.0, abs=0.05)


def test_an_oracle_needs_labels(tmp_path):
    log = tmp_path / "made.log"
    log.write_text(carmen(3))
    with pytest.raises(NeedsLabelsError, match=r"made.log has no labels"):
        opened.of_file(["oracle(shunting)"], log)

# SPDX-License-Identifier: Apache-2.0
"""What is served is what is run: the same scans, whoever watches; logs as well."""

import math
from dataclasses import replace
from itertools import islice
from types import SimpleNamespace
from unittest.mock import MagicMock

import numpy as np
import pytest

from scripts.live.drawn import SPARE, look_at
from scripts.live.messages import Controls
from scripts.live.page import Page
from scripts.live.playback import Anew, Click, Drive, Inbox, Playback
from scripts.live.session import KEPT, Hands, Opener
from sim.moments import toured
from sim.recording.episode import record
from sim.recording.recipe import Recipe
from sim.simulation import Simulation
from sim.view.parts import STATIC, Parts, Placed
from sim.world.requests import Kidnap, MoveDoor, Push
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
        hands.do(Push())
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


def test_a_click_pushes_what_is_there_and_nothing_far_away():
    simulation = Simulation("arena", dynamism=0.0)
    hands, world = Hands(simulation), simulation.world
    row = next(k for k, name in enumerate(world.mover_names) if name.startswith("chair"))
    x, y = world.mover_poses()[row, :2].tolist()
    down = (0.0, 0.0, -1.0)
    assert hands.do(Click(origin=(x, y, 3.0), direction=down)).startswith(world.mover_names[row])
    assert hands.do(Push(name=world.mover_names[row])).startswith("chair")
    xmin, ymin, _, _ = world.scene.bounds
    with pytest.raises(InvalidValueError, match="nothing to push or to open within 1 m"):
        hands.do(Click(origin=(xmin + 0.1, ymin + 0.1, 3.0), direction=down))
    with pytest.raises(InvalidValueError, match="nothing is there"):
        hands.do(Click(origin=(x, y, 3.0), direction=(0.0, 0.0, 1.0)))
    with pytest.raises(UnknownNameError, match="there is no door ''"):
        hands.do(MoveDoor(opened=True))


def carmen(n: int) -> str:
    """n scans of a wall around a robot that drives 5 cm a scan, 5 a second."""
    ranges = " ".join(["2.00"] * 180)
    lines = []
    for k in range(n):
        t, x = 1_100_000_000.0 + 0.2 * k, 0.05 * k
        pose = f"{x:.3f} 0.0 0.0 {x:.3f} 0.0 0.0"
        lines.append(f"FLASER 180 {ranges} {pose} {t:.6f} host {0.2 * k:.6f}\n")
    return "".join(lines)


def test_a_log_is_shown(tmp_path):
    log = tmp_path / "made.log"
    log.write_text(carmen(12))
    shown = list(Opener(slams=["odometry"], path=log).open().run())
    assert [moment.number for moment in shown] == list(range(12))
    assert shown[-1].seconds == pytest.approx(2.2, abs=1e-3)
    assert shown[-1].placed is None
    assert math.isnan(shown[-1].error("odometry")[0])
    assert shown[-1].own.T_map_robot[0] == pytest.approx(0.55)
    with pytest.raises(NeedsLabelsError, match=r"made.log has no labels"):
        Opener(slams=["oracle(shunting)"], path=log).open()


def test_a_page_asks_for_another_world_and_keeps_the_seed():
    opener = Opener(slams=["shunting", "grid"], settings=SETTINGS | {"seed": 4}, seconds=1.0)
    again = opener.anew(Anew(slam="odometry", motion=1.0, crowd="none"))
    assert again.slams == ["odometry", "grid"]
    assert again.settings == SETTINGS | {"seed": 4, "motion": 1.0, "crowd": "none"}
    assert replace(opener.anew(Anew()), typed=()) == opener


def test_what_is_kept_of_a_run_does_not_grow_with_it():
    settings = {"scene": "arena", "dynamism": 0.5}
    session = Opener(slams=["odometry"], settings=settings, seconds=4.0).open()
    shown = list(session.run())
    track = session.moments.replay.tracks["odometry"]
    assert len(shown) > 100
    assert len(track.estimates) == len(track.durations_s) == KEPT
    assert len(session.moments.replay.truth()) == KEPT
    assert track.estimates[-1] is shown[-1].estimates["odometry"]


def test_every_part_of_a_room_is_where_mujoco_has_it_and_a_ray_finds_it():
    world = Simulation("arena", dynamism=0.5).world
    parts = Parts(world.scene, world.model)
    parts.place(Placed.of(world))
    chair = next(k for k, name in enumerate(world.mover_names) if name.startswith("chair"))
    around = world.mover_poses()[chair, :2]
    of_chair = [b for b in parts.batches if chair in b.owners]
    assert of_chair
    for batch in of_chair:
        centres, turns = parts.poses(batch)
        assert np.hypot(*(centres[batch.owners == chair, :2] - around).T).max() < 0.6
        np.testing.assert_allclose(np.linalg.norm(turns, axis=1), 1.0)
    assert all((batch.owners == STATIC).all() != batch.moves for batch in parts.batches)
    name, place = parts.hit((*around, 3.0), (0.0, 0.0, -1.0))
    assert name == world.mover_names[chair]
    assert place[2] > 0.2
    assert parts.hit((0.0, 0.0, 9.0), (0.0, 0.0, 1.0)) is None


def test_a_bag_is_shown_with_its_truth_and_labels(tmp_path):
    recipe = Recipe(scene="arena", dynamism=0.5, seed=3, seconds=0.4)
    record(recipe, tmp_path)
    (bag,) = tmp_path.iterdir()
    shown = list(Opener(slams=["odometry"], path=bag).open().run())
    assert len(shown) > 10
    assert shown[0].frame.labels is not None
    assert shown[-1].truth_map is not None
    assert shown[-1].error("odometry")[0] < 0.05


def test_what_one_did_oneself_stays_when_much_happens():
    session = Opener(slams=["odometry"], settings={"scene": "arena"}, seconds=1.0).open()
    moment, gui = next(session.run()), MagicMock()
    gui.add_html.side_effect = lambda content: SimpleNamespace(content=content)
    page = Page(gui, MagicMock(), Controls(), Inbox(), {"room": False, "slam": "odometry"})
    page.say("you: <chair> is pushed", own=True)
    for k in range(20):
        page.show(
            replace(moment, number=k, said=(f"door{k} moves",)),
            Playback(iter(()), playing=False),
            session,
        )
    assert "you: &lt;chair&gt; is pushed" in page._answers.content
    assert "door19 moves" in page._events.content
    assert "door9 " not in page._events.content


@pytest.mark.parametrize("bounds", [(0.0, 0.0, 20.0, 12.0), (-3.0, 5.0, 4.0, 30.0)])
@pytest.mark.parametrize("aspect", [0.46, 1.2, 1.7])
def test_a_room_fills_a_page_of_any_shape_and_nothing_of_it_is_cut(bounds, aspect):
    camera = SimpleNamespace()
    look_at(camera, bounds, aspect)
    at, to = np.array(camera.position), np.array(camera.look_at)
    ahead = (to - at) / np.linalg.norm(to - at)
    right = np.cross(ahead, (0.0, 0.0, 1.0)) / np.linalg.norm(ahead[:2])
    xmin, ymin, xmax, ymax = bounds
    corners = np.array([(x, y, z) for x in (xmin, xmax) for y in (ymin, ymax) for z in (0.0, 1.0)])
    local = (corners - at) @ np.stack([right, np.cross(right, ahead), ahead], axis=1)
    assert to[2] == pytest.approx(0.0)
    shares = np.abs(local[:, :2] / local[:, 2:]) / np.array([aspect, 1.0])
    assert shares.max() == pytest.approx(SPARE * math.tan(0.5 * camera.fov))

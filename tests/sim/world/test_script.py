# SPDX-License-Identifier: Apache-2.0
"""Events at stated times: they happen then, to what they name, and the same way each time."""

from pathlib import Path

import numpy as np
import pytest

from sim.events import EventWatch
from sim.moments import toured
from sim.recording.recipe import Recipe, read_recipe, write_recipe
from sim.simulation import Simulation
from sim.world.script import cues_of, read_events
from slam.errors import InvalidValueError, LogFormatError, UnknownNameError

SHED = """<mujoco><worldbody>
  <geom name="floor:shed" class="floor" size="3 2 0.1" material="floor_concrete"/>
  <geom name="wall:north" class="wall" pos="0 2.1 0.55" size="3.2 0.1 0.55"/>
  <site name="room:shed" type="box" size="3 2 0.01"/>
  <site name="start:robot" pos="-2 0 0"/> <site name="goal:end" pos="2 0 0"/>
</worldbody></mujoco>"""
ROWS = [
    {"at_s": 1.0, "push": "chair0", "towards_m": [2.0, 1.0]},
    {"at_s": 0.5, "enter": 2, "by": [2.0, 2.0]},
    {"at_s": 2.0, "carry": [3.0, -1.0], "heading_deg": 90.0},
]


def _simulation(**more: object) -> Simulation:
    settings = {"dynamism": 0.0, "motion": 0.2, "crowd": "none", "events": ROWS, **more}
    return Simulation("arena", seed=2, laser="tim561:noise", n_people=0, n_chairs=2, **settings)


def test_each_happens_at_its_time_and_the_same_way_again() -> None:
    simulation = _simulation()
    watch, seen, chairs = EventWatch(simulation.world), [], []
    row = simulation.world.mover_names.index("chair0")
    for moment in toured(simulation, 3.0):
        watch.note(moment)
        seen.append(moment)
        chairs.append(moment.poses[row])
    found = {event.kind: event.start_s for event in watch.events()}
    assert found["kidnap"] == pytest.approx(2.0, abs=0.1)
    guest = simulation.world.mover_names.index("visitor1")
    inside = [moment.poses[guest, 0] < 100.0 for moment in seen]
    assert inside.index(True) * simulation.scan_period_s == pytest.approx(0.5, abs=0.1)
    went = chairs[-1][:2] - chairs[0][:2]
    asked = np.array([2.0, 1.0]) - chairs[0][:2]
    assert np.hypot(*went) > 0.1
    assert went @ asked > 0.9 * np.hypot(*went) * np.hypot(*asked)
    again = list(toured(_simulation(), 3.0))
    assert all((a.poses == b.poses).all() for a, b in zip(seen, again, strict=True))


def test_a_saved_state_knows_what_has_happened() -> None:
    first, second = _simulation(), _simulation()
    for _ in range(20):
        first.observe()
    second.load_state(first.save_state())
    for _ in range(20):
        np.testing.assert_array_equal(first.observe().scan.ranges, second.observe().scan.ranges)


@pytest.mark.parametrize(
    ("row", "field"),
    [
        ({"push": "chair0"}, r"event 1\.at_s must be .*, got nothing"),
        ({"at_s": 1, "push": "chair0", "open": "door0"}, "event 1 must have one of"),
        ({"at_s": 1, "push": "chair0", "speed": 1}, "event 1: unknown key 'speed'; known: .*push"),
        ({"at_s": 1, "push": "chair0", "towards_m": [1]}, "towards_m must be"),
        ({"at_s": 1, "enter": 0, "by": "door0"}, "enter must be a whole number from 1 to 20"),
        ({"at_s": 1, "enter": 2}, "by must be"),
        ({"at_s": -1, "carry": ""}, "at_s must be a number from 0"),
    ],
)
def test_a_wrong_event_is_named_with_its_field(row: dict[str, object], field: str) -> None:
    with pytest.raises(InvalidValueError, match=field):
        cues_of([row])


def test_what_the_world_lacks_is_refused_before_anything_runs() -> None:
    with pytest.raises(UnknownNameError, match="no thing to push 'chair9' here"):
        _simulation(events=[{"at_s": 1, "push": "chair9"}])
    with pytest.raises(InvalidValueError, match="cannot be carried"):
        _simulation(events=[{"at_s": 1, "carry": [99, 0]}])


def test_a_file_and_a_recipe_hold_them(tmp_path: Path) -> None:
    path = tmp_path / "day.toml"
    path.write_text('[[event]]\nat_s = 4\ncarry = "east"\n')
    rows = read_events(path)
    recipe = Recipe(scene="arena", seed=1, dynamism=0.0, seconds=2.0, events=rows)
    write_recipe(tmp_path / "recipe.json", recipe, {})
    assert read_recipe(tmp_path / "recipe.json").recipe.sha256 == recipe.sha256
    assert "-events" in recipe.name
    path.write_text("[[event]]\nat_s = 4\n")
    with pytest.raises(LogFormatError, match="event 1 must have one of"):
        read_events(path)


def test_a_scenes_own_file_may_hold_events_and_a_robot(tmp_path: Path) -> None:
    (tmp_path / "shed.xml").write_text(SHED)
    path = tmp_path / "own.toml"
    text = 'plan = "shed.xml"\nrobot = "turtlebot3"\n'
    path.write_text(text + "[[event]]\nat_s = 0.2\nenter = 1\nby = [1.0, 0.5]\n")
    world = Simulation(str(path), seed=1, dynamism=0.0).world
    assert world.robot is not None
    assert (world.robot.name, world.people.names) == ("turtlebot3", ["visitor0"])

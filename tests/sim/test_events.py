# SPDX-License-Identifier: Apache-2.0
"""Events of a run: what was pushed, swung, came near, and when the robot was put elsewhere."""

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from scenes.scene import Mover
from sim.events import CHAIR, CHANGE, DOOR, KIDNAP, NEAR_M, PERSON, Event, EventWatch
from sim.moments import Moment, toured
from sim.simulation import Simulation
from slam.frames import BeamLabels, LaserSpec
from tests.world2d import frame_at

pytestmark = pytest.mark.slow
MOVERS = [("chair0", "chair_swivel", 0.3), ("door0", "door", 0.9), ("someone", "person_coat", 0.25),
          ("robot", "robot", 0.25)]  # fmt: skip
SPEC = LaserSpec(n_beams=2, angle_min=0.0, angle_increment=0.1)


def watch() -> EventWatch:
    movers = [Mover(name=n, kind=k, radius=r) for n, k, r in MOVERS]
    bodies = SimpleNamespace(mover_of_body=np.array([-1, 0, 1, 2, 3]))
    scene = SimpleNamespace(movers=movers, bounds=(0.0, 0.0, 9.0, 9.0))
    world: Any = SimpleNamespace(scene=scene, bodies=bodies, change=0.0)
    return EventWatch(world)


def moments(
    place: Callable[[float], tuple[float, float, float, float]], *, hit=(0, 0), n=100
) -> EventWatch:
    """A watch after ten seconds; ``place``: chair x, door angle, person x, robot x at t."""
    made, last = watch(), None
    for k in range(n):
        seconds, stamp = k * 0.1, k * 100_000_000
        chair, door, person, robot = place(seconds)
        poses = np.array([[chair, 5.0, 0], [8, 8, door], [person, 0, 0], [robot, 0, 0]], float)
        moving = np.zeros(4, bool) if last is None else (poses != last).any(axis=1)
        last = poses
        labels = BeamLabels(
            body=np.array(hit, np.int32), kind=np.ones(2, np.uint8), displacement=np.zeros(2),
            incidence=np.zeros(2), mixed=np.zeros(2, bool),
        )  # fmt: skip
        truth = np.array([robot, 0.0, 0.0])
        frame = frame_at(stamp, ranges=np.ones(2), spec=SPEC, truth=truth, labels=labels)
        made.note(Moment(frame=frame, poses=poses, moving=moving))
    return made


def test_a_push_is_one_event_from_start_to_rest():
    def place(t):
        return (min(max(t - 2.0, 0.0), 1.0), 0.0, 9.0, 0.0)

    (event,) = moments(place, hit=(0, 1)).events()
    assert (event.kind, event.name, event.seen) == (CHAIR, "chair0", True)
    assert event.start_s == pytest.approx(2.1)
    assert event.end_s == pytest.approx(3.0, abs=0.11)


def test_a_shiver_is_no_push_and_a_pause_no_end():
    assert moments(lambda t: (0.001 * t, 0.0, 9.0, 0.0)).events() == []

    def halting(t):
        return (0.1 * t if t < 2.0 or t > 2.3 else 0.2, 0.0, 9.0, 0.0)

    assert len(moments(halting).events()) == 1


def test_a_door_swings_and_nobody_sees_it():
    (event,) = moments(lambda t: (0.0, min(t, 1.0), 9.0, 0.0)).events()
    assert (event.kind, event.seen) == (DOOR, False)


def test_a_person_counts_while_near_whether_walking_or_not():
    def place(t):
        return (0.0, 0.0, NEAR_M - 0.1 if 3.0 <= t <= 6.0 else 5.0, 0.0)

    (event,) = moments(place).events()
    assert event.kind == PERSON
    assert (event.start_s, event.end_s) == (pytest.approx(3.0), pytest.approx(6.0))


def test_a_leap_of_the_truth_is_a_kidnap():
    def place(t):
        return (0.0, 0.0, 9.0, 0.0 if t < 5.0 else 3.0)

    events = moments(place).events()
    assert events == [Event(kind=KIDNAP, name="", start_s=5.0, end_s=5.0)]


def test_more_dynamism_is_more_events_and_none_of_it_is_none():
    counts = []
    for dynamism in (0.0, 1.0):
        simulation = Simulation("office", seed=3, dynamism=dynamism, change=0.0, labels=True)
        made = EventWatch(simulation.world)
        for moment in toured(simulation, 6.0):
            made.note(moment)
        pushed = [e for e in made.events() if e.kind in (CHAIR, DOOR)]
        counts.append(len(pushed))
        assert all(0.0 <= e.start_s <= e.end_s <= 6.0 for e in made.events())
    assert counts[0] == 0
    assert counts[1] > 3
    assert made.kinds == [CHAIR, DOOR, PERSON]


def test_what_is_put_elsewhere_out_of_sight_is_an_event_of_its_own_and_no_push():
    simulation = Simulation("arena", seed=1, dynamism=0.0, change=1.0, laser="lms221:noise")
    made, told = EventWatch(simulation.world), []
    assert made.kinds == [CHAIR, CHANGE]
    simulation.world.set_command(0.0, 1.5)
    for _ in range(240):
        poses, moving = simulation.world.mover_poses(), simulation.world.movers_moving()
        frame, rearranged = simulation.observe(), tuple(simulation.rearranged)
        told += [event.name for event in rearranged]
        made.note(Moment(frame=frame, poses=poses, moving=moving, rearranged=rearranged))
    assert told
    assert {e.kind for e in made.events()} == {CHANGE}
    assert sorted(e.name for e in made.events()) == sorted(told)

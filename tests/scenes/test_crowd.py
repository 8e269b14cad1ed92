# SPDX-License-Identifier: Apache-2.0
"""What a crowd may be called, where it is put, and that it leaves the rest of a scene alone."""

from dataclasses import fields

import numpy as np
import pytest

from scenes import build
from scenes.assembly import room_of
from scenes.crowd import BY_LEVEL, GROUP, OTHERS_BY_LEVEL, Crowd, crowd_of, mix
from scenes.kinds import kind_of
from scenes.scene import Scene
from sim.simulation import Simulation, tour
from slam.errors import InvalidValueError
from slam.frames import BeamClass
from tests.built_scenes import placed

MIXED = "escorts:4,boards:1,couches:1,cleaners:1,groups:4,queue:3"


@pytest.fixture(scope="module")
def pair() -> tuple[Scene, Scene]:
    """A classroom without and with a crowd."""
    return build("classroom", seed=3), build("classroom", seed=3, crowd=MIXED)


def test_a_crowd_reads_back_what_it_prints():
    crowd = crowd_of("escorts:6, boards:2")
    assert crowd == Crowd(escorts=6, boards=2)
    assert crowd_of(str(crowd)) == crowd
    assert not crowd_of("none")
    assert str(Crowd()) == "none"


@pytest.mark.parametrize(
    "text",
    ["dancers:3", "escorts", "escorts:", "escorts:-1", "escorts:1.5", "escorts:6,escorts:2",
     "escorts:81", "escorts:99999", "escorts:6;boards:2", 7, None],
)  # fmt: skip
def test_a_crowd_that_cannot_be_is_refused(text: object):
    with pytest.raises(InvalidValueError, match=r"(?i)crowd"):
        crowd_of(text)


def test_a_crowd_that_does_not_fit_is_refused():
    with pytest.raises(InvalidValueError, match="does not fit"):
        build("apartment", seed=1, crowd="beds:30")


def test_counts_grow_with_the_level():
    for scene in (*BY_LEVEL, "any other"):
        crowds = [mix(scene, level / 20) for level in range(21)]
        for kind in (field.name for field in fields(Crowd)):
            counts = [getattr(crowd, kind) for crowd in crowds]
            assert counts == sorted(counts), (scene, kind)
        assert all(crowd.groups % GROUP == 0 and crowd.queue != 1 for crowd in crowds), scene
        for k, crowd in enumerate(BY_LEVEL.get(scene, OTHERS_BY_LEVEL), 1):
            assert crowds[5 * k] == crowd, (scene, k)
        assert crowds[0] == Crowd()
        assert crowds[-1] == BY_LEVEL.get(scene, OTHERS_BY_LEVEL)[-1]
    assert mix("arena", 0.5) == BY_LEVEL["arena"][1]


def test_a_crowd_moves_nothing_else(pair: tuple[Scene, Scene]):
    without, crowded = pair
    assert {name: crowded.initial[name] for name in without.initial} == dict(without.initial)
    assert crowded.goals == without.goals
    assert crowded.door_angles == without.door_angles
    np.testing.assert_array_equal(crowded.obstacles, without.obstacles)
    np.testing.assert_array_equal(crowded.static_map.values, without.static_map.values)
    assert crowded.movers[-1].name == "robot"


def test_nobody_stands_in_somebody_else(pair: tuple[Scene, Scene]):
    before = {mover.name for mover in pair[0].movers}
    discs = []
    for mover in pair[1].movers:
        half, (x, y, yaw) = kind_of(mover.kind).half_length_m, pair[1].initial[mover.name]
        for at in (-half, 0.0, half) if half else (0.0,):
            place = (x + at * np.cos(yaw), y + at * np.sin(yaw))
            if mover.group != "door":
                discs.append((mover.name, *place, mover.radius))
    for name, x, y, r in discs:
        for other, ox, oy, other_r in discs:
            if name != other and not {name, other} <= before:
                assert np.hypot(x - ox, y - oy) > r + other_r, (name, other)


@pytest.mark.parametrize("crowd", ["beds:4", "couches:3"])
def test_no_corner_of_what_is_long_stands_in_a_wall(crowd: str):
    for seed in range(1, 9):
        scene = build("gallery", seed=seed, crowd=crowd)
        model, data = placed(scene)
        hull = [model.geom(g).name.partition("/")[2].startswith("hull") for g in range(model.ngeom)]
        deep = [float(c.dist) for c in data.contact if hull[c.geom[0]] or hull[c.geom[1]]]
        assert min(deep, default=0.0) >= 0.0, seed


def test_what_is_put_elsewhere_keeps_clear_of_corners_too():
    scene = build("gallery", seed=3, crowd="beds:1,boards:1")
    room = {m.name: room_of(m) for m in scene.movers}
    corners = np.array([(0.86, 0.33), (-0.86, -0.33)])
    assert room["bed0"] == pytest.approx(np.linalg.norm(corners, axis=1).max() + 0.13)
    assert all(room[m.name] == m.radius for m in scene.movers if m.name != "bed0")


@pytest.mark.parametrize("scene", ["arena", "corridor"])
def test_what_is_seen_of_a_crowd_grows_in_a_line_with_the_motion(scene: str):
    """The mean share of returns from what moves at that moment."""
    seen = []
    for motion in (0.5, 1.0):
        shares, stood = [], []
        for seed in (500, 501, 502):
            settings = {"seed": seed, "motion": motion, "dynamism": 0.0, "change": 0.0}
            laser = "scanner(fov_deg=180,beams=61,rate_hz=2.5,sigma_m=0.01)"
            simulation = Simulation(scene, laser=laser, labels=True, **settings)
            for frame in tour(simulation, 16.0):
                kinds = frame.labels.kind[frame.labels.kind >= BeamClass.STATIC]
                shares.append((kinds == BeamClass.MOVING).mean())
            walked_s, blocked_s = simulation.world.people.walked_s()
            stood.append(blocked_s.sum() / walked_s.sum())
        seen.append(np.mean(shares))
        assert np.mean(stood) < 0.15  # of their time people are in one another's way
    assert seen[1] > 0.3
    assert abs(seen[0] - 0.5 * seen[1]) < 0.2 * seen[1]

# SPDX-License-Identifier: Apache-2.0
"""The scanner's height is a parameter, and what the beam meets follows from it."""

import math
from functools import cache

import mujoco
import numpy as np
import pytest

import scenes
from scenes.scene import FOOT, LASER, Scene
from sim.sensors.lidar.models.lms221 import Lms221Config
from sim.simulation import Simulation
from sim.world.world import World
from slam.errors import InvalidValueError
from tests.built_scenes import built, placed

AWAY = 1.5  # m from the laser to the middle of the chair


@cache
def room_with(kind: str) -> Scene:
    """An arena whose only chair is of that kind."""
    rooms = (scenes.build("arena", seed, n_chairs=1) for seed in range(40))
    return next(room for room in rooms if room.movers[0].kind == kind)


def seen_of(kind: str, height: float) -> list[float]:
    """Widths in m of what ideal beams see of a chair, from right to left."""
    room = scenes.at_scan_height(room_with(kind), height)
    laser = Lms221Config.ideal(resolution_deg=0.25)
    simulation = Simulation(room, dynamism=0.0, laser=laser)  # type: ignore[arg-type]
    world = simulation.world
    for name, pose in (("chair0", (AWAY + 0.10, 0.05, 0.3)), ("robot", (0.0, 0.0, 0.0))):
        first = int(world.model.joint(f"{name}/x").qposadr[0])
        world.data.qpos[first : first + 3] = pose
    mujoco.mj_kinematics(world.model, world.data)
    ranges = simulation.observe().scan.ranges
    near = np.flatnonzero(ranges < AWAY + 0.6)
    groups = np.split(near, np.flatnonzero(np.diff(near) > 1) + 1)
    return [float(g.size * math.radians(0.25) * ranges[g].mean()) for g in groups]


@pytest.mark.parametrize(
    ("kind", "height", "number", "width"),
    [
        ("chair_swivel", 0.10, 1, 0.5),  # the arms of the star
        ("chair_swivel", 0.15, 1, 0.09),  # its hub
        ("chair_swivel", 0.36, 1, 0.06),  # the gas spring
        ("chair_swivel", 0.46, 1, 0.5),  # the edge of the seat
        ("chair_visitor", 0.15, 4, 0.024),  # legs
        ("chair_visitor", 0.36, 4, 0.024),
        ("chair_visitor", 0.46, 1, 0.46),  # the edge of the seat
    ],
)
def test_a_chair_shows_what_it_has_at_that_height(kind, height, number, width):
    seen = seen_of(kind, height)
    assert len(seen) == number
    assert seen == pytest.approx([width] * number, rel=0.1, abs=0.006)


@pytest.mark.parametrize(
    ("name", "height"), [("apartment", 0.15), ("apartment", 0.46), ("office", scenes.SCAN_HEIGHT)]
)
def test_laser_and_true_map_are_at_that_height(name, height):
    """The raster says occupied where a beam along the scan plane meets what never moves."""
    scene = scenes.build(name, 0, scan_height_m=height)
    model, data = placed(scene)
    assert data.site(LASER).xpos[2] == pytest.approx(height)
    raster = scene.static_map
    hit, groups = np.zeros(1, dtype=np.int32), np.array([1, 1, 0, 0, 0, 0], dtype=np.uint8)
    checked = 0
    for angle in np.linspace(-math.pi, math.pi, 300).tolist():
        start = np.array([*scene.start[:2], height])
        way = np.array([math.cos(angle), math.sin(angle), 0.0])
        far = mujoco.mj_ray(
            model, data, start, way, groups, 1, model.body("robot/base").id, hit, None
        )
        if far < 0 or model.body_weldid[model.geom_bodyid[hit[0]]] != 0:
            continue
        end = start + way * (far + 0.5 * raster.resolution_m)
        column, row = ((end[:2] - raster.T_map_origin[:2]) / raster.resolution_m).astype(int)
        assert raster.values[row - 1 : row + 2, column - 1 : column + 2].max() == 1.0
        checked += 1
    assert checked > 150
    usual = raster.values == built(name, 0).static_map.values
    assert usual.all() == (height == scenes.SCAN_HEIGHT)


def test_people_have_legs_at_every_height():
    for height in (0.06, 0.15, 0.36, 0.7):
        world = World("arena", seed=1, dynamism=0.0, n_chairs=0, n_people=2, scan_height_m=height)
        x, y, _ = world.mover_poses()[0].tolist()
        groups = np.array([0, 0, 1, 0, 0, 0], dtype=np.uint8)
        hit = np.zeros(1, dtype=np.int32)
        seen = set()
        for angle in np.linspace(-0.3, 0.3, 60).tolist():
            origin, way = np.array([x - 1.0, y, height]), np.array([1.0, math.tan(angle), 0.0])
            mujoco.mj_ray(world.model, world.data, origin, way, groups, 1, -1, hit, None)
            if hit[0] >= 0:
                seen.add(world.model.body(world.model.geom_bodyid[hit[0]]).name)
        assert any("shank" in name or "thigh" in name for name in seen), height


def test_the_given_scene_stays_as_it_is_and_the_usual_height_costs_nothing():
    scene = built("arena", 0)
    before = scene.spec.site(LASER).pos.copy(), scene.spec.geom(FOOT).size.copy()
    high = scenes.at_scan_height(scene, 0.5)
    assert scenes.at_scan_height(scene, scenes.SCAN_HEIGHT) is scene
    np.testing.assert_array_equal(scene.spec.site(LASER).pos, before[0])
    np.testing.assert_array_equal(scene.spec.geom(FOOT).size, before[1])
    back = scenes.at_scan_height(high, scenes.SCAN_HEIGHT)
    assert back.spec.geom(FOOT).pos == pytest.approx(scene.spec.geom(FOOT).pos)
    foot = high.spec.geom(FOOT)  # still stands on the deck
    assert foot.pos[2] - foot.size[2] == pytest.approx(scene.spec.geom(FOOT).pos[2] - before[1][2])
    assert high.initial == scene.initial


@pytest.mark.parametrize("value", [0.0, 1.2, -0.3, math.nan, math.inf, True, "low", None])
def test_heights_that_cannot_be_are_refused(value):
    with pytest.raises(InvalidValueError, match="scan_height_m"):
        scenes.build("arena", 0, scan_height_m=value)


def test_a_mesh_is_refused_only_where_the_scan_plane_meets_it():
    spec = built("arena", 0).spec.copy()
    corners = [x for k in range(8) for x in (k & 1, k >> 1 & 1, k >> 2)]
    spec.add_mesh(name="box", uservert=[0.1 * x for x in corners])
    spec.worldbody.add_geom(
        name="statue", type=mujoco.mjtGeom.mjGEOM_MESH, meshname="box", pos=[0, 3, 0], group=1
    )
    scene = Scene(**{**vars(built("arena", 0)), "spec": spec})
    for height in (0.5, 0.05):
        room = scenes.at_scan_height(scene, height)
        if height == 0.5:
            Simulation(room, laser=Lms221Config.ideal(), dynamism=0.0)
            continue
        with pytest.raises(InvalidValueError, match=r"'statue' is a mesh at the height.*0\.05 m"):
            Simulation(room, laser=Lms221Config.ideal(), dynamism=0.0)
        with pytest.raises(InvalidValueError, match="mesh"):
            _ = room.static_map


def test_the_height_is_said_in_recordings_and_kept_in_states():
    low, usual = (Simulation("arena", n_chairs=2, scan_height_m=h) for h in (0.15, 0.36))
    assert low.metadata().extra["scan_height_m"] == 0.15
    with pytest.raises(InvalidValueError, match="scan_height_m"):
        usual.load_state(low.save_state())

# SPDX-License-Identifier: Apache-2.0
"""What one scene promises and no other."""

import math

import mujoco
import numpy as np
import pytest

import scenes
from slam.errors import InvalidValueError
from tests.built_scenes import built, placed, reached

pytestmark = pytest.mark.slow


@pytest.mark.parametrize("walls", ["visible", "none"])
def test_walls_nobody_sees_still_hold_the_chairs(walls):
    scene = scenes.build("arena", 4, walls=walls)
    model, data = placed(scene)
    groups = np.array([1, 1, 1, 0, 1, 1], dtype=np.uint8)  # what a scanner meets
    hit, seen = np.zeros(1, dtype=np.int32), set()
    robot = model.body("robot/base").id
    for angle in np.linspace(0.0, math.tau, 200).tolist():
        way = np.array([math.cos(angle), math.sin(angle), 0.0])
        point = np.array([*scene.start[:2], scenes.SCAN_HEIGHT])
        mujoco.mj_ray(model, data, point, way, groups, 1, robot, hit, None)
        seen.add("" if hit[0] < 0 else model.geom(int(hit[0])).name.partition(":")[0])
    assert ("wall" in seen) == (walls == "visible")
    assert (scene.static_map.values.max() == 1.0) == (walls == "visible")
    chair = int(model.joint("chair0/x").dofadr[0])
    for _ in range(1500):
        data.qfrc_applied[chair] = 60.0
        mujoco.mj_step(model, data)
    assert data.body("chair0/base").xpos[0] < 5.0
    assert data.body("chair0/base").xpos[0] > 4.5


@pytest.mark.parametrize(("name", "under"), [("chair0", False), ("bin0", True), ("robot", True)])
def test_what_has_a_back_stays_out_from_under_a_desk(name, under):
    """Shoved at a desk's user side: a chair's back would stick through the top."""
    scene = scenes.build("office", 1, n_chairs=3, n_people=0)
    model, data = placed(scene)
    desk = model.body("desk0/base").id
    mujoco.mj_kinematics(model, data)
    to_desk = data.xmat[desk].reshape(3, 3)[:, 1]  # its user sits at -y
    start = data.xpos[desk][:2] - 1.0 * to_desk[:2] - 0.2 * data.xmat[desk].reshape(3, 3)[:2, 0]
    x = int(model.joint(f"{name}/x").qposadr[0])
    dof = int(model.joint(f"{name}/x").dofadr[0])
    data.qpos[x : x + 2] = start
    data.qvel[dof : dof + 2] = 1.5 * to_desk[:2]
    nearest, force = math.inf, {"chair0": 25.0, "bin0": 4.0, "robot": 250.0}[name]
    for _ in range(600):
        data.qfrc_applied[dof : dof + 2] = force * to_desk[:2]
        mujoco.mj_step(model, data)
        offset = data.qpos[x : x + 2] - data.xpos[desk][:2]
        nearest = min(nearest, float(-offset @ to_desk[:2]))
    edge, radius = 0.40, next(m.radius for m in scene.movers if m.name == name)
    assert (nearest < edge) == under
    assert under or nearest > edge + radius - 0.02


def test_glass_stands_where_it_is_asked_for_and_is_on_the_true_map():
    for name, place in (("office", (3.6, 3.0)), ("classroom", (-4.4, -2.4))):
        solid, glass = (scenes.build(name, 0, glass=glass) for glass in (False, True))
        panes = [geom for geom in glass.spec.geoms if geom.name.startswith("glass:")]
        assert panes
        assert all(geom.material == "glass" for geom in panes)
        assert not [geom for geom in solid.spec.geoms if geom.name.startswith("glass:")]
        raster = glass.static_map
        cell = ((np.array(place) - raster.T_map_origin[:2]) / raster.resolution_m).astype(int)
        assert raster.values[cell[1] - 1 : cell[1] + 2, cell[0] - 1 : cell[0] + 2].max() == 1.0
        assert glass.initial == solid.initial


@pytest.mark.parametrize("name", ["office", "classroom", "apartment", "random-rooms"])
def test_doors_rest_as_asked_for(name):
    rests = {d: scenes.build(name, 3, doors=d).door_angles for d in ("open", "ajar", "closed")}
    assert rests["open"] == built(name, 3).door_angles
    assert all(1.2 < angle < 1.8 for angle in rests["open"].values())
    assert all(0.2 < angle < 1.0 for angle in rests["ajar"].values())
    assert set(rests["closed"].values()) == {0.0}
    rooms = [scenes.build(name, seed, doors="mixed") for seed in range(4)]
    mixed = [angle for room in rooms for angle in room.door_angles.values()]
    assert min(mixed) == 0.0
    assert max(mixed) > 1.2
    with pytest.raises(InvalidValueError, match="doors must be one of"):
        scenes.build(name, 3, doors="revolving")


def test_a_closed_door_stays_shut_by_its_closer():
    scene = scenes.build("office", 0, n_people=0, n_chairs=0, doors="closed")
    model, data = placed(scene)
    door = int(model.joint("door0/hinge").qposadr[0])
    data.qpos[door] = 1.0
    for _ in range(3000):
        mujoco.mj_step(model, data)
    assert abs(data.qpos[door]) < 0.01
    assert abs(data.qvel[model.joint("door0/hinge").dofadr[0]]) < 1e-3


def test_a_corridor_looks_the_same_all_along_its_middle():
    raster = built("corridor", 0).static_map
    along = np.arange(-17.0, 17.0, 0.02) - raster.T_map_origin[0]
    middle = raster.values[:, (along / raster.resolution_m).astype(int)]
    low, high = (round((y - raster.T_map_origin[1]) / raster.resolution_m) for y in (-1.3, 1.3))
    assert (middle[low:high] == middle[low:high, :1]).all()


def test_the_classrooms_are_twins():
    """What stands in one stands in the other, 9.16 m on."""
    boxes = built("classroom", 0).obstacles
    boxes = boxes[(boxes[:, 1] > -2.0) & (boxes[:, 2:4].max(axis=1) < 1.0)]
    left, right = boxes[boxes[:, 0] < 0.0], boxes[boxes[:, 0] > 0.0]
    assert len(left) >= 20
    shifted = _sorted(left + np.array([9.16, 0.0, 0.0, 0.0, 0.0]))
    np.testing.assert_allclose(shifted, _sorted(right), atol=1e-6)


def _sorted(rows: np.ndarray) -> np.ndarray:
    rounded = np.round(rows, 6)
    return rounded[np.lexsort(rounded.T)]


def test_a_warehouse_has_what_was_asked_for_and_it_can_be_moved():
    scene = scenes.build("warehouse", 2, n_trolleys=3, n_pallets=5)
    kinds = [m.kind for m in scene.movers]
    assert (kinds.count("trolley"), kinds.count("pallet")) == (3, 5)
    model, data = placed(scene)
    for name, force in (("trolley0", 60.0), ("pallet0", 200.0)):
        start = data.qpos[model.joint(f"{name}/x").qposadr[0]]
        dof = model.joint(f"{name}/x").dofadr[0]
        for step in range(300):
            data.qfrc_applied[dof] = force * (step < 60)
            mujoco.mj_step(model, data)
        moved = data.qpos[model.joint(f"{name}/x").qposadr[0]] - start
        assert 0.02 < moved < 3.0
        assert abs(data.qvel[dof]) < 0.5


class TestRandomRooms:
    @pytest.mark.parametrize("seed", range(50))
    def test_all_rooms_are_joined(self, seed):
        options = ({}, {"n_rooms": 9, "clutter": 1.0}, {"size_m": 9.0, "n_rooms": 3})[seed % 3]
        scene = scenes.build("random-rooms", seed, n_people=0, **options)
        assert len(scene.rooms) == options.get("n_rooms", 6)
        assert reached(scene) == set(scene.goals)

    def test_another_seed_is_another_floor_plan_and_one_seed_is_one(self):
        a, b, c = (scenes.build("random-rooms", seed) for seed in (1, 2, 1))
        assert set(a.rooms.values()) != set(b.rooms.values())
        assert a.rooms == c.rooms

    def test_clutter_is_what_stands_about(self):
        few, many = (scenes.build("random-rooms", 5, clutter=c) for c in (0.0, 1.0))
        assert len(few.obstacles) + 15 < len(many.obstacles)
        assert len(few.movers) < len(many.movers)

    def test_one_room_needs_no_door(self):
        scene = scenes.build("random-rooms", 0, n_rooms=1, size_m=6)
        assert not scene.door_angles
        assert len(scene.rooms) == 1

    @pytest.mark.parametrize(
        "options",
        [
            {"size_m": 3.0},
            {"size_m": "big"},
            {"clutter": 1.5},
            {"clutter": True},
            {"n_rooms": -1},
            {"n_rooms": 40},
            {"size_m": math.nan},
        ],
    )
    def test_what_cannot_be_is_refused_by_name(self, options):
        with pytest.raises(InvalidValueError, match=next(iter(options))):
            scenes.build("random-rooms", 0, **options)

# SPDX-License-Identifier: Apache-2.0
"""What every scene promises, whatever its seed."""

from __future__ import annotations

import math
from functools import cache
from itertools import combinations

import cv2
import mujoco
import numpy as np
import pytest

import scenes
from scenes.placement import gap_to_boxes
from scenes.scene import Scene
from slam.errors import InvalidValueError, UnknownNameError

NAMES = ("arena", "office")
SEEDS = range(20)
ROBOT_RADIUS = 0.3
GOAL_TO_DOOR = 1.2


@cache
def built(name: str, seed: int) -> Scene:
    return scenes.build(name, seed)


@cache
def model_of(name: str) -> mujoco.MjModel:
    return built(name, 0).compile()


def test_the_registry_knows_both_scenes():
    assert set(NAMES) <= set(scenes.names())


@pytest.mark.parametrize("name", NAMES)
class TestTheModel:
    def test_every_body_joint_and_actuator_has_a_name(self, name):
        model = model_of(name)
        assert all(model.body(i).name for i in range(model.nbody))
        assert all(model.joint(i).name for i in range(model.njnt))
        assert all(model.actuator(i).name for i in range(model.nu))

    def test_the_three_cameras_are_there_and_the_top_one_sees_all_of_the_floor(self, name):
        model = model_of(name)
        assert {model.camera(i).name for i in range(model.ncam)} == {"top", "follow", "persp"}
        top = model.camera("top")
        xmin, ymin, xmax, ymax = built(name, 0).bounds
        assert model.cam_projection[top.id] == mujoco.mjtProjection.mjPROJ_ORTHOGRAPHIC
        assert top.fovy[0] >= ymax - ymin
        assert top.fovy[0] * 16 / 9 >= xmax - xmin

    def test_the_follow_camera_rides_on_the_robot(self, name):
        model = model_of(name)
        body = int(model.camera("follow").bodyid[0])
        assert model.body(body).name == "robot/base"

    def test_only_primitives_are_used(self, name):
        kinds = {mujoco.mjtGeom(kind) for kind in model_of(name).geom_type}
        allowed = ("PLANE", "SPHERE", "CAPSULE", "ELLIPSOID", "CYLINDER", "BOX")
        assert {kind.name.removeprefix("mjGEOM_") for kind in kinds} <= set(allowed)

    def test_the_laser_is_at_the_scan_height_ahead_of_the_axle(self, name):
        model = model_of(name)
        data = mujoco.MjData(model)
        mujoco.mj_kinematics(model, data)
        laser, axle = data.site("robot/laser").xpos, data.site("robot/axle").xpos
        assert laser[2] == pytest.approx(scenes.SCAN_HEIGHT)
        assert laser[0] > axle[0]
        assert data.site("robot/wl").xpos[1] - data.site("robot/wr").xpos[1] == pytest.approx(0.33)

    def test_planar_joints_hold_the_world_pose(self, name):
        scene, model = built(name, 0), model_of(name)
        data = mujoco.MjData(model)
        scene.place(model, data)
        mujoco.mj_kinematics(model, data)
        for mover in scene.movers:
            if mover.kind == "door":
                continue
            x, y, yaw = scene.initial[mover.name]
            body = data.body(f"{mover.name}/base")
            assert body.xpos[:2] == pytest.approx([x, y])
            assert math.remainder(
                math.atan2(body.xmat[3], body.xmat[0]) - yaw, math.tau
            ) == pytest.approx(0.0, abs=1e-9)

    def test_nothing_moves_by_itself(self, name):
        scene, model = built(name, 0), model_of(name)
        data = mujoco.MjData(model)
        scene.place(model, data)
        before = data.qpos.copy()
        for _ in range(300):
            mujoco.mj_step(model, data)
        assert np.abs(data.qpos - before).max() < 1e-6
        assert data.ncon == 0

    def test_a_material_exists_once_however_many_parts_use_it(self, name):
        materials = [m.name for m in built(name, 0).spec.materials]
        assert len(materials) == len(set(materials))
        assert not any("/" in material for material in materials)

    def test_hulls_are_in_their_group_and_seen_geoms_do_not_collide(self, name):
        model = model_of(name)
        for geom in range(model.ngeom):
            hull = model.geom(geom).name.endswith("/hull")
            assert hull == (model.geom_group[geom] == 3)
            if model.geom_group[geom] == 2:
                assert model.geom_contype[geom] == model.geom_conaffinity[geom] == 0


@pytest.mark.parametrize("name", NAMES)
class TestLayouts:
    @pytest.mark.parametrize("seed", SEEDS)
    def test_nothing_overlaps_at_the_start(self, name, seed):
        scene = built(name, seed)
        discs = [(*scene.initial[m.name][:2], m.radius) for m in scene.movers if m.kind != "door"]
        for (x, y, r), (u, v, s) in combinations(discs, 2):
            assert math.hypot(x - u, y - v) > r + s
        places = np.array([disc[:2] for disc in discs])
        gaps = gap_to_boxes(places, scene.obstacles)
        assert (gaps >= [disc[2] - 1e-9 for disc in discs]).all()

    @pytest.mark.parametrize("seed", [0, 7, 19])
    def test_the_engine_sees_no_contact_at_the_start(self, name, seed):
        scene = built(name, seed)
        model = scene.compile()
        data = mujoco.MjData(model)
        scene.place(model, data)
        mujoco.mj_forward(model, data)
        assert data.ncon == 0

    def test_the_seed_and_only_the_seed_decides_a_scene(self, name):
        same, again, other = (scenes.build(name, seed) for seed in (7, 7, 8))
        assert same.initial == again.initial
        assert _bytes(same) == _bytes(again)
        np.testing.assert_array_equal(same.static_map.values, again.static_map.values)
        assert same.initial != other.initial
        assert _bytes(same) != _bytes(other)

    def test_one_more_person_moves_no_chair(self, name):
        few, more = (scenes.build(name, 3, n_people=n) for n in (1, 5))
        chairs = [m.name for m in few.movers if m.kind.startswith("chair")]
        assert chairs
        assert all(few.initial[chair] == more.initial[chair] for chair in chairs)

    @pytest.mark.parametrize("seed", range(5))
    def test_every_goal_can_be_reached_and_is_clear_of_doors(self, name, seed):
        scene = built(name, seed)
        assert _reached(scene) == set(scene.goals)
        for x, y in scene.goals.values():
            for door in scene.door_angles:
                hinge = scene.initial[door]
                assert math.hypot(x - hinge[0], y - hinge[1]) > GOAL_TO_DOOR

    def test_the_true_map_is_closed_by_walls(self, name):
        """A flood from the start never leaves the floor."""
        raster = built(name, 0).static_map
        free = (raster.values < 0.5).astype(np.uint8)
        mask = np.zeros((free.shape[0] + 2, free.shape[1] + 2), np.uint8)
        start = built(name, 0).start
        cell = ((np.array(start[:2]) - raster.T_map_origin[:2]) / raster.resolution_m).astype(int)
        cv2.floodFill(free, mask, (int(cell[0]), int(cell[1])), 2)
        rim = np.concatenate([free[0], free[-1], free[:, 0], free[:, -1]])
        assert not (rim == 2).any()


def _bytes(scene: Scene) -> bytes:
    """The compiled model as MuJoCo would save it."""
    model = scene.compile()
    buffer = np.zeros(mujoco.mj_sizeModel(model), dtype=np.uint8)
    mujoco.mj_saveModel(model, None, buffer)
    return buffer.tobytes()


def _reached(scene: Scene) -> set[str]:
    """Goals in the same free region as the start for a disc of the robot's size."""
    xmin, ymin, xmax, ymax = scene.bounds
    step = 0.05
    x, y = np.meshgrid(np.arange(xmin, xmax, step), np.arange(ymin, ymax, step))
    points = np.stack([x.ravel(), y.ravel()], axis=1)
    gaps = gap_to_boxes(points, scene.obstacles).reshape(x.shape)
    _, labels = cv2.connectedComponents((gaps > ROBOT_RADIUS).astype(np.uint8))

    def label(px: float, py: float) -> int:
        return int(labels[round((py - ymin) / step), round((px - xmin) / step)])

    home = label(*scene.start[:2])
    assert home != 0
    return {goal for goal, place in scene.goals.items() if label(*place) == home}


def test_the_true_map_agrees_with_rays():
    """The static raster says occupied where a vertical look along the scan plane meets a geom."""
    scene, model = built("office", 0), model_of("office")
    data = mujoco.MjData(model)
    scene.place(model, data)
    mujoco.mj_kinematics(model, data)
    raster = scene.static_map
    groups = np.array([1, 1, 0, 0, 0, 0], dtype=np.uint8)
    hit = np.zeros(1, dtype=np.int32)
    rng = np.random.default_rng(0)
    checked = 0
    for angle in rng.uniform(-math.pi, math.pi, 400).tolist():
        start = np.array([scene.start[0] + 0.5, scene.start[1], scenes.SCAN_HEIGHT])
        way = np.array([math.cos(angle), math.sin(angle), 0.0])
        robot = model.body("robot/base").id
        distance = mujoco.mj_ray(model, data, start, way, groups, 1, robot, hit, None)
        if distance < 0 or model.body_weldid[model.geom_bodyid[hit[0]]] != 0:
            continue
        end = start + way * (distance + 0.5 * raster.resolution_m)
        cell = (end[:2] - raster.T_map_origin[:2]) / raster.resolution_m
        column, row = int(cell[0]), int(cell[1])
        assert raster.values[row - 1 : row + 2, column - 1 : column + 2].max() == 1.0
        checked += 1
    assert checked > 200


def test_arena_has_only_chairs_by_default():
    kinds = [m.kind for m in built("arena", 0).movers]
    assert len([kind for kind in kinds if kind.startswith("chair")]) == 16
    assert {kind for kind in kinds if not kind.startswith("chair")} == {"robot"}


def test_office_has_rooms_doors_people_and_both_kinds_of_chairs():
    scene = built("office", 0)
    kinds = [m.kind for m in scene.movers]
    assert len(scene.rooms) == 8
    assert kinds.count("door") == 7
    assert kinds.count("person") == 6
    assert kinds.count("chair_swivel") + kinds.count("chair_visitor") == 24
    assert min(kinds.count("chair_swivel"), kinds.count("chair_visitor")) >= 5


@pytest.mark.parametrize("name", NAMES)
def test_counts_may_be_zero_or_many(name):
    empty = scenes.build(name, 1, n_chairs=0, n_people=0)
    assert not [m for m in empty.movers if m.kind.startswith("chair") or m.kind == "person"]
    full = scenes.build(name, 1, n_chairs=40, n_people=8)
    kinds = [m.kind for m in full.movers]
    assert sum(kind.startswith("chair") for kind in kinds) == 40
    assert kinds.count("person") == 8
    full.compile()


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("option", ["n_chairs", "n_people"])
@pytest.mark.parametrize("value", [-1, 1.5, True, "3", 100_000])
def test_counts_that_cannot_be_are_refused_by_name(name, option, value):
    with pytest.raises(InvalidValueError, match=option):
        scenes.build(name, 0, **{option: value})


def test_what_does_not_fit_is_refused():
    with pytest.raises(InvalidValueError, match="n_chairs = 400 does not fit"):
        scenes.build("arena", 0, n_chairs=400)


@pytest.mark.parametrize("seed", [-1, 1.5, True, "a"])
def test_seeds_that_cannot_be_are_refused(seed):
    with pytest.raises(InvalidValueError, match="seed"):
        scenes.build("arena", seed)


def test_an_unknown_option_is_refused():
    with pytest.raises(InvalidValueError, match="n_dogs"):
        scenes.build("arena", 0, n_dogs=1)


def test_an_unknown_scene_names_the_nearest():
    with pytest.raises(UnknownNameError, match="Did you mean 'office'"):
        scenes.build("ofice")


def test_a_recipe_can_be_named_by_module_and_function():
    assert scenes.build("scenes.arena:arena", 2).initial == built("arena", 2).initial
    for entry in ("no_such_module:f", "scenes.arena:nothing", ":"):
        with pytest.raises(UnknownNameError):
            scenes.build(entry)

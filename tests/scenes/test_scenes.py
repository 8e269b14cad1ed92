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

NAMES = tuple(scenes.names())
SEEDS = range(6)
ROBOT_RADIUS = 0.3
DEG = math.pi / 180.0
GOAL_TO_DOOR = 1.2


@cache
def built(name: str, seed: int) -> Scene:
    return scenes.build(name, seed)


@cache
def model_of(name: str) -> mujoco.MjModel:
    return built(name, 0).compile()


def test_the_registry_knows_all_scenes():
    assert set(NAMES) == {
        "apartment",
        "arena",
        "classroom",
        "corridor",
        "office",
        "random-rooms",
        "warehouse",
    }


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
        assert _in_view(model, "persp", built(name, 0).bounds)

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

    @pytest.mark.parametrize("seed", [0, 5])
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

    @pytest.mark.parametrize("seed", range(3))
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


def _in_view(model: mujoco.MjModel, camera: str, bounds: tuple[float, ...]) -> bool:
    """Whether a 16:9 picture shows the whole floor."""
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    number = model.camera(camera).id
    axes, high = data.cam_xmat[number].reshape(3, 3), math.tan(0.5 * model.cam_fovy[number] * DEG)
    corners = [[x, y, 0.0] for x in bounds[::2] for y in bounds[1::2]]
    right, up, back = ((np.array(corners) - data.cam_xpos[number]) @ axes).T
    return bool((back < 0).all() and (abs(up / back) <= high * 1.001).all()) and bool(
        (abs(right / back) <= high * 16 / 9 * 1.001).all()
    )


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


@pytest.mark.parametrize("walls", ["visible", "none"])
def test_walls_nobody_sees_still_hold_the_chairs(walls):
    scene = scenes.build("arena", 4, walls=walls)
    model = scene.compile()
    data = mujoco.MjData(model)
    scene.place(model, data)
    mujoco.mj_forward(model, data)
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
    model = scene.compile()
    data = mujoco.MjData(model)
    scene.place(model, data)
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
        assert _reached(scene) == set(scene.goals)

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


@pytest.mark.parametrize(
    ("name", "options"),
    [("arena", {"walls": "paper"}), ("office", {"glass": 1}), ("classroom", {"glass": "yes"})],
)
def test_words_and_switches_that_cannot_be_are_refused(name, options):
    with pytest.raises(InvalidValueError, match=next(iter(options))):
        scenes.build(name, 0, **options)


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


PLUGIN = '''
from pathlib import Path

from scenes.builder import Builder
from scenes.plan import Plan
from scenes.recipe import Draws, finish, free_floor, scatter, seat_chairs

HERE = Path(__file__).parent


def shed(seed, *, n_chairs=2):
    """A shed."""
    plan = Plan(str(HERE / "shed.xml"), floors=["floor_concrete"])
    plan.floor("shed", (0.0, 0.0), (3.0, 2.0), "floor_concrete")
    for name, pos, half in (("n", (0, 2.1), (3.2, 0.1)), ("s", (0, -2.1), (3.2, 0.1)),
                            ("w", (-3.1, 0), (0.1, 2.2)), ("e", (3.1, 0), (0.1, 2.2))):
        plan.wall(name, pos, half)
    plan.mark("room:shed", (0.0, 0.0, 0.0), (3.0, 2.0))
    plan.mark("start:robot", (-2.0, 0.0, 0.0))
    plan.mark("goal:end", (2.0, 0.0, 0.0))
    plan.furnish(str(HERE / "crate.xml"), (0.0, 1.5, 0.0))
    plan.furnish("cabinet", (2.0, 1.75, 0.0))
    builder = Builder(plan.finish())
    draws = Draws(seed)
    seat_chairs(builder, free_floor(builder), plan.seats, n_chairs, draws)
    return finish(builder, "shed", seed, {"n_chairs": n_chairs})
'''
CRATE = """<mujoco model="crate"><worldbody><body name="base">
  <geom type="box" size="0.3 0.3 0.3" pos="0 0 0.3" material="wood_pallet" group="1"/>
  <site name="footprint" type="box" size="0.3 0.3 0.3" pos="0 0 0.3"/>
</body></worldbody></mujoco>"""


def test_a_scene_of_ones_own_needs_no_change_here(tmp_path, monkeypatch):
    plans = scenes.plan.file_of("plans", "blank").parent
    (tmp_path / "my_pkg").mkdir()
    (tmp_path / "my_pkg/__init__.py").write_text(PLUGIN)
    (tmp_path / "my_pkg/crate.xml").write_text(CRATE)
    blank = (plans / "blank.xml").read_text()
    blank = blank.replace("../parts/common.xml", str(plans.parent / "parts/common.xml"))
    blank = blank.replace('"world.xml"', f'"{plans / "world.xml"}"')
    (tmp_path / "my_pkg/shed.xml").write_text(blank)
    monkeypatch.syspath_prepend(tmp_path)
    scene = scenes.build("my_pkg:shed", 3, n_chairs=3)
    assert [m.kind for m in scene.movers].count("robot") == 1
    assert len(scene.movers) == 4
    model = scene.compile()
    assert model.body("crate0/base").id > 0
    assert {model.camera(i).name for i in range(model.ncam)} == {"top", "follow", "persp"}
    with pytest.raises(InvalidValueError, match="n_dogs"):
        scenes.build("my_pkg:shed", 3, n_dogs=1)


def test_a_recipe_can_be_named_by_module_and_function():
    assert scenes.build("scenes.arena:arena", 2).initial == built("arena", 2).initial
    for entry in ("no_such_module:f", "scenes.arena:nothing", ":"):
        with pytest.raises(UnknownNameError):
            scenes.build(entry)

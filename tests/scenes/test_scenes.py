# SPDX-License-Identifier: Apache-2.0
"""What every scene promises, whatever its seed."""

import math
from itertools import combinations
from pathlib import Path

import cv2
import mujoco
import numpy as np
import pytest

import scenes
from scenes.placement import gap_to_boxes
from tests.built_scenes import NAMES, built, in_view, model_bytes, model_of, placed, reached

SEEDS = range(6)
GOAL_TO_DOOR = 1.2
HULLS = ("hull", "hull1", "hull2")


def test_the_documentation_shows_every_scene():
    docs = Path(__file__).parents[2] / "docs"
    text = (docs / "scenes.md").read_text()
    for name in NAMES:
        assert f"\n## {name}\n" in text
        assert f"pictures/scene_{name}.png" in text
        assert (docs / f"pictures/scene_{name}.png").stat().st_size <= 250_000


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
        assert in_view(model, "persp", built(name, 0).bounds)
        assert model.body(int(model.camera("follow").bodyid[0])).name == "robot/base"

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
            if mover.group == "door":
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
            title = model.geom(geom).name
            hull = title.partition("/")[2] in HULLS or title.startswith("apron:")
            assert hull == (model.geom_group[geom] == 3)
            if model.geom_group[geom] == 2:
                assert model.geom_contype[geom] == model.geom_conaffinity[geom] == 0


@pytest.mark.parametrize("name", NAMES)
class TestLayouts:
    @pytest.mark.parametrize("seed", SEEDS)
    def test_nothing_overlaps_at_the_start(self, name, seed):
        scene = built(name, seed)
        discs = [(*scene.initial[m.name][:2], m.radius) for m in scene.movers if m.group != "door"]
        for (x, y, r), (u, v, s) in combinations(discs, 2):
            assert math.hypot(x - u, y - v) > r + s
        places = np.array([disc[:2] for disc in discs])
        gaps = gap_to_boxes(places, scene.obstacles)
        assert (gaps >= [disc[2] - 1e-9 for disc in discs]).all()

    @pytest.mark.parametrize("seed", [0, 5])
    def test_the_engine_sees_no_contact_at_the_start(self, name, seed):
        assert placed(built(name, seed))[1].ncon == 0

    def test_the_seed_and_only_the_seed_decides_a_scene(self, name):
        same, again, other = (scenes.build(name, seed) for seed in (7, 7, 8))
        assert same.initial == again.initial
        assert model_bytes(same) == model_bytes(again)
        np.testing.assert_array_equal(same.static_map.values, again.static_map.values)
        assert same.initial != other.initial
        assert model_bytes(same) != model_bytes(other)

    def test_one_more_person_moves_no_chair(self, name):
        few, more = (scenes.build(name, 3, n_people=n) for n in (1, 5))
        chairs = [m.name for m in few.movers if m.kind.startswith("chair")]
        assert chairs
        assert all(few.initial[chair] == more.initial[chair] for chair in chairs)

    @pytest.mark.parametrize("seed", range(3))
    def test_every_goal_can_be_reached_and_is_clear_of_doors(self, name, seed):
        scene = built(name, seed)
        assert reached(scene) == set(scene.goals)
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


@pytest.mark.parametrize("name", NAMES)
def test_counts_may_be_zero_or_many(name):
    empty = scenes.build(name, 1, n_chairs=0, n_people=0)
    assert not [m for m in empty.movers if m.kind.startswith("chair") or m.kind == "person"]
    full = scenes.build(name, 1, n_chairs=40, n_people=8)
    kinds = [m.kind for m in full.movers]
    assert sum(kind.startswith("chair") for kind in kinds) == 40
    assert kinds.count("person") == 8
    full.compile()

# SPDX-License-Identifier: Apache-2.0
"""Parts open alone, and painted floors tile."""

import math
from pathlib import Path

import mujoco
import numpy as np
import pytest

import scenes.assembly
from scenes.kinds import KINDS
from scenes.placement import Floor, gap_to_boxes
from tests.built_scenes import placed

PARTS = sorted((Path(scenes.assembly.__file__).parent / "parts").glob("*.xml"))
PLANAR = ("chair_swivel", "chair_visitor", "bin", "trolley", "pallet", "person", "robot")
LONG = sorted(name for name, row in KINDS.items() if row.half_length_m)


@pytest.mark.parametrize("path", PARTS, ids=lambda path: path.stem)
def test_a_part_is_a_model_of_its_own(path):
    model = mujoco.MjModel.from_xml_path(str(path))
    assert 'angle="radian"' in (path.parent / "common.xml").read_text()
    assert path.stem == "common" or 'include file="common.xml"' in path.read_text()
    for body in range(1, model.nbody):
        assert model.body(body).name


@pytest.mark.parametrize("kind", PLANAR)
def test_a_planar_part_collides_with_one_sphere(kind):
    model = mujoco.MjModel.from_xml_path(str(PARTS[0].parent / f"{kind}.xml"))
    solid = np.flatnonzero((model.geom_contype != 0) | (model.geom_conaffinity != 0))
    assert [model.geom(int(g)).name for g in solid] == ["hull"]
    assert model.geom_type[solid[0]] == mujoco.mjtGeom.mjGEOM_SPHERE


@pytest.mark.parametrize("kind", LONG)
def test_a_long_part_collides_with_three_spheres_in_a_row_and_its_corners(kind):
    model = mujoco.MjModel.from_xml_path(str(PARTS[0].parent / f"{kind}.xml"))
    solid = np.flatnonzero((model.geom_contype != 0) | (model.geom_conaffinity != 0))
    names = [model.geom(int(g)).name for g in solid]
    assert names == ["hull", *(f"hull{k}" for k in range(1, len(names)))]
    assert (model.geom_type[solid] == mujoco.mjtGeom.mjGEOM_SPHERE).all()
    assert set(model.geom_contype[solid]) == {2}
    assert set(model.geom_conaffinity[solid]) == {79}
    half = KINDS[kind].half_length_m
    centres = np.array([[0.0, 0.0, 0.3], [-half, 0.0, 0.3], [half, 0.0, 0.3]])
    np.testing.assert_allclose(model.geom_pos[solid[:3]], centres)
    assert len(set(model.geom_size[solid[:3], 0])) == 1
    for x, y, z in model.geom_pos[solid[3:]].tolist():
        assert z == 0.3
        assert [abs(x), abs(y)] in np.abs(model.geom_pos[solid[3:4], :2]).tolist()


@pytest.mark.parametrize("kind", LONG)
def test_no_corner_of_a_long_part_sticks_out_of_its_hulls(kind):
    model = mujoco.MjModel.from_xml_path(str(PARTS[0].parent / f"{kind}.xml"))
    hulls = np.flatnonzero(model.geom_contype != 0)
    boxes = (model.geom_type == mujoco.mjtGeom.mjGEOM_BOX) & (model.geom_group == 1)
    reach = np.abs(model.geom_pos[boxes, :2]) + model.geom_size[boxes, :2]
    corners = np.array([(x, y) for x, y in reach.tolist()])
    away = np.linalg.norm(corners[:, None] - model.geom_pos[hulls, :2], axis=2)
    assert (away - model.geom_size[hulls, 0]).min(axis=1).max() < 0.06


def test_long_things_are_put_where_all_their_hulls_have_room():
    scene = scenes.filled("arena", 4, loads=dict.fromkeys(LONG, 2))
    _, data = placed(scene)
    assert data.ncon == 0
    assert sum(mover.kind in LONG for mover in scene.movers) == 2 * len(LONG)


def seen_across(kind, x, turn=1.0):
    """How far in front of the x axis of a part a laser at its height meets it; nan if it passes."""
    model = mujoco.MjModel.from_xml_path(str(PARTS[0].parent / f"{kind}.xml"))
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    groups, hit = np.array([1, 1, 1, 0, 0, 0], dtype=np.uint8), np.zeros(1, dtype=np.int32)
    start, way = np.array([x, -2.0 * turn, scenes.SCAN_HEIGHT]), np.array([0.0, turn, 0.0])
    far = mujoco.mj_ray(model, data, start, way, groups, 1, -1, hit, None)
    return 2.0 - far if far >= 0.0 else math.nan


def test_a_laser_meets_a_board_over_its_whole_length_and_a_bed_at_ends_and_columns():
    for x in np.linspace(-0.79, 0.79, 41).tolist():
        assert abs(seen_across("board", x)) < 0.03
        assert abs(seen_across("board", x, turn=-1.0)) < 0.03
    met = [
        math.isfinite(seen_across("hospital_bed", x)) for x in (-0.98, -0.8, -0.55, 0, 0.55, 0.98)
    ]
    assert met == [True, False, True, False, True, True]
    assert seen_across("couch", 0.0) == pytest.approx(0.36)


def test_the_gap_to_a_turned_box_is_euclidean():
    boxes = np.array([[1.0, 0.0, 0.5, 0.25, np.pi / 2]])
    points = np.array([[1.0, 0.0], [1.25, 0.5], [1.0, 1.5], [1.25 + 0.3, 0.5 + 0.4]])
    np.testing.assert_allclose(gap_to_boxes(points, boxes), [0.0, 0.0, 1.0, 0.5], atol=1e-12)


def test_a_floor_offers_only_free_places_and_says_when_it_is_full():
    rng = np.random.default_rng(5)
    floor = Floor([(0.0, 0.0, 2.0, 1.0)], np.array([[0.5, 0.5, 0.5, 0.5, 0.0]]))
    for _ in range(20):
        x, y = floor.find(rng, 0.2)
        assert 1.2 <= x <= 2.0
        assert 0.0 <= y <= 1.0
    floor.block(1.5, 0.5, 1.0)
    assert floor.find(rng, 0.2) is None

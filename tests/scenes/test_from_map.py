# SPDX-License-Identifier: Apache-2.0
"""From a map to a plan: walls, gaps, things and floor are where the map has them."""

import math
import sys
from dataclasses import replace

import numpy as np
import pytest

import scenes
from scenes.from_map import FromMap, plan, write
from scenes.placement import gap_to_boxes
from scripts.scene.check import problems
from scripts.scene.robot import robot_of
from sim.driving.pilot import tour_of
from sim.simulation import Simulation
from sim.world.robots import FOLDER
from slam import se2
from slam.errors import InvalidValueError, MobiliaError
from slam.estimate import Raster
from tests.built_scenes import model_bytes

CELL = 0.05
WIDE, HIGH, GAP = 12.0, 8.0, 1.0


def two_rooms(yaw: float = 0.0, hole: bool = False) -> Raster:
    """12 x 8 m, a wall across the middle with a gap of 1 m, a small box; unknown outside."""
    values = np.full((200, 280), np.nan, dtype=np.float32)
    r, c = round(HIGH / CELL), round(WIDE / CELL)
    room = values[20 : 20 + r, 20 : 20 + c]
    room[:] = 0.0
    room[:2], room[-2:], room[:, :2], room[:, -2:] = 1.0, 1.0, 1.0, 1.0
    room[:, c // 2 : c // 2 + 2] = 1.0
    room[60:80, c // 2 : c // 2 + 2] = 0.0
    room[110:118, 40:48] = 1.0
    if hole:
        room[30:60, :2] = 0.0
    return Raster(values=values, resolution_m=CELL, T_map_origin=np.array([-3.0, -2.0, yaw]))


@pytest.mark.parametrize("yaw", [0.0, math.radians(15.0)])
def test_walls_cover_the_cells_and_nothing_else(yaw):
    raster = two_rooms(yaw)
    made = plan(raster)
    rows, columns = np.nonzero(raster.values == 1.0)
    cells = se2.transform(raster.T_map_origin, (np.column_stack([columns, rows]) + 0.5) * CELL)
    boxes = np.vstack([made.walls, [part for thing in made.things for part in thing.parts]])
    assert (gap_to_boxes(np.ascontiguousarray(cells), boxes) <= 0.05).mean() > 0.95
    assert made.figures.walls_near > 0.95
    assert made.figures.walls + made.figures.pieces <= made.figures.wall_m
    length = 2 * (WIDE + HIGH) + HIGH - GAP
    assert made.figures.wall_m == pytest.approx(length, rel=0.05)


def test_pieces_of_one_line_become_one_box_but_not_over_a_gap():
    raster = two_rooms()
    values = raster.values.copy()
    wall = values[20:22, 20:260]
    wall[:, 100:120] = 0.0  # 1 m
    for k, column in enumerate(range(10, 90, 8)):  # a wall of steps of one cell
        wall[k % 2, column : column + 8] = 0.0
    raster = replace(raster, values=values)
    few, many = (plan(raster, FromMap(few=few, things=False)) for few in (True, False))
    y = se2.transform(se2.inverse(raster.T_map_origin), few.walls[:, :2])[:, 1]
    lowest = few.walls[(abs(y - 1.05) < 0.1) & (abs(np.sin(few.walls[:, 4])) < 0.1)]
    assert sorted(2.0 * lowest[:, 2]) == pytest.approx([5.0, 6.0], abs=0.2)
    assert len(few.walls) <= len(many.walls)
    assert min(few.figures.cells_near, few.figures.walls_near) > 0.95


def test_floor_that_no_way_leads_to_is_told():
    raster = two_rooms()
    assert plan(raster).figures.shut_off[0] == 0.0
    values = raster.values.copy()
    values[20:180, 140:142] = 1.0
    area, (x, y) = plan(replace(raster, values=values)).figures.shut_off
    assert area == pytest.approx(WIDE / 2 * HIGH, rel=0.2)
    assert (x, y) == pytest.approx((7.0, 3.0), abs=2.5)


def test_a_gap_is_a_door_and_a_small_box_a_thing():
    made = plan(two_rooms())
    (gap,) = made.gaps
    assert gap.wide_m == pytest.approx(GAP, abs=0.15)
    assert gap.at[:2] == pytest.approx((-3.0 + 1.0 + 6.05, -2.0 + 1.0 + 3.5), abs=0.2)
    assert abs(math.sin(gap.at[2])) > 0.95
    (thing,) = made.things
    assert thing.at[:2] == pytest.approx((0.2, 4.7), abs=0.05)
    assert thing.half == pytest.approx((0.2, 0.2), abs=0.03)
    assert len(made.rooms) == 2


def test_rooms_and_spots_lie_on_free_floor_also_of_a_turned_map():
    raster = two_rooms(math.radians(15.0), hole=True)
    made = plan(raster)
    back = se2.inverse(raster.T_map_origin)
    spots = [made.start[:2], *made.goals]
    for a, b, c, d in (rect for rects in made.rooms.values() for rect in rects):
        spots += [(a, b), (c, b), (a, d), (c, d), (0.5 * (a + c), 0.5 * (b + d))]
    columns, rows = np.floor(se2.transform(back, np.array(spots)) / CELL).astype(int).T
    assert (raster.values[rows, columns] == 0.0).all()
    assert made.figures.rooms_m2 > 0.7 * WIDE * HIGH


def test_a_floor_that_ends_without_a_wall_is_shut_off(tmp_path, monkeypatch):
    made = plan(two_rooms(math.radians(15.0), hole=True))
    assert 2.0 * made.ends[:, 2].sum() == pytest.approx(30 * CELL, rel=0.3)
    assert list(problems(scenes.build(str(write(made, tmp_path / "lab"))))) == []
    bare = write(replace(made, ends=made.ends[:0]), tmp_path / "bare")
    assert "gap to nowhere: 1.4 m wide" in " ".join(problems(scenes.build(str(bare))))
    assert len(plan(two_rooms()).ends) == 0
    monkeypatch.setattr(sys.modules[plan.__module__], "MOST_WALLS", len(made.walls))
    with pytest.raises(InvalidValueError, match=f"in {len(made.walls) + len(made.ends)} pieces"):
        plan(two_rooms(math.radians(15.0), hole=True))


def test_what_a_robot_drove_through_is_no_thing():
    raster = two_rooms()
    path = np.array([[-1.0, 4.7], [1.5, 4.7], [1.5, 1.5]])
    assert plan(raster, FromMap(path=path)).things == ()


def small_world() -> Raster:
    """A room of 3.8 m with nine posts 1.1 m apart."""
    values = np.full((100, 100), np.nan, dtype=np.float32)
    y, x = (np.mgrid[:100, :100] - 49.5) * CELL
    out = np.maximum(abs(x), abs(y))
    values[out < 1.9] = 0.0
    values[(out >= 1.9) & (out < 2.0)] = 1.0
    apart = np.hypot(x - 1.1 * np.clip(np.round(x / 1.1), -1, 1),
                     y - 1.1 * np.clip(np.round(y / 1.1), -1, 1))  # fmt: skip
    values[apart < 0.22] = 1.0
    return Raster(values=values, resolution_m=CELL, T_map_origin=np.zeros(3))


def test_where_no_robot_has_room_its_radius_is_named_and_a_smaller_one_drives():
    said = r"tb: a robot of 0.26 m radius, 0.1 m from all walls, can reach .* FromMap.robot_m"
    with pytest.raises(InvalidValueError, match=said):
        plan(small_world(), FromMap(things=False), source="tb")
    made = plan(small_world(), FromMap(things=False, robot_m=0.12))
    assert len(made.goals) >= 2
    with pytest.raises(InvalidValueError, match=r"no free floor where a robot of 2.95 m radius"):
        plan(two_rooms(), FromMap(robot_m=2.95, things=False, start=(0.0, 0.0, 0.0)))
    with pytest.raises(InvalidValueError, match=r"FromMap.robot_m must lie in 0.01..3, got nan"):
        FromMap(robot_m=math.nan)


@pytest.mark.parametrize("words", ["turtlebot3", "0.12", "cart.toml"])
def test_the_robot_of_a_map_drives_in_its_scene(tmp_path, monkeypatch, words):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "cart.toml").write_text((FOLDER / "turtlebot3.toml").read_text())
    radius, lines = robot_of(words)
    made = plan(small_world(), FromMap(things=False, robot_m=radius))
    file = write(made, tmp_path / "world", robot=lines)
    world = Simulation(str(file), seed=1).world
    assert world.scene.movers[-1].radius == pytest.approx(radius)
    assert world.robot.name == {"0.12": "pioneer3dx of 0.12 m"}.get(words, "turtlebot3")
    assert list(problems(scenes.build(str(file)), tour_of(world.robot).robot_radius_m)) == []


@pytest.mark.parametrize(
    ("words", "said"),
    [("tb4", "no robot is called 'tb4'"), ("9", "radius_m must be"), ("nan", "must be a number")],
)
def test_what_is_no_robot_is_refused(words, said):
    with pytest.raises(MobiliaError, match=said):
        robot_of(words)


def test_the_files_are_a_scene_and_each_part_can_be_switched_off(tmp_path):
    file = write(plan(two_rooms()), tmp_path / "lab")
    name = str(file)
    moving = scenes.build(name, 1)
    assert [m.kind for m in moving.movers] == ["door", "carton", "robot"]
    assert model_bytes(moving) == model_bytes(scenes.build(name, 1))
    assert [m.kind for m in scenes.build(name, 1, furniture="keep", doors="none").movers] == [
        "robot"
    ]
    assert scenes.build(name, furniture="keep").spec.geom("wall:thing0") is not None
    assert scenes.build(name, furniture="drop").spec.geom("wall:thing0") is None
    lines = file.read_text().splitlines()
    off = ["# " + line if "kind =" in line else line for line in lines]
    file.write_text("\n".join(off))
    assert [m.kind for m in scenes.build(name, 1).movers] == ["door", "robot"]


def test_a_start_that_rooms_of_a_turned_map_leave_out_has_its_own(tmp_path):
    raster = two_rooms(math.radians(45.0))
    corner = (0.45 + 0.05 * 20, 0.45 + 0.05 * 20)  # of the building, in the frame of the cells
    x, y = se2.transform(raster.T_map_origin, np.array([corner]))[0].tolist()
    made = plan(raster, FromMap(start=(x, y, 0.0)))
    assert made.start[:2] == (x, y)
    assert scenes.build(str(write(made, tmp_path / "lab")), 1).start[:2] == pytest.approx(
        (x, y), abs=1e-3
    )


SIDE = 1000  # px of the pictures that are no maps
Y, X = np.mgrid[:SIDE, :SIDE]
PICTURES = {
    "chessboard of cells": ((Y + X) % 2 == 1, "99900 m of edges .* at most 15000 m"),
    "coarse comb": (X % 10 < 5, "10000 m of middle lines of walls, expected at most 6000"),
    "specks": (np.random.default_rng(0).random((SIDE, SIDE)) < 0.01, "small things, .* 5000"),
    "close dots": ((X % 4 == 0) & (Y % 4 == 0), "125000 pieces of lines of walls, expected at"),
    "black": (X >= 0, "has no free cells"),
}


@pytest.mark.parametrize("name", PICTURES)
def test_a_picture_that_is_no_map_is_refused_by_its_bound(name):
    occupied, says = PICTURES[name]
    values = occupied.astype(np.float32)
    raster = Raster(values=values, resolution_m=CELL, T_map_origin=np.zeros(3))
    with pytest.raises(InvalidValueError, match=rf"noise\.yaml: .*{says}"):
        plan(raster, source="noise.yaml")


@pytest.mark.parametrize(
    ("origin", "cell", "says"),
    [
        ([1e8, 0.0, 0.0], CELL, r"begins 1e.08 m from the origin .* at most 9000 m"),
        ([0.0, 0.0, 0.0], 100.0, r"m long \(100 m a cell\), at most 1000 m"),
        ([0.0, 0.0, 0.0], 2.0, r"spans \d+ x \d+ m, expected at most 60000 m2"),
    ],
)
def test_a_map_that_no_scene_has_room_for_is_refused(origin, cell, says):
    raster = replace(two_rooms(), resolution_m=cell, T_map_origin=np.array(origin))
    with pytest.raises(InvalidValueError, match=rf"map: .*{says}|map {says}"):
        plan(raster, FromMap(things=False))

# SPDX-License-Identifier: Apache-2.0
"""One row a kind of furniture: a part and its row are all that a new kind takes."""

from pathlib import Path

import numpy as np
import pytest

import scenes
from scenes.assembly import file_of
from scenes.kinds import KINDS, Feet, KindOfMover
from scenes.scene import Mover
from sim.actors.chairs import stand_on_castors
from sim.recording.topics import ObjectsMessage
from slam.errors import UnknownNameError

ROOT = Path(__file__).parents[2]
SHED = """<mujoco><worldbody>
  <geom name="wall:north" class="wall" pos="0 2.1 0.55" size="3.2 0.1 0.55"/>
  <site name="room:shed" type="box" size="3 2 0.01"/> <site name="start:robot" pos="-2 0 0"/>
  <site name="seat:stool:0" pos="1 1 0"/>
</worldbody></mujoco>"""


def test_every_row_has_a_part():
    for name, row in KINDS.items():
        assert file_of("parts", name).is_file()
        assert (row.feet is not None) == (row.group == "chair")


def test_a_kind_without_a_row_is_refused_by_name():
    with pytest.raises(UnknownNameError, match=r"kind must have a row.*chair_swivel.*'stool'"):
        Mover(name="stool0", kind="stool", radius=0.2)


def test_a_kind_of_chair_needs_its_part_and_its_row(monkeypatch, tmp_path):
    """Scattered about by its share, put by a mark, and rolled on its castors."""
    feet = Feet(number=3, circle_m=0.2, first_rad=0.0, radius_m=0.02)
    part = str(file_of("parts", "chair_visitor"))
    stool = KindOfMover(group="chair", height_m=0.5, usual=9.0, feet=feet, part=part)
    monkeypatch.setitem(KINDS, "stool", stool)
    plan = tmp_path / "shed.xml"
    plan.write_text(SHED)
    kinds = [m.kind for m in scenes.filled(plan, 3, n_chairs=12).movers]
    assert "stool" in kinds
    room = scenes.filled(plan, 3, n_chairs=1)
    assert [m.kind for m in room.movers] == ["stool", "robot"]
    assert stand_on_castors(room).compile().nv > room.compile().nv


def test_a_row_is_all_that_the_rest_reads(monkeypatch):
    built = scenes.build("arena", seed=3)
    chair = next(m for m in built.movers if m.kind == "chair_swivel")
    poses = np.array([built.initial[m.name] for m in built.movers])
    feet = Feet(number=3, circle_m=0.2, first_rad=0.0, radius_m=0.02)
    row = KindOfMover(group="chair", height_m=0.5, feet=feet)
    monkeypatch.setitem(KINDS, "chair_swivel", row)
    names = [geom.name for geom in stand_on_castors(built).spec.body(f"{chair.name}/base").geoms]
    assert sum(name.startswith(f"{chair.name}/foot") for name in names) == 3
    message = ObjectsMessage(built.movers)
    message(0, poses, np.zeros(len(poses), dtype=bool))
    assert 0.25 in message._placed[:, 2]

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


def test_every_row_has_a_part():
    for name, row in KINDS.items():
        assert file_of("parts", name).is_file()
        assert (row.feet is not None) == (row.group == "chair")


def test_a_kind_without_a_row_is_refused_by_name():
    with pytest.raises(UnknownNameError, match=r"kind must have a row.*chair_swivel.*'stool'"):
        Mover(name="stool0", kind="stool", radius=0.2)


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

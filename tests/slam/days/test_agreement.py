# SPDX-License-Identifier: Apache-2.0
"""Whether what a session saw fits the days before: things may move, walls may not."""

from __future__ import annotations

import numpy as np
import pytest

from slam.days.evidence import Snapshot
from slam.days.history import History
from slam.days.search import KNOWN, SPOILS, Agreement, Past

CELL = 0.1


def building(*things, shift=(0.0, 0.0), wall_x=3.0):
    """8 x 5 m within walls, a wall with a gap at ``wall_x``, and (x0, y0, x1, y1) m of things."""
    j, i = np.mgrid[0:50, 0:80]
    cells = np.stack([i.ravel(), j.ravel()], axis=1).astype(np.int32)
    middle = (cells + 0.5) * CELL
    x, y = middle.T
    wall = (x < 0.1) | (x > 7.9) | (y < 0.1) | (y > 4.9)
    wall |= (abs(x - wall_x - 0.05) < 0.06) & (abs(y - 2.5) > 0.6)
    for box in things:
        wall |= np.all((middle >= box[:2]) & (middle <= box[2:]), axis=1)
    moved = cells + np.round(np.array(shift) / CELL).astype(np.int32)
    return Snapshot(time_s=0.0, cells=moved, standing=np.where(wall, 0.95, 0.0).astype(np.float32))


def past(*snapshots):
    history = History(cell_m=CELL)
    for number, one in enumerate(snapshots):
        at = Snapshot(time_s=float(number), cells=one.cells, standing=one.standing)
        history = history.with_session(at)
    return Past(history)


def test_chairs_may_move_and_edges_may_be_off_by_a_little():
    chairs = [(1.0, 1.0, 1.4, 1.4), (5.0, 2.0, 5.4, 2.4)]
    others = [(1.0, 3.0, 1.4, 3.4), (6.0, 1.0, 6.4, 1.4)]
    known = past(building(*chairs), building(*chairs))
    same = known.agreement(building(*chairs))
    assert same.disagrees == 0.0
    assert same.known > KNOWN
    assert known.agreement(building(*chairs, shift=(0.2, -0.1))).disagrees == 0.0
    assert 0.0 < known.agreement(building(*others)).disagrees < SPOILS


def test_walls_may_not():
    known = past(building())
    assert known.agreement(building(wall_x=5.0)).disagrees > SPOILS
    assert known.agreement(building(shift=(1.0, 0.6))).disagrees > SPOILS


def test_what_moves_in_the_days_before_has_no_say():
    """A chair that stood there in one session of two does not always stand there."""
    chair = (5.0, 2.0, 5.4, 2.4)
    found = past(building(chair), building()).agreement(building())
    assert found.missing == 0
    assert past(building(chair), building(chair)).agreement(building()).missing > 0


def test_without_days_there_is_nothing_to_agree_with():
    nothing = Past(History(cell_m=CELL))
    assert nothing.agreement(building()) == Agreement()
    assert Agreement().disagrees == pytest.approx(0.0)

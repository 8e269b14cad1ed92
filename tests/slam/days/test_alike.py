# SPDX-License-Identifier: Apache-2.0
"""Other places where what a session saw would stand as well."""

from __future__ import annotations

import math

import numpy as np
import pytest

from slam import se2
from slam.days.agreement import Past
from slam.days.alike import Alike
from slam.days.config import AlikeConfig
from slam.days.evidence import Snapshot
from slam.days.history import History

CELL = 0.1
BOX = (1.0, 1.0, 2.6, 1.8)


def edge(x0, y0, x1, y1):
    """Points along a box, 5 cm apart."""
    x, y = np.arange(x0, x1, 0.05), np.arange(y0, y1, 0.05)
    sides = [(x, np.full_like(x, at)) for at in (y0, y1)]
    sides += [(np.full_like(y, at), y) for at in (x0, x1)]
    return np.concatenate([np.stack(side, axis=1) for side in sides])


def past(*boxes):
    """Of one session in a hall of 12 x 8 m with these boxes, all seen."""
    stands = np.concatenate([edge(-6.0, -4.0, 6.0, 4.0), *(edge(*box) for box in boxes)])
    taken = np.unique(np.floor(stands / CELL).astype(np.int32), axis=0)
    snapshot = Snapshot(time_s=0.0, cells=taken, standing=np.ones(len(taken), np.float32))
    return Past(History(cell_m=CELL).with_session(snapshot)), stands


def seen_from(stands, T_map_own, near_m):
    own = se2.transform(se2.inverse(T_map_own), stands)
    return own[np.hypot(own[:, 0], own[:, 1]) < near_m]


@pytest.mark.parametrize("T_map_own", [(1.0, 0.5, 0.3), (-4.0, 2.0, -2.0)])
def test_a_hall_is_alike_after_half_a_turn(T_map_own):
    days, stands = past()
    truth = np.array(T_map_own)
    found = Alike(days).others(seen_from(stands, truth, 20.0), truth)
    assert len(found) == 1
    turned = np.array([-truth[0], -truth[1], se2.wrap(truth[2] + math.pi)])
    assert math.dist(found[0][:2], turned[:2]) < 0.15
    assert abs(se2.wrap(found[0][2] - turned[2])) < math.radians(2.0)


def test_a_thing_that_always_stands_tells_the_ends_apart():
    truth = np.array([1.0, 0.5, 0.3])
    days, stands = past(BOX, (-5.0, -3.0, -3.0, -2.0), (3.0, -3.5, 3.5, -1.0))
    points, config = seen_from(stands, truth, 20.0), AlikeConfig(share=0.95)
    assert Alike(days, config).others(points, truth) == []
    bare, _ = past()
    assert len(Alike(bare, config).others(points, truth)) == 1


def test_two_rooms_of_one_plan_are_alike_at_the_same_angle():
    rooms = [(x, -1.5, x + 4.0, 1.5) for x in (-5.0, 1.0)]
    days, stands = past(*rooms)
    truth = np.array([-3.2, 0.4, 0.0])
    inside = np.all((stands > (-5.05, -1.55)) & (stands < (-0.95, 1.55)), axis=1)
    points = se2.transform(se2.inverse(truth), stands[inside])
    found = Alike(days).others(points, truth)
    assert any(math.dist(one[:2], (2.8, 0.4)) < 0.15 and abs(one[2]) < 0.04 for one in found)

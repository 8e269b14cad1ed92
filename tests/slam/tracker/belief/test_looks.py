# SPDX-License-Identifier: Apache-2.0
"""What a scan says of long-known surface, in metres."""

import math

import numpy as np
import pytest

from slam import se2
from slam.tracker.belief.belief import gain_m
from slam.tracker.cell_map import CellMap
from slam.tracker.matching.matcher import unmatched
from slam.tracker.network import Network
from slam.tracker.rasterise import rasterise, seen_at
from tests.slam.tracker.belief.rooms import KINDS, ORIGIN, known, seen
from tests.world2d import World2D, arena, rectangle

BOX = rectangle(1.5, -0.5, 2.5, 0.5)  # its near face, of 1 m, is in view from the origin
FREE, FURNISHED = World2D(arena()), World2D(np.vstack([arena(), BOX]))
BOARD = World2D(np.vstack([arena(), rectangle(-0.6, -0.6, 0.8, 0.6)]))  # all about the robot
WRONG = np.array([0.5, 0.3, 0.4])
Kind = type[CellMap]
pytestmark = pytest.mark.parametrize("kind", KINDS)


def test_a_board_before_everything_says_nothing_either_way(kind: Kind) -> None:
    look = seen_at(known(kind, FREE, 20.0, ORIGIN), seen(BOARD, ORIGIN, kind), ORIGIN)
    assert look.known < 0.01
    assert look.through < 0.01


def test_what_has_gone_is_seen_through_by_its_length(kind: Kind) -> None:
    gone_m = []
    for half in (0.5, 1.0):
        furnished = World2D(np.vstack([arena(), rectangle(1.5, -half, 2.5, half)]))
        cell_map = known(kind, furnished, 60.0, ORIGIN)
        gone = seen_at(cell_map, seen(FREE, ORIGIN, kind), ORIGIN)
        stays = seen_at(cell_map, seen(furnished, ORIGIN, kind), ORIGIN)
        assert stays.through < 0.1 * gone.through
        assert stays.known > gone.known
        gone_m.append(gone.through)
    assert gone_m[1] == pytest.approx(2.0 * gone_m[0], rel=0.2)


def test_a_young_trace_counts_less_and_what_is_gone_by_the_same_share(kind: Kind) -> None:
    kept_m, gone_m = [], []
    for seconds in (0.5, 2.0, 10.0, 60.0):
        cell_map = known(kind, FURNISHED, seconds, ORIGIN)
        kept_m.append(seen_at(cell_map, seen(FURNISHED, ORIGIN, kind), ORIGIN).known)
        gone_m.append(seen_at(cell_map, seen(FREE, ORIGIN, kind), ORIGIN).through)
    assert (np.diff(kept_m) > 0.0).all()
    assert kept_m[0] < 0.3 * kept_m[-1]
    share = kept_m[1] / kept_m[3]
    assert gone_m[1] / gone_m[3] == pytest.approx(share, rel=0.35)


def test_a_wrong_pose_is_denied_and_the_right_one_is_not(kind: Kind) -> None:
    cell_map, view = known(kind, FURNISHED, 20.0, ORIGIN), seen(FURNISHED, ORIGIN, kind)
    right, wrong = seen_at(cell_map, view, ORIGIN), seen_at(cell_map, view, WRONG)
    assert wrong.known < 0.5 * right.known
    assert wrong.through > 10.0 * right.through
    here, there = (unmatched(pose, matched=0.0, score=0.0) for pose in (ORIGIN, WRONG))
    gain = (right.known - right.through) - (wrong.known - wrong.through)
    assert gain_m(cell_map, view, here, there) == pytest.approx(gain)
    assert gain_m(cell_map, view, there, here) == pytest.approx(-gain)


def test_asking_leaves_the_map_as_it_was(kind: Kind) -> None:
    cell_map = known(kind, FURNISHED, 20.0, ORIGIN)
    before = cell_map.window(-6.0, -5.0, 6.0, 5.0), cell_map.extent()
    view = seen(FREE, ORIGIN, kind)
    looks = [seen_at(cell_map, view, at) for at in (ORIGIN, WRONG, np.array([30.0, 0.0, 0.0]))]
    after = cell_map.window(-6.0, -5.0, 6.0, 5.0)
    np.testing.assert_array_equal(after[0], before[0][0])
    np.testing.assert_array_equal(after[1], before[0][1])
    assert cell_map.extent() == before[1]
    assert seen_at(cell_map, view, ORIGIN) == looks[0]  # each look counts anew
    assert (looks[2].known, looks[2].through) == (0.0, 0.0)


def test_a_look_that_writes_says_what_one_that_does_not_says(kind: Kind) -> None:
    """Of the map as it was before the scan."""
    cell_map, view = known(kind, FURNISHED, 20.0, ORIGIN), seen(FREE, ORIGIN, kind)
    asked = seen_at(cell_map, view, ORIGIN)
    rasterise(cell_map, view, ORIGIN)
    at = se2.compose(ORIGIN, view.T_robot_laser)
    written = cell_map.integrate(view.view, at, 0.2, write=True)
    assert asked.known > 1.0
    assert asked.through > 0.1
    # but for cells that were never seen: a grid opens them to be written
    assert written._replace(visited=asked.visited) == asked


def test_a_wall_seen_through_along_it_counts_little(kind: Kind) -> None:
    """A pose that is off by centimetres looks along metres of a wall."""
    wall = World2D(np.vstack([arena(), rectangle(0.0, 1.0, 3.0, 1.1)]))
    cell_map = known(kind, wall, 60.0, np.array([1.5, -1.0, 0.5 * math.pi]))
    aside, along = (
        seen_at(cell_map, seen(FREE, np.array(pose), kind), np.array(pose)).through
        for pose in ((1.5, -0.5, 0.5 * math.pi), (-1.0, 1.0, 0.0))
    )
    assert aside > 1.0
    # the grid does not know which way its surfaces face
    assert along / aside < 0.35 if kind is Network else along / aside > 0.9


def test_a_surface_keeps_what_the_map_was_off_when_it_became_known(kind: Kind) -> None:
    """Or less, where it is seen again by a robot that is surer; what is new is off as the map."""
    cell_map, scan = known(kind, FREE, 0.5, ORIGIN), seen(FREE, ORIGIN, kind)
    at = se2.compose(ORIGIN, scan.T_robot_laser)

    def looked(off_cm: int, times: int) -> set[int]:
        cell_map.off_cm = off_cm
        for _ in range(times):
            rasterise(cell_map, scan, ORIGIN)
            cell_map.integrate(scan.view, at, 0.5, write=True)
        cells = cell_map.cells
        sure = cells.y * cells.age / (cells.age + 5.0)
        return set(cells.off[sure > 0.95 * sure.max()].tolist())

    assert looked(7, 60) == {7}
    assert looked(90, 10) == {7}
    assert looked(3, 1) == {3}
    assert looked(90, 10) == {3}

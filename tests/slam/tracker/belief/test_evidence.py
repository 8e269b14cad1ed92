# SPDX-License-Identifier: Apache-2.0
"""What scans say of a place: in metres of long-known surface, and of each cell once."""

import math

import numpy as np
import pytest

from slam import se2
from slam.tracker.belief.evidence import Evidence, vanished
from slam.tracker.cell_map import CellMap
from slam.tracker.network import Network
from slam.tracker.rasterise import rasterise
from tests.slam.tracker.belief.rooms import KINDS, ORIGIN, known, seen
from tests.world2d import World2D, arena, rectangle

BOX = rectangle(1.5, -0.5, 2.5, 0.5)  # its near face, of 1 m, is in view from the origin
FREE, FURNISHED = World2D(arena()), World2D(np.vstack([arena(), BOX]))
BOARD = World2D(np.vstack([arena(), rectangle(-0.6, -0.6, 0.8, 0.6)]))  # all about the robot
BACK = np.array([0.0, 0.0, math.pi])
Kind = type[CellMap]
pytestmark = pytest.mark.parametrize("kind", KINDS)


def test_looking_twice_from_one_place_adds_nothing(kind: Kind) -> None:
    cell_map = known(kind, FREE, 20.0, ORIGIN)
    evidence, view = Evidence(), seen(FREE, ORIGIN, kind)
    first = evidence.add(cell_map, view, ORIGIN)
    before = evidence.known_m, evidence.through_m, evidence.latest_m
    assert first.known == before[0] > 5.0
    for _ in range(40):
        again = evidence.add(cell_map, view, ORIGIN)
        assert (again.known, again.through) == (0.0, 0.0)
        assert again.confirmed == first.confirmed  # of this scan alone
    assert (evidence.known_m, evidence.through_m, evidence.latest_m) == before


def test_what_is_seen_from_elsewhere_adds_what_was_not_in_view(kind: Kind) -> None:
    cell_map = known(kind, FREE, 20.0, ORIGIN, BACK)
    both, back = Evidence(), Evidence()
    both.add(cell_map, seen(FREE, ORIGIN, kind), ORIGIN)
    ahead_m = both.known_m
    both.add(cell_map, seen(FREE, BACK, kind), BACK)
    back.add(cell_map, seen(FREE, BACK, kind), BACK)
    assert both.known_m > 1.5 * ahead_m
    assert both.known_m <= ahead_m + back.known_m + 1e-9
    assert both.known_m == pytest.approx(ahead_m + back.known_m, rel=0.05)


def test_a_board_before_everything_says_nothing_either_way(kind: Kind) -> None:
    cell_map = known(kind, FREE, 20.0, ORIGIN)
    evidence = Evidence()
    evidence.add(cell_map, seen(BOARD, ORIGIN, kind), ORIGIN)
    assert evidence.known_m < 0.01
    assert evidence.through_m < 0.01


def test_what_has_gone_is_seen_through_by_its_length(kind: Kind) -> None:
    gone_m = []
    for half in (0.5, 1.0):
        box = rectangle(1.5, -half, 2.5, half)
        furnished = World2D(np.vstack([arena(), box]))
        cell_map = known(kind, furnished, 60.0, ORIGIN)
        evidence, stays = Evidence(), Evidence()
        evidence.add(cell_map, seen(FREE, ORIGIN, kind), ORIGIN)
        stays.add(cell_map, seen(furnished, ORIGIN, kind), ORIGIN)
        assert stays.through_m < 0.1 * evidence.through_m
        assert stays.known_m > evidence.known_m
        gone_m.append(evidence.through_m)
    assert gone_m[1] == pytest.approx(2.0 * gone_m[0], rel=0.2)


def test_what_was_hardly_known_counts_by_its_cube_when_it_is_gone(kind: Kind) -> None:
    """People stand about for a while, all over a hall: none of that tells that it is another."""
    kept_m, gone_m = [], []
    for seconds in (2.0, 60.0):
        cell_map = known(kind, FURNISHED, seconds, ORIGIN)
        for world, of in ((FURNISHED, kept_m), (FREE, gone_m)):
            evidence = Evidence()
            evidence.add(cell_map, seen(world, ORIGIN, kind), ORIGIN)
            of.append(evidence.known_m if world is FURNISHED else evidence.through_m)
    share = kept_m[0] / kept_m[1]
    assert 0.1 < share < 0.5
    assert gone_m[0] / gone_m[1] == pytest.approx(share**3, rel=0.35)


def test_a_wrong_pose_is_denied_and_the_right_one_is_not(kind: Kind) -> None:
    cell_map = known(kind, FURNISHED, 20.0, ORIGIN)
    right, wrong = Evidence(), Evidence()
    view = seen(FURNISHED, ORIGIN, kind)
    right.add(cell_map, view, ORIGIN)
    wrong.add(cell_map, view, np.array([0.5, 0.3, 0.4]))
    assert wrong.known_m < 0.5 * right.known_m
    assert wrong.through_m > 10.0 * right.through_m


def test_a_young_trace_counts_less(kind: Kind) -> None:
    view = seen(FREE, ORIGIN, kind)
    found = []
    for seconds in (0.5, 2.0, 10.0, 60.0):
        evidence = Evidence()
        evidence.add(known(kind, FREE, seconds, ORIGIN), view, ORIGIN)
        found.append(evidence.known_m)
    assert (np.diff(found) > 0.0).all()
    assert found[0] < 0.3 * found[-1]


def test_what_was_counted_stays_so_when_the_pool_of_blocks_grows(kind: Kind) -> None:
    cell_map, evidence = known(kind, FREE, 20.0, ORIGIN), Evidence()
    view = seen(FREE, ORIGIN, kind)
    evidence.add(cell_map, view, ORIGIN)
    before, slots = evidence.known_m, len(cell_map.cells.free)
    for k in range(1, 20):
        far = np.array([100.0 * k, 0.0, 0.0])
        rasterise(cell_map, view, far)  # blocks are born under it
        if len(cell_map.cells.free) > slots:
            break
    cell_map.release()
    assert len(cell_map.cells.free) > slots
    evidence.add(cell_map, view, ORIGIN)
    assert evidence.known_m == before
    evidence.add(cell_map, view, far)  # where the map knows nothing
    assert evidence.known_m == before


def test_a_copy_goes_on_by_itself(kind: Kind) -> None:
    cell_map, evidence = known(kind, FREE, 20.0, ORIGIN, BACK), Evidence()
    evidence.add(cell_map, seen(FREE, ORIGIN, kind), ORIGIN)
    other, before = evidence.copy(), evidence.known_m
    other.add(cell_map, seen(FREE, BACK, kind), BACK)
    assert evidence.known_m == before < other.known_m
    gone_on = other.known_m
    evidence.add(cell_map, seen(FREE, BACK, kind), BACK)
    assert evidence.known_m == gone_on


def test_asking_leaves_the_map_as_it_was(kind: Kind) -> None:
    cell_map, evidence = known(kind, FURNISHED, 20.0, ORIGIN), Evidence()
    before = cell_map.window(-6.0, -5.0, 6.0, 5.0), cell_map.extent()
    for pose in (ORIGIN, np.array([0.5, 0.3, 0.4]), np.array([30.0, 0.0, 0.0])):
        evidence.add(cell_map, seen(FREE, ORIGIN, kind), pose)
    after = cell_map.window(-6.0, -5.0, 6.0, 5.0)
    np.testing.assert_array_equal(after[0], before[0][0])
    np.testing.assert_array_equal(after[1], before[0][1])
    assert cell_map.extent() == before[1]


def test_a_look_that_writes_says_what_one_that_does_not_says(kind: Kind) -> None:
    """Of the map as it was before the scan."""
    cell_map, view = known(kind, FURNISHED, 20.0, ORIGIN), seen(FREE, ORIGIN, kind)
    at = se2.compose(ORIGIN, view.T_robot_laser)
    rasterise(cell_map, view, ORIGIN)
    asked = cell_map.integrate(view.view, at, 0.2, write=False)
    written = cell_map.integrate(view.view, at, 0.2, write=True)
    assert asked.known > 1.0
    assert asked.through > 0.1
    # but for cells that were never seen: a grid opens them to be written
    assert written._replace(visited=asked.visited) == asked


def test_surface_vanishes_for_who_was_carried_not_behind_a_board_nor_for_who_drove(
    kind: Kind,
) -> None:
    """The scan after is taken where the robot is, and put where it believes to be."""
    cell_map = known(kind, FURNISHED, 60.0, ORIGIN)
    before, ahead = (seen(FURNISHED, ORIGIN, kind), ORIGIN), np.array([0.1, 0.05, 0.1])
    assert vanished(cell_map, before, (seen(FURNISHED, ahead, kind), ahead)) < 0.02
    assert vanished(cell_map, before, (seen(BOARD, ORIGIN, kind), ORIGIN)) < 0.02
    carried = np.array([-1.0, 1.2, 2.0])
    assert vanished(cell_map, before, (seen(FURNISHED, carried, kind), ORIGIN)) > 0.2


def test_a_wall_seen_through_along_it_counts_little(kind: Kind) -> None:
    """A pose that is off by centimetres looks along metres of a wall."""
    wall = World2D(np.vstack([arena(), rectangle(0.0, 1.0, 3.0, 1.1)]))
    cell_map = known(kind, wall, 60.0, np.array([1.5, -1.0, 0.5 * math.pi]))
    aside, along = Evidence(), Evidence()
    for evidence, pose in ((aside, (1.5, -0.5, 0.5 * math.pi)), (along, (-1.0, 1.0, 0.0))):
        at = np.array(pose)
        evidence.add(cell_map, seen(FREE, at, kind), at)
    assert aside.through_m > 2.0
    share = along.through_m / aside.through_m
    if kind is Network:
        assert share < 0.1
    else:  # the grid does not know which way its surfaces face
        assert share == pytest.approx(1.0)


def test_a_surface_keeps_what_the_map_was_off_when_it_became_known(kind: type[CellMap]) -> None:
    """Or less, where it is seen again by a robot that is surer; what is new is off as the map."""
    world, here = World2D(arena()), np.zeros(3)
    cell_map, scan = known(kind, world, 0.5, here), seen(world, here, kind)
    at = se2.compose(here, scan.T_robot_laser)

    def looked(off_cm: int, times: int) -> set[int]:
        cell_map.off_cm = off_cm
        for _ in range(times):
            rasterise(cell_map, scan, here)
            cell_map.integrate(scan.view, at, 0.5, write=True)
        cells = cell_map.cells
        sure = cells.y * cells.age / (cells.age + 5.0)
        return set(cells.off[sure > 0.95 * sure.max()].tolist())

    assert looked(7, 60) == {7}
    assert looked(90, 10) == {7}
    assert looked(3, 1) == {3}
    assert looked(90, 10) == {3}

# SPDX-License-Identifier: Apache-2.0
"""A robot that is lost to its map goes on tracking, and is not carried by what only looks right."""

from __future__ import annotations

import math

import numpy as np
import pytest

from slam import se2
from slam.frames import Frame
from slam.frontend.observations import observe
from slam.grid.config import OccupancyConfig
from slam.grid.occupancy import OccupancySlam
from slam.shunting import ShuntingConfig, ShuntingSlam
from slam.tracker.tracking.wake import Wake
from tests.world2d import Drive, Wheels, World2D, arena, frames, going_on, rectangle

POOR = Wheels(noise=0.08, scale_sd=0.1)
BEFORE = Drive((0.0, 0.0, 0.0), ((0.0, 0.8, 12.0),))
# Four walls about the robot, which come one after another.
BOARDS = ((1.3, -1.2, 1.3, 1.3), (-1.2, 1.3, 1.3, 1.3), (-1.2, -1.2, -1.2, 1.3),
          (-1.2, -1.2, 1.3, -1.2))  # fmt: skip


def closing_in(kind: type[ShuntingSlam] | type[OccupancySlam]) -> list[tuple[str, float]]:
    """States and position errors, m, while boards come between the robot and its room, and after.

    It turns on the spot with poor wheels for 20 s in the box.
    """
    system = kind(ShuntingConfig(cell_m=0.05)) if kind is ShuntingSlam else kind(
        OccupancyConfig(cell_m=0.05)
    )  # fmt: skip
    stream: list[Frame] = frames(World2D(arena()), BEFORE, rate_hz=5.0, seed=3)
    out = []
    for count in (1, 2, 3, 4, 4):
        walls = np.vstack([arena(), np.array(BOARDS[:count])])
        at = tuple(float(v) for v in stream[-1].truth)  # type: ignore[union-attr]
        turn = Drive(at, ((0.0, 0.5, 12.0 if count == 4 else 1.0),))  # type: ignore[arg-type]
        more = frames(World2D(walls), turn, rate_hz=5.0, seed=count, wheels=POOR)
        stream += going_on(more, stream[-1])
    for frame in stream:
        estimate = system.update(frame.without_truth())
        off = estimate.T_map_robot - frame.truth
        out.append((estimate.diagnostics["state"], math.hypot(float(off[0]), float(off[1]))))
    return out


@pytest.mark.parametrize("kind", [ShuntingSlam, OccupancySlam])
def test_boards_that_close_in_do_not_lose_the_robot(kind) -> None:
    """Nothing of the room is in view in the end, and nothing carried the robot."""
    seen = closing_in(kind)
    assert max(off for _, off in seen) < 0.05
    assert seen[-1][0] == "tracking"


def test_what_the_wake_sees_is_not_in_the_map() -> None:
    for system in (ShuntingSlam(), OccupancySlam()):
        stream = frames(World2D(arena()), BEFORE, rate_hz=5.0, seed=3)
        for frame in stream[:30]:
            system.update(frame.without_truth())
        before = [array.copy() for array in system.cell_map.cells]
        map_before = system.map()
        wake = Wake(system.cell_map)
        observations = observe(stream[30], np.zeros(3), system.config)
        for _ in range(20):
            wake.add(observations, np.array([0.4, -0.3, 0.2]), 0.2)
        for one, other in zip(before, system.cell_map.cells, strict=True):
            np.testing.assert_array_equal(one, other)
        after = system.map()
        assert map_before is not None
        assert after is not None
        np.testing.assert_array_equal(map_before.values, after.values)
        assert not np.array_equal(wake.map.cells.y, system.cell_map.cells.y)


def test_agreement_is_counted_in_a_row() -> None:
    wake = Wake(ShuntingSlam().cell_map)
    for agrees in (True, True, False, True):
        wake.count(agrees, 0.2)
    assert (wake.agreed, wake.agreed_s) == (1, 0.2)


ELSEWHERE = Drive((-2.6, 1.5, 2.2), ((0.0, 0.3, 16.0),))


def carried() -> tuple[ShuntingSlam, list[Frame]]:
    """A SLAM that knows its room, and the frames that follow from another place in it."""
    system = ShuntingSlam(ShuntingConfig(cell_m=0.05))
    world = World2D(np.vstack([arena(), rectangle(-2.0, 1.0, -1.2, 2.2)]))
    stream = frames(world, Drive((0.0, 0.0, 0.0), ((0.0, 0.8, 24.0),)), rate_hz=5.0, seed=3)
    for frame in stream:
        system.update(frame.without_truth())
    return system, list(going_on(frames(world, ELSEWHERE, rate_hz=5.0, seed=4), stream[-1]))


def test_a_robot_that_is_carried_is_told_by_its_surroundings() -> None:
    """Everything changes between two scans: no way leads there."""
    system, elsewhere = carried()
    states, last = [], None
    for frame in elsewhere:
        last = system.update(frame.without_truth())
        states.append(last.diagnostics["state"])
        if last.diagnostics["state"] == "frozen":
            assert system._recovery.wake is not None
            assert system._recovery.wake.carried
    assert last is not None
    assert "relocated" in states
    off = last.T_map_robot - ELSEWHERE.at(16.0)[0]
    assert math.hypot(float(off[0]), float(off[1])) < 0.1
    assert abs(se2.wrap(float(off[2]))) < math.radians(3.0)


def test_the_covariance_of_a_lost_robot_covers_all_that_it_has_seen() -> None:
    system, elsewhere = carried()
    lost = 0
    for frame in elsewhere:
        estimate = system.update(frame.without_truth())
        off = estimate.T_map_robot - frame.truth
        off[2] = se2.wrap(float(off[2]))
        if estimate.diagnostics["state"] == "lost":
            lost += 1
            assert estimate.diagnostics["p_lost"] > 0.9
            assert off @ np.linalg.solve(estimate.covariance, off) < 11.3  # 3 numbers, 99 %
    assert lost
    assert estimate.covariance[0, 0] < 0.1**2  # found


def test_another_place_is_believed_only_after_long_while_scans_agree() -> None:
    """Told that nothing carried it, a robot that is elsewhere does not jump there at once.

    Nor does it take the map for outdated: a place that is known explains what it sees.
    """
    system, elsewhere = carried()
    found_s, estimate = None, None
    for k, frame in enumerate(elsewhere):
        if system._recovery.wake is not None:
            system._recovery.wake.carried = False
        estimate = system.update(frame.without_truth())
        if estimate.diagnostics["state"] == "relocated" and found_s is None:
            found_s = k / 5.0
    assert estimate is not None
    assert found_s is not None
    assert found_s > 5.0
    off = estimate.T_map_robot - ELSEWHERE.at(16.0)[0]
    assert math.hypot(float(off[0]), float(off[1])) < 0.1
    assert abs(se2.wrap(float(off[2]))) < math.radians(3.0)

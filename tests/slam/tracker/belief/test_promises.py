# SPDX-License-Identifier: Apache-2.0
"""What a SLAM with one belief promises: found where carried, and nowhere else than it is."""

import math
from typing import Any

import numpy as np
import pytest

from slam import se2
from slam.estimate import Estimate
from slam.frames import Frame
from slam.frontend.observations import Observations, observe
from slam.shunting import ShuntingConfig, ShuntingSlam
from slam.tracker.belief.doubt import Doubt
from slam.tracker.belief.places import Place, Places
from slam.tracker.belief.state import State
from slam.tracker.matching.budget import Budget
from slam.tracker.matching.matcher import unmatched
from slam.tracker.tracker import Tracker
from tests.slam.tracker.belief.drives import (
    DOUBTFUL,
    FAST,
    LONG_TURN,
    ROOMS,
    SLAMS,
    TURN,
    Pose,
    at,
    blind_turn,
    estimates,
    made,
    mapped,
    off,
    off_m,
    states,
    still,
)
from tests.world2d import Chairs, Drive, World2D, arena, frames, going_on, rectangle, wander

pytestmark = pytest.mark.slow
PLACE = (2.0, -2.0, 2.0)
MIRRORED = (-3.5, -2.8, 0.4)  # half a turn about the middle of the room shows nearly the same
NEAR_WALL = (-2.6, 1.5, 2.2)  # which stands before all that the map shows where motion led
NOWHERE = World2D(np.array([[-9.0, -8.0, 14.0, -9.0], [14.0, -9.0, 10.0, 9.0],
                            [10.0, 9.0, -7.0, 12.0], [-7.0, 12.0, -9.0, -8.0]]))  # fmt: skip
WINDOW = (-5.5, -4.5, 5.5, 4.5)


def carried(
    kind: type[Tracker], world: World2D, place: Pose, seconds: float = 4.0
) -> tuple[Tracker, list[tuple[Frame, Estimate]]]:
    """What is said of the frames after somebody carried a robot that knows its room to a place.

    Until it is taken, the pose is reported where the motion of before leads, and the map is not
    written.
    """
    system, last = mapped(ROOMS, LONG_TURN, kind)
    drive = Drive(place, ((0.2, 0.3, seconds),))
    before, pose = system.window(*WINDOW), system.trajectory().poses[-1]
    out, found = [], False
    for frame in going_on(frames(world, drive, rate_hz=5.0, seed=7), last):
        estimate = system.update(frame.without_truth())
        found |= estimate.diagnostics["state"] == State.RELOCATED
        if not found:
            assert not estimate.converged
            assert estimate.diagnostics["state"] in DOUBTFUL
            motion = se2.between(last.odometry.T_odom_robot, frame.odometry.T_odom_robot)
            assert off_m(estimate, se2.compose(pose, motion)) < 0.15
            for old, now in zip(before, system.window(*WINDOW), strict=True):
                np.testing.assert_array_equal(now, old)
        last, pose = frame, estimate.T_map_robot
        out.append((frame, estimate))
    return system, out


@pytest.mark.parametrize("kind", SLAMS)
@pytest.mark.parametrize("place", [PLACE, (3.0, 2.5, -1.0), (0.0, 2.0, -2.0), (2.0, 1.0, -2.5)])
def test_a_carried_robot_is_found_and_at_no_wrong_place(kind: type[Tracker], place: Pose) -> None:
    """Within 2 s, and at once it is lost; whatever it says that is to be believed is right."""
    _, after = carried(kind, ROOMS, place)
    said = states(one for _, one in after)
    found = said.index(State.RELOCATED)
    assert found <= 10
    assert set(said[:found]) <= {"lost", "frozen"}
    assert "lost" in said[:3]
    assert said[-1] == "tracking"
    for k, (frame, one) in enumerate(after):
        error = off(one, frame.truth)
        if said[k] == "lost":  # it says that it may be anywhere that it has seen
            assert error @ np.linalg.solve(one.covariance, error) < 11.3  # 3 numbers, 99 %
        if k >= found:
            assert one.converged
            assert off_m(one, frame.truth) < 0.05
            assert one.diagnostics["p_lost"] < 0.01
    assert one.covariance[0, 0] < 0.1**2


@pytest.mark.parametrize("kind", SLAMS)
def test_who_is_carried_to_nowhere_known_is_lost_and_not_trusted(kind: type[Tracker]) -> None:
    _, after = carried(kind, NOWHERE, (0.0, 0.0, 1.0))
    said = [one for _, one in after]
    assert set(states(said[1:])) == {"lost"}
    assert all(one.diagnostics["p_lost"] >= 0.5 for one in said[1:])
    assert said[-1].covariance[0, 0] > 1.0


@pytest.mark.parametrize("kind", SLAMS)
@pytest.mark.parametrize("moving", [0.1, 0.3])
def test_a_right_robot_in_clutter_is_never_told_that_it_is_lost(
    kind: type[Tracker], moving: float
) -> None:
    chairs = Chairs.random(14, (-4.0, -3.0, 3.0, 3.0), 30.0, moving, seed=4)
    stream = frames(World2D(ROOMS.segments, chairs), wander(20.0), rate_hz=5.0, seed=3)[:100]
    said = estimates(made(kind), stream)
    assert max(off_m(one, f.truth) for one, f in zip(said, stream, strict=True)) < 0.1
    assert set(states(said)) <= {"tracking", "frozen"}
    assert max(one.diagnostics["p_lost"] for one in said) < 0.5
    assert np.mean([one.converged for one in said]) > 0.95


@pytest.mark.parametrize("kind", SLAMS)
def test_a_single_scan_that_does_not_go_on_is_forgotten_by_the_next_that_do(
    kind: type[Tracker],
) -> None:
    system, last = mapped(ROOMS, LONG_TURN, kind)
    pose, before = at(system), system.window(*WINDOW)
    odd = going_on(still(ROOMS, PLACE, 0.2), last)[:1]
    first = estimates(system, odd)[0]
    assert first.diagnostics["state"] in DOUBTFUL
    for old, now in zip(before, system.window(*WINDOW), strict=True):
        np.testing.assert_array_equal(now, old)
    said = [first, *estimates(system, going_on(still(ROOMS, pose, 1.0), odd[-1]))]
    assert set(states(said[3:])) == {"tracking"}
    assert said[3].diagnostics["p_lost"] < 0.01
    assert max(off_m(one, pose) for one in said) < 0.02
    assert system._belief.certain


@pytest.mark.parametrize("kind", SLAMS)
@pytest.mark.parametrize("gap_s", [0.2, 0.8])
def test_a_turn_that_odometry_does_not_know_is_taken_at_once(
    kind: type[Tracker], gap_s: float
) -> None:
    """Of 80 degrees, where somebody had the time for it."""
    system, last = mapped(ROOMS, LONG_TURN, kind)
    x, y, heading = at(system)
    turned = (x + 0.05, y, heading + (math.radians(80.0) if gap_s > 0.5 else 0.5))
    said = estimates(system, going_on(still(ROOMS, turned, 1.0), last, gap_s))
    for one in said:
        assert one.converged
        assert off_m(one, turned) < 0.05
        assert abs(off(one, turned)[2]) < math.radians(1.5)
    assert states(said) == ["tracking"] * len(said)


@pytest.mark.parametrize(
    "push",
    [
        (0.3, 0.0, 0.0), (0.1, 0.1, 0.35), (-0.35, 0.35, 0.0), (-0.2, 0.22, 0.0), (-0.5, 0.0, 0.0),
    ],
)  # fmt: skip
def test_a_robot_that_is_pushed_far_is_followed_or_found(push: tuple[float, float, float]) -> None:
    system, last = mapped(ROOMS, LONG_TURN)
    aside: Any = tuple((np.array(at(system)) + push).tolist())
    said = estimates(system, going_on(still(ROOMS, aside, 3.0), last))
    believed = [one for one in said if one.converged]
    assert max(off_m(one, aside) for one in believed) < 0.1
    assert said[-1].converged
    assert off_m(said[-1], aside) < 0.03


def test_a_standing_robot_that_is_shoved_is_followed_or_says_that_it_is_lost() -> None:
    """Wheels that were pushed aside count nothing: no prior of theirs may hold the match."""
    system, last = mapped(World2D(arena()))
    x, y, heading = at(system)
    aside = (x + 0.06, y - 0.03, heading + math.radians(6.0))
    for frame in going_on(still(World2D(arena()), aside, 2.0), last):
        estimate = system.update(frame.without_truth())
        if estimate.converged:
            assert off_m(estimate, aside) < 0.015
            assert abs(off(estimate, aside)[2]) < math.radians(0.4)


def test_a_robot_carried_to_where_all_in_view_hides_the_map_knows_it() -> None:
    system, last = mapped(ROOMS, LONG_TURN)
    said = estimates(system, going_on(still(ROOMS, NEAR_WALL, 2.0), last))
    assert all(not one.converged or off_m(one, NEAR_WALL) < 0.1 for one in said)


@pytest.mark.parametrize("preset", ["robust", "paper"])
def test_the_paper_s_map_is_never_in_doubt(preset: str) -> None:
    """Nor that of a robot of which it is said that nobody carries it."""
    config = ShuntingConfig.preset(preset).changed({"cell_m": 0.05, "carried_per_h": 0.0})
    assert ShuntingConfig.paper().carried_per_h == 0.0
    system = ShuntingSlam(config)
    stream = frames(ROOMS, TURN, rate_hz=5.0, seed=3)
    stream += going_on(still(ROOMS, (2.0, -2.0, 2.0), 4.0), stream[-1])
    said = estimates(system, stream)
    assert set(states(said)) == {"tracking"}
    assert max(one.diagnostics["p_lost"] for one in said) < 1e-6


def test_in_a_symmetric_room_dead_reckoning_says_which_of_two_places() -> None:
    """Where what was seen meanwhile fits the map nowhere."""
    hall = World2D(rectangle(-5.0, -3.0, 5.0, 3.0))
    system, last = mapped(hall)
    pose = at(system)
    hidden = going_on(still(NOWHERE, pose, 1.4), last)  # mirrors, say
    estimates(system, hidden)
    said = estimates(system, going_on(still(hall, pose, 4.0), hidden[-1]))
    assert "relocated" not in states(said)
    assert all(off_m(one, pose) < 0.03 for one in said)


@pytest.mark.parametrize(
    ("world", "place"),
    [(World2D(rectangle(-5.0, -2.0, 5.0, 2.0)), (3.0, 0.0, 1.5)), (ROOMS, MIRRORED)],
)
def test_a_robot_carried_to_one_of_two_places_alike_does_not_guess(
    world: World2D, place: Pose
) -> None:
    system, last = mapped(world, LONG_TURN)
    said = estimates(system, going_on(still(world, place, 4.0), last))
    assert "relocated" not in states(said)
    assert not any(one.converged for one in said)


def test_after_a_blind_stretch_all_its_odometry_is_in_doubt_not_only_the_last_step() -> None:
    world = World2D(arena())
    system, last = mapped(world)
    x, y, heading = at(system)
    dark = blind_turn(last, steps=400, said_rad=0.02, sd_rad=0.005)
    said = estimates(system, dark)
    assert set(states(said)) == {"blind"}
    assert not any(one.converged for one in said)
    there = (x, y, heading + 400 * 0.02 + 0.25)  # 2.5 standard deviations of all steps, 50 of one
    for frame in going_on(still(world, there, 1.0), dark[-1], 0.03):
        estimate = system.update(frame.without_truth())
        assert estimate.diagnostics["state"] == "tracking"
        assert off_m(estimate, there) < 0.02
        assert abs(off(estimate, there)[2]) < math.radians(1.2)


def test_a_scan_without_a_return_is_blind_in_the_midst_of_doubt_too() -> None:
    system, last = mapped(ROOMS, LONG_TURN)
    after = going_on(still(ROOMS, PLACE, 0.4), last)
    assert states(estimates(system, after[:1]))[0] in DOUBTFUL
    said = estimates(system, blind_turn(after[0], steps=2, said_rad=0.0, sd_rad=0.01))
    assert set(states(said)) == {"blind"}
    assert not any(one.converged for one in said)
    assert min(one.diagnostics["p_lost"] for one in said) > 0.01


@pytest.mark.parametrize("budget_ms", [10.0, 1e6])
def test_no_scan_of_a_lost_robot_does_more_than_its_budget_and_it_is_found(
    budget_ms: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    system = ShuntingSlam(FAST.changed({"matching.budget.budget_ms": budget_ms}))
    stream = frames(ROOMS, LONG_TURN, rate_hz=5.0, seed=3)
    estimates(system, stream)
    spent: list[float] = []
    plain = Places.explore

    def explore(places: Places, seen: Observations, budget: Budget) -> list[Place]:
        before = max(-budget.left_ns, 0.0)  # a search nearby is not cut short
        found = plain(places, seen, budget)
        spent.append(budget.spent_ns - before)
        return found

    monkeypatch.setattr(Places, "explore", explore)
    after = going_on(
        frames(ROOMS, Drive(PLACE, ((0.0, 0.3, 5.0),)), rate_hz=5.0, seed=7), stream[-1]
    )
    said = estimates(system, after)
    assert states(said).count("relocated") == 1
    assert off_m(said[-1], after[-1].truth) < 0.03
    prices = FAST.matching.budget
    counted = max(prices.lost_share, prices.frozen_share) * budget_ms * 1e6
    match_ns = 361 * prices.climb_ns + 90 * prices.approach_ns
    assert 0.0 < max(spent) <= counted + match_ns  # the item at which it is spent


@pytest.mark.parametrize(("led", "taken"), [((-2.0, 1.0, 2.0), True), ((60.0, 0.0, 0.0), False)])
def test_new_surface_alone_moves_nobody_elsewhere(led: Pose, taken: bool) -> None:
    """Where motion led to what was never in view nothing is missing, however well a place fits."""
    system, last = mapped(ROOMS)
    belief, numbers = system._belief, FAST.belief
    frame = going_on(still(ROOMS, PLACE, 0.2), last)[0]
    everyone = observe(frame, np.zeros(3), FAST).weighted(None)
    doubt = Doubt(system.cell_map, belief._matcher)
    doubt.evidence = -9.0
    doubt.match = unmatched(np.array(led), matched=0.0, score=0.0)
    place = Place(
        match=unmatched(np.array(PLACE), matched=1.0, score=1.0), latest=9.0, scans=numbers.again,
        way=np.array([1.0, 1.0, 2.0]),
    )  # fmt: skip
    assert belief._is_certain(doubt, place, everyone, goes_on=False) is taken


@pytest.mark.parametrize("hidden", [False, True])
def test_a_match_is_put_back_to_odometry_only_where_what_is_long_known_allows_it(
    monkeypatch: pytest.MonkeyPatch, hidden: bool
) -> None:
    """Odometry is what is off while walls are in view; among movers that hide them it is not."""
    system, last = mapped(ROOMS)
    pose, agreement = at(system), system._standing.agreement
    box = rectangle(pose[0] - 0.9, pose[1] - 0.9, pose[0] + 0.9, pose[1] + 0.9)
    room = World2D(np.concatenate([box, arena()])) if hidden else ROOMS
    monkeypatch.setattr(type(agreement), "denied", 10.0)
    monkeypatch.setattr(type(agreement), "is_far", True)
    monkeypatch.setattr(agreement, "led", lambda T: T + np.array([0.3, 0.0, 0.0]))
    estimates(system, going_on(still(room, pose, 0.2), last)[:1])
    moved_m = float(np.hypot(*(system._T_map_robot - pose)[:2]))
    assert moved_m == pytest.approx(0.3 if hidden else 0.0, abs=0.02)


def slid(disagreed: float, *, board: bool) -> float:
    """m, worst error of who stands with wheels that say so, while what it sees comes off by 5 cm/s.

    It is a board of 0.8 m in a corridor, known for 14 s; or a whole room, before which it slides.
    """
    system, stream = ShuntingSlam(FAST.changed({"standing.disagreed": disagreed})), []
    corridor = [[-90.0, -1.0, 90.0, -1.0], [90.0, 1.0, -90.0, 1.0]]
    for k in range(120):
        off = 0.01 * max(k - 70, 0)
        hall = World2D(np.array([*corridor, [2.0 + off, -0.4, 2.0 + off, 0.4]]))
        drive = Drive((0.0 if board else -off, 0.0, 0.0), ())
        step = frames(hall if board else ROOMS, drive, rate_hz=5.0, seed=k)
        stream += going_on(step, stream[-1]) if stream else step
    said = estimates(system, stream)
    return max(off_m(one, frame.truth) for one, frame in zip(said, stream, strict=True))


def test_a_board_takes_nobody_along_and_a_room_corrects_the_wheels() -> None:
    """The board is old surface by then: only odometry denies it, which a room outweighs."""
    disagreed = FAST.standing.disagreed
    assert slid(disagreed, board=True) < 0.15
    assert slid(0.0, board=True) > 0.4
    assert slid(disagreed, board=False) < 0.05


@pytest.mark.parametrize("kind", SLAMS)
def test_old_surface_holds_the_robot_and_holds_no_more_once_a_box_hides_it(
    kind: type[Tracker],
) -> None:
    """Also in scans that are not written: what they see of the map is not what hides it."""
    system, last = mapped(ROOMS, kind=kind)
    pose = at(system)
    held = system._standing.agreement
    seen = going_on(still(ROOMS, pose, 1.0), last)
    estimates(system, seen)
    walls = min(held._held[0, 0], held._held[1, 1]) / held._looks
    assert walls > 5.0  # half a metre at least, in both directions
    box = rectangle(pose[0] - 0.9, pose[1] - 0.9, pose[0] + 0.9, pose[1] + 0.9)
    hidden = World2D(np.concatenate([box, arena()]))
    estimates(system, going_on(still(hidden, pose, 0.8), seen[-1]))  # sooner than the box is known
    assert max(held._held[0, 0], held._held[1, 1]) / held._looks < 0.5 * walls

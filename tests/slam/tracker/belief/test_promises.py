# SPDX-License-Identifier: Apache-2.0
"""What a SLAM with one belief promises: found where carried, and nowhere else than it is."""

import math
from collections import Counter
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from scripts.integrity import plane
from scripts.integrity.kidnap import kidnapped
from scripts.integrity.plane import StreamSpec
from slam import se2
from slam.frames import Frame
from slam.frontend.observations import Observations, observe
from slam.frontend.odometry_prior import Prediction
from slam.shunting import ShuntingConfig, ShuntingSlam
from slam.tracker.belief.belief import NEGLIGIBLE, Belief, Judged
from slam.tracker.belief.episode import Episode
from slam.tracker.belief.evidence import Evidence
from slam.tracker.belief.places import Place, Places
from slam.tracker.belief.posterior import Odds
from slam.tracker.cells import used
from slam.tracker.matching.budget import Budget
from slam.tracker.matching.matcher import Match, Matcher, unmatched
from slam.tracker.standing.agreement import Agreement
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
    made,
    mapped,
    off,
    off_m,
    states,
    still,
    told,
)
from tests.world2d import Drive, World2D, arena, frames, going_on, laser, rectangle

ELSEWHERE = Drive((-2.6, 1.5, 2.2), ((0.0, 0.3, 16.0),))
OTHER_PLACES = [(2.0, -2.0, 2.0), (-2.6, 1.5, 2.2), (3.0, 2.5, -1.0), (-3.5, -2.8, 0.4)]


@pytest.mark.parametrize("kind", SLAMS)
@pytest.mark.parametrize("place", OTHER_PLACES)
def test_a_carried_robot_is_found_and_at_no_wrong_place(kind: type[Tracker], place: Pose) -> None:
    """Whatever it says that is to be believed is right, and the map is not written till then."""
    system, last = mapped(ROOMS, LONG_TURN, kind)
    drive = Drive(place, ((0.2, 0.3, 8.0),))
    before = system.window(-5.5, -4.5, 5.5, 4.5)
    after = going_on(frames(ROOMS, drive, rate_hz=5.0, seed=7), last)
    found = False
    for frame in after:
        estimate = system.update(frame.without_truth())
        state = estimate.diagnostics["state"]
        found |= state == "relocated"
        assert (state in DOUBTFUL) == (not found)
        if found:
            assert off_m(estimate, frame.truth) < 0.05
            continue
        assert not estimate.converged
        for old, now in zip(before, system.window(-5.5, -4.5, 5.5, 4.5), strict=True):
            np.testing.assert_array_equal(now, old)
    assert found
    assert state == "tracking"


def test_a_carried_robot_is_lost_until_it_is_found_and_then_its_map_is_right() -> None:
    system, last = mapped(ROOMS, LONG_TURN)
    drive = Drive((2.0, -2.0, 2.0), ((0.2, 0.3, 4.0),))
    said = told(system, going_on(frames(ROOMS, drive, rate_hz=5.0, seed=7), last))
    assert "lost" in states(said)
    for one in said:
        words = one.diagnostics
        if words["state"] == "lost":
            assert words["verdict"] == "lost"
            assert words["p_lost"] >= 0.5
        elif words["state"] in ("tracking", "relocated"):
            assert words["verdict"] == "tracking"
            assert words["p_lost"] < 0.5
    assert states(said)[-1] == "tracking"


def test_places_move_by_odometry_where_it_denies_the_match(monkeypatch: pytest.MonkeyPatch) -> None:
    """The old map pulls the first match after a kidnap: from there the next one jumps back."""
    system, last = mapped(ROOMS, LONG_TURN)
    first, second, *_ = going_on(still(ROOMS, (3.0, 2.5, -1.0), 0.8), last)
    system.update(first.without_truth())
    belief, jump = system._belief, np.array([0.13, -0.05, 0.04])
    plain = belief._match

    def pulled(*arguments: Any) -> Match:
        match = plain(*arguments)
        return replace(match, T_map_robot=match.T_map_robot + jump)

    monkeypatch.setattr(belief, "_match", pulled)
    monkeypatch.setattr(belief, "_dragged", lambda *_: 0.0)  # which would be odometry, too
    system.update(second.without_truth())
    assert belief._episode is not None
    assert belief._episode.matched
    _, since_first = belief._episode.places._kept[0]
    assert since_first == pytest.approx(np.zeros(3), abs=5e-3)


def test_places_move_as_surely_as_match_and_odometry_together(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Else a few returns among people turn a place by what odometry alone may be off."""
    system, last = mapped(ROOMS, LONG_TURN)
    config, plain = system.config.standing, Places.follow
    moved: list[tuple[Prediction, Prediction]] = []

    def follow(self: Places, *arguments: Any) -> None:
        moved.append((arguments[1], odometry[-1]))
        plain(self, *arguments)

    odometry, judge = [], system._belief.judge

    def judged(*arguments: Any) -> Any:
        odometry.append(arguments[3])
        return judge(*arguments)

    monkeypatch.setattr(Places, "follow", follow)
    monkeypatch.setattr(system._belief, "judge", judged)
    told(system, going_on(still(ROOMS, (3.0, 2.5, -1.0), 1.6), last))
    followed = [(by, said) for by, said in moved if by is not said]
    assert followed
    R = np.diag([config.match_m**2] * 2 + [math.radians(config.match_deg) ** 2])
    for by, said in followed:
        off = said.off(by.T_map_robot)
        surest = np.linalg.inv(np.linalg.inv(said.step) + np.linalg.inv(R + np.outer(off, off)))
        for more, less in ((said.step, by.step), (by.step, surest)):
            assert np.linalg.eigvalsh(more - less).min() > -1e-9
        assert by.step[2, 2] < 0.7 * said.step[2, 2]  # the copy shows the heading, too


@pytest.mark.parametrize("kind", SLAMS)
def test_who_is_believed_again_follows_other_places_until_next_to_nothing_speaks_for_them(
    kind: type[Tracker], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A search may find where the robot was carried only when it is believed elsewhere already."""
    taken, plain = [], Belief._found

    def taking(*arguments: Any, **more: Any) -> Judged:
        taken.append(plain(*arguments, **more))
        return taken[-1]

    monkeypatch.setattr(Belief, "_found", taking)  # one elsewhere, or a slip
    system = kind()
    belief, least, believed = system._belief, NEGLIGIBLE * system.config.belief.frozen_above, 0
    for frame in plane.frames(StreamSpec(kind="boards10", seed=3, seconds=40.0)):
        taken.clear()
        before, estimate = belief.certain, system.update(frame.without_truth())
        if not belief.certain and estimate.converged:
            believed += 1
            assert belief._p_off <= system.config.belief.frozen_above
        if belief.certain and not before:
            assert taken or belief._p_far <= least
    assert believed


def believed_among_others(kind: type[Tracker]) -> tuple[Tracker, list[Frame], int]:
    """A robot that is believed and follows other places, its stream, and its latest scan."""
    system, stream = kind(), plane.frames(StreamSpec(kind="boards10", seed=3, seconds=40.0))
    for last, frame in enumerate(stream):
        estimate = system.update(frame.without_truth())
        if estimate.converged and last > 100 and not system._belief.certain:
            return system, stream, last
    pytest.fail("it never was")


@pytest.mark.parametrize("kind", SLAMS)
@pytest.mark.parametrize("start", [100, 150])
def test_who_is_carried_while_other_places_are_followed_knows_it(
    kind: type[Tracker], start: int
) -> None:
    system, stream, last = believed_among_others(kind)
    belief, doubt = system._belief, system._belief.doubt
    for k, frame in enumerate(kidnapped(stream[: last + 1], stream, start, 25)):
        said = system.update(frame.without_truth())
        moved = se2.between(np.asarray(stream[0].truth), np.asarray(frame.truth))
        assert not said.converged or off_m(said, moved) < 0.5
        if k < 3:
            assert said.diagnostics["state"] == "lost"
            assert belief.doubt is not doubt  # a new one, on the copy


@pytest.mark.parametrize("trusted", [True, False])
def test_what_was_written_at_a_wrong_place_is_undone(
    trusted: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """If the robot is found elsewhere after it was believed; who never was wrote nothing."""
    system, stream, last = believed_among_others(ShuntingSlam)
    doubt, keys = system._belief.doubt, system._loops.keys
    assert doubt is not None
    assert doubt.trusted
    assert system.cell_map is doubt.local
    for key in range(-3, 0):  # the latest were all written
        keys[key] = replace(keys[key], written=True)
    system._doubted_since, old = keys[-3].frame, [key.written for key in keys[:-3]]
    doubt.trusted = trusted
    there = Place(
        match=unmatched(np.array([1.0, 1.0, 1.0]), matched=1.0, score=0.0), evidence=Evidence()
    )

    def found(*_: Any) -> Judged:
        return system._belief._found(there, doubt, prediction, writes=False)

    prediction = system._predict(stream[last + 1].odometry)
    monkeypatch.setattr(system._belief, "judge", found)
    said = system.update(stream[last + 1].without_truth())
    assert said.diagnostics["state"] == "relocated"
    assert system.cell_map is doubt.cell_map
    left = [key.written for key in keys]
    assert left[: len(old)] == old
    assert left[len(old) : len(old) + 3] == [not trusted] * 3


def test_the_covariance_of_a_lost_robot_covers_all_that_it_has_seen() -> None:
    system, last = mapped(ROOMS, LONG_TURN)
    lost = 0
    for frame in going_on(frames(ROOMS, ELSEWHERE, rate_hz=5.0, seed=4), last):
        estimate = system.update(frame.without_truth())
        error = off(estimate, frame.truth)
        if estimate.diagnostics["state"] == "lost":
            lost += 1
            assert error @ np.linalg.solve(estimate.covariance, error) < 11.3  # 3 numbers, 99 %
    assert lost
    assert estimate.covariance[0, 0] < 0.1**2  # found
    assert off_m(estimate, frame.truth) < 0.05


@pytest.mark.parametrize("preset", ["robust", "paper"])
def test_the_paper_s_map_is_never_in_doubt(preset: str) -> None:
    """Nor that of a robot of which it is said that nobody carries it."""
    config = ShuntingConfig.preset(preset).changed({"cell_m": 0.05, "carried_per_h": 0.0})
    assert ShuntingConfig.paper().carried_per_h == 0.0
    system = ShuntingSlam(config)
    stream = frames(ROOMS, TURN, rate_hz=5.0, seed=3)
    stream += going_on(still(ROOMS, (2.0, -2.0, 2.0), 4.0), stream[-1])
    said = told(system, stream)
    assert set(states(said)) == {"tracking"}
    assert max(one.diagnostics["p_lost"] for one in said) < 1e-6


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


@pytest.mark.parametrize("push", [(0.3, 0.0, 0.0), (-0.2, 0.22, 0.0), (0.1, 0.1, 0.35)])
def test_a_robot_that_is_pushed_far_is_followed_or_found(push: tuple[float, float, float]) -> None:
    system, last = mapped(ROOMS, LONG_TURN)
    aside: Any = tuple((np.array(at(system)) + push).tolist())
    said = told(system, going_on(still(ROOMS, aside, 3.0), last))
    believed = [one for one in said if one.converged]
    assert max(off_m(one, aside) for one in believed) < 0.1
    assert said[-1].converged
    assert off_m(said[-1], aside) < 0.03


@pytest.mark.parametrize("shows", [True, False])
def test_a_place_nearby_is_only_looked_for_where_old_surface_shows_it(
    shows: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    system, last = mapped(ROOMS, LONG_TURN)
    if not shows:
        monkeypatch.setattr(Agreement, "shown", lambda *_: np.zeros((3, 3)))
    plain, nearby = Places.begun, []

    def begun(places: Places, *arguments: Any) -> Place:
        nearby.append(plain(places, *arguments))
        return nearby[-1]

    monkeypatch.setattr(Places, "begun", begun)
    x, y, heading = at(system)
    aside = (x + 0.3, y, heading)
    first, *_ = going_on(still(ROOMS, aside, 1.0), last)
    system.update(first.without_truth())
    assert len(nearby) == shows
    assert all(abs(place.match.T_map_robot - aside).max() < 0.05 for place in nearby)


def test_in_a_symmetric_room_dead_reckoning_says_which_of_two_places() -> None:
    """Where what was seen meanwhile fits the map nowhere."""
    hall = World2D(rectangle(-5.0, -3.0, 5.0, 3.0))
    system, last = mapped(hall)
    pose = at(system)
    corners = np.array([(-8.0, -7.0), (9.0, -10.0), (12.0, 5.0), (0.0, 11.0), (-9.0, 6.0)])
    elsewhere = World2D(np.hstack([corners, np.roll(corners, 1, axis=0)]))  # mirrors, say
    hidden = going_on(still(elsewhere, pose, 1.4), last)
    told(system, hidden)
    said = told(system, going_on(still(hall, pose, 4.0), hidden[-1]))
    assert "relocated" not in states(said)
    assert all(off_m(one, pose) < 0.03 for one in said)


def test_a_robot_carried_to_one_of_two_places_alike_does_not_guess() -> None:
    hall = World2D(rectangle(-5.0, -2.0, 5.0, 2.0))
    system, last = mapped(hall)
    after = going_on(still(hall, (3.0, 0.0, 1.5), 4.0), last)
    said = told(system, after)
    assert "relocated" not in states(said)
    assert not any(one.converged for one in said)


@pytest.mark.parametrize(("give_up_s", "found"), [(4.0, True), (1000.0, False)])
def test_who_leaves_the_map_in_doubt_is_believed_after_a_while(
    give_up_s: float, found: bool
) -> None:
    """Not sooner: what stands on the map in view may still tell."""
    parts = (-5.0, -2.0, 60.0, 2.0), (-3.0, 1.0, -2.2, 1.6), (2.0, -1.8, 3.2, -1.2)
    hall = World2D(np.vstack([rectangle(*part) for part in (*parts, (5.0, 1.2, 5.6, 2.0))]))
    short = laser(181, range_max=8.0)  # m; the map ends there
    # so that the doubt lasts until the map is left
    numbers = {"belief.frozen_above": 6e-4, "tracking.give_up_s": give_up_s}
    system = ShuntingSlam(FAST.changed(numbers))
    stream = frames(hall, TURN, rate_hz=5.0, seed=3, spec=short)
    told(system, stream)
    drive = Drive((2.0, 0.5, 1.0), ((0.0, 0.4, 1.0), (0.0, -1.4, 1.0), (1.5, 0.0, 12.0)))
    after = frames(hall, drive, rate_hz=5.0, seed=7, spec=short)
    x, y, _ = np.asarray(after[25].truth)
    closed = World2D(np.vstack([hall.segments, rectangle(x - 0.6, y - 0.6, x + 0.6, y + 0.6)]))
    box = frames(closed, drive, rate_hz=5.0, seed=7, spec=short)[25]  # people about it, one scan
    after[25] = replace(after[25], scan=box.scan)
    for frame in going_on(after, stream[-1]):
        estimate = system.update(frame.without_truth())
        assert not estimate.converged or off_m(estimate, frame.truth) < 0.2
        assert frame.truth is not None
        assert frame.truth[0] > 6.0 or not estimate.converged  # walls of the map are in view
    assert estimate.converged == found


def test_a_robot_carried_to_where_all_in_view_hides_the_map_knows_it() -> None:
    """Nothing there contradicts the map: the near wall stands before everything it shows."""
    system, last = mapped(ROOMS, LONG_TURN)
    there = (-2.6, 1.5, 2.2)
    said = told(system, going_on(still(ROOMS, there, 2.0), last))
    assert all(one.diagnostics["state"] in DOUBTFUL or off_m(one, there) < 0.1 for one in said)


def test_after_a_blind_stretch_all_its_odometry_is_in_doubt_not_only_the_last_step() -> None:
    world = World2D(arena())
    system, last = mapped(world)
    x, y, heading = at(system)
    dark = blind_turn(last, steps=400, said_rad=0.02, sd_rad=0.005)
    said = told(system, dark)
    assert set(states(said)) == {"blind"}
    assert {one.diagnostics["verdict"] for one in said} == {"blind"}
    assert not any(one.converged for one in said)
    there = (x, y, heading + 400 * 0.02 + 0.25)  # 2.5 standard deviations of all steps, 50 of one
    for frame in going_on(still(world, there, 1.0), dark[-1], 0.03):
        estimate = system.update(frame.without_truth())
        assert estimate.diagnostics["state"] == "tracking"
        assert off_m(estimate, there) < 0.02
        assert abs(off(estimate, there)[2]) < math.radians(1.2)


def test_a_scan_without_a_return_is_blind_in_the_midst_of_doubt_too() -> None:
    system, last = mapped(ROOMS, LONG_TURN)
    after = going_on(still(ROOMS, (-2.6, 1.5, 2.2), 0.4), last)
    assert states(told(system, after[:1]))[0] in DOUBTFUL
    said = told(system, blind_turn(after[0], steps=2, said_rad=0.0, sd_rad=0.01))
    assert {one.diagnostics["verdict"] for one in said} == {"blind"}
    assert not any(one.converged for one in said)


def carried(
    budget_ms: float, monkeypatch: pytest.MonkeyPatch
) -> tuple[Counter[str], list[float], float]:
    """States of a robot that is carried elsewhere, the work of each scan, the last error."""
    config = FAST.changed({"matching.budget.budget_ms": budget_ms})
    system = ShuntingSlam(config)
    stream = frames(ROOMS, LONG_TURN, rate_hz=5.0, seed=3)
    told(system, stream)
    said: Counter[str] = Counter()
    spent: list[float] = []
    plain = Places.explore

    def explore(places: Places, seen: Observations, budget: Budget) -> list[Place]:
        before = max(-budget.left_ns, 0.0)  # a search nearby is not cut short
        found = plain(places, seen, budget)
        spent.append(budget.spent_ns - before)
        return found

    monkeypatch.setattr(Places, "explore", explore)
    for frame in going_on(frames(ROOMS, ELSEWHERE, rate_hz=5.0, seed=7), stream[-1]):
        estimate = system.update(frame.without_truth())
        said.update(states([estimate]))
    assert estimate.diagnostics["state"] in ("tracking", "frozen", "lost")
    return said, spent, off_m(estimate, frame.truth)


@pytest.mark.parametrize("budget_ms", [10.0, 20.0, 1e6])
def test_no_scan_of_a_lost_robot_does_more_than_its_budget_and_it_is_found(
    budget_ms: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    said, spent, error_m = carried(budget_ms, monkeypatch)
    assert said["relocated"] <= 1  # more work is more places: it may take longer to be sure
    if said["relocated"]:
        assert error_m < 0.03
    prices = FAST.matching.budget
    counted = max(prices.lost_share, prices.frozen_share) * budget_ms * 1e6
    kept_ns = (FAST.tracking.relocalise.kept + 1) * 5000 * prices.weigh_ns  # cells in view
    match_ns = 361 * prices.climb_ns + 90 * prices.approach_ns + kept_ns
    if budget_ms == 10.0:
        assert max(spent) > 0.0  # it took more than a scan
    assert max(spent) <= counted + match_ns  # the item at which it is spent


@pytest.mark.parametrize("kind", SLAMS)
def test_what_the_local_copy_sees_is_not_in_the_map(kind: type[Tracker]) -> None:
    system, stream = made(kind), frames(World2D(arena()), TURN, rate_hz=5.0, seed=3)
    told(system, stream[:30])
    before = [array.copy() for array in system.cell_map.cells]
    odds = Odds(system.config.belief, system.config.carried_per_h)
    episode = Episode(system.cell_map, Matcher(system.config), odds, 0.2)
    observations = observe(stream[30], np.zeros(3), system.config)
    for _ in range(20):
        episode.write(observations, np.array([0.4, -0.3, 0.2]), 0.2)
    for one, other in zip(before, system.cell_map.cells, strict=True):
        np.testing.assert_array_equal(one, other)
    assert not np.array_equal(episode.local.cells.y, system.cell_map.cells.y)


def test_the_local_copy_grows_no_further_than_by_its_bound(monkeypatch: pytest.MonkeyPatch) -> None:
    """Who is lost for hours drives through more than is ever matched again."""
    monkeypatch.setattr("slam.tracker.belief.episode.MOST_NEW", 40)
    system, last = mapped(ROOMS)
    odds = Odds(system.config.belief, system.config.carried_per_h)
    lost = Episode(system.cell_map, Matcher(system.config), odds, 0.2)
    frame = going_on(still(ROOMS, at(system), 0.2), last)[0]
    seen, known, grown = observe(frame, np.zeros(3), system.config), used(system.cell_map.cells), []
    for k in range(20):
        lost.write(seen, np.array([20.0 * (k + 1), 0.0, 0.0]), 0.2)
        grown.append(used(lost.local.cells) - known)
    assert 40 < max(grown) <= 40 + 2 * grown[0]
    assert used(system.cell_map.cells) == known


def test_a_false_alarm_that_movers_carried_the_matches_off_changes_nothing(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """It is taken back to where odometry leads, and the map says in the same scan where it is."""
    system, last = mapped(ROOMS)
    pose = at(system)
    stream = going_on(still(ROOMS, pose, 2.0), last)
    with monkeypatch.context() as patched:
        patched.setattr(system._standing.agreement, "dragged", lambda: 0.9)
        patched.setattr(
            system._standing.agreement, "undragged", lambda T, _: T + np.array([0.15, 0.0, 0.0])
        )
        said = told(system, stream[:1])
    said += told(system, stream[1:])
    assert max(off_m(one, pose) for one in said) < 0.02
    assert said[-1].converged


@pytest.mark.parametrize(("hidden", "stays"), [(False, True), (True, False)])
def test_a_match_is_put_back_to_odometry_only_where_what_is_long_known_allows_it(
    monkeypatch: pytest.MonkeyPatch, hidden: bool, stays: bool
) -> None:
    """Odometry is what is off while walls are in view; among movers that hide them it is not."""
    system, last = mapped(ROOMS)
    pose = at(system)
    box = rectangle(pose[0] - 0.9, pose[1] - 0.9, pose[0] + 0.9, pose[1] + 0.9)
    room = World2D(np.concatenate([box, arena()])) if hidden else ROOMS
    monkeypatch.setattr(system._standing.agreement, "dragged", lambda: 0.9)
    monkeypatch.setattr(
        system._standing.agreement, "put_back", lambda T: T + np.array([0.3, 0.0, 0.0])
    )
    said = told(system, going_on(still(room, pose, 0.2), last)[:1])[0]
    moved_m = float(np.hypot(*(system._T_map_robot - pose)[:2]))
    assert (moved_m < 0.02) == stays, said.diagnostics


@pytest.mark.parametrize("kind", SLAMS)
def test_old_surface_holds_the_robot_and_holds_no_more_once_a_box_hides_it(
    kind: type[Tracker],
) -> None:
    """Also in scans that are not written: what they see of the map is not what hides it."""
    system, last = mapped(ROOMS, kind=kind)
    pose = at(system)
    held = system._standing.agreement
    seen = going_on(still(ROOMS, pose, 1.0), last)
    told(system, seen)
    walls = min(held._held[0], held._held[3]) / held._looks
    assert walls > 5.0  # half a metre at least, in both directions
    box = rectangle(pose[0] - 0.9, pose[1] - 0.9, pose[0] + 0.9, pose[1] + 0.9)
    hidden = World2D(np.concatenate([box, arena()]))
    told(system, going_on(still(hidden, pose, 2.5), seen[-1]))
    assert max(held._held[0], held._held[3]) / held._looks < 0.5 * walls


def test_boards_that_stood_for_long_do_not_carry_the_robot_along_when_they_move(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """They are old surface by then. Odometry denies what they do, and the map prefers odometry."""
    stream = plane.frames(StreamSpec(kind="moved30_calm", seed=140005, seconds=150.0))
    worst_m = {}
    for suspects in (True, False):
        system, start = ShuntingSlam(), stream[0].truth
        if not suspects:
            monkeypatch.setattr(Agreement, "suspected", property(lambda own: own.dragged() > 0.5))
        worst_m[suspects] = 0.0
        for frame in stream[:620]:
            estimate = system.update(frame.without_truth())
            assert start is not None
            assert frame.truth is not None
            off = off_m(estimate, se2.between(start, frame.truth))
            worst_m[suspects] = max(worst_m[suspects], off)
    assert worst_m[True] < 0.5 < 0.8 < worst_m[False]

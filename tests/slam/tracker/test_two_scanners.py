# SPDX-License-Identifier: Apache-2.0
"""A robot with two scanners: each scan is taken with its own mount, view and time."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from slam import create, se2
from slam.frames import Frame, LaserSpec
from slam.replay import Replay, Track
from slam.tracker.matching.matcher import Matcher
from slam.tracker.scanners import Scanners
from tests.world2d import Chairs, Drive, World2D, arena, frames, laser, office, office_loop, wander

HZ = 10.0
FRONT = replace(laser(181, range_max=25.0), T_robot_laser=np.array([0.3, 0.0, 0.0]))
REAR = replace(laser(121, range_max=15.0), T_robot_laser=np.array([-0.3, 0.1, math.pi]))
HALF, MOMENT = 0.5 / HZ, 1e-9  # s between the scans of the two: in turns, or at once


def run(name: str, stream: list[Frame]) -> Track:
    replay = Replay.of({name: create(name)})
    for _ in replay.run(stream):
        pass
    return replay.tracks[name]


def off_m(track: Track, stream: list[Frame]) -> float:
    poses = np.array([se2.between(stream[0].truth, frame.truth) for frame in stream])
    apart = track.online().poses[:, :2] - poses[:, :2]
    return math.sqrt(float((apart * apart).sum(axis=1).mean()))


def driven(world: World2D, drive: Drive, spec: Any, apart_s: float = 0.0) -> list[Frame]:
    return frames(world, drive, rate_hz=HZ, spec=spec, apart_s=apart_s, seed=3)


@pytest.mark.parametrize("name", ["shunting", "occupancy"])
@pytest.mark.parametrize("apart_s", [HALF, MOMENT])
def test_both_scanners_keep_their_places_among_chairs_that_move(name: str, apart_s: float) -> None:
    chairs = Chairs.random(12, (-4.5, -3.5, 4.5, 3.5), 20.0, 0.3, 1)
    stream = driven(World2D(arena(), chairs), wander(15.0), [FRONT, REAR], apart_s)
    track = run(name, stream)
    assert off_m(track, stream) < 0.015
    assert all(estimate.converged for estimate in track.estimates)
    matched = [estimate.diagnostics["matched"] for estimate in track.estimates]
    assert min(np.mean(matched[::2]), np.mean(matched[1::2])) > 0.9


def test_the_rear_s_view_is_in_the_map_as_soon_as_the_front_s() -> None:
    """Standing in the middle: the front sees one half of the walls, the rear the other."""
    still = Drive((0.0, 0.0, 0.0), ((0.0, 0.0, 2.0),))
    halves = []
    for spec, apart_s in (([FRONT, REAR], MOMENT), ([FRONT], 0.0)):
        raster = run("shunting", driven(World2D(arena()), still, spec, apart_s)).map()
        assert raster is not None
        there = np.argwhere(np.nan_to_num(raster.values) > 0.5)[:, 1] * raster.resolution_m
        x = there + raster.T_map_origin[0]
        halves.append((int((x > 0.5).sum()), int((x < -0.5).sum())))
    (front, rear), (alone, nothing) = halves
    assert nothing == 0
    assert front == pytest.approx(alone, rel=0.1)
    assert rear == pytest.approx(front, rel=0.35)  # fewer beams, and a pillar ahead


@pytest.mark.slow
def test_round_a_corridor_two_scanners_are_no_worse_than_one() -> None:
    world, drive = World2D(office()), office_loop()
    one, both = (driven(world, drive, spec, HALF) for spec in ([FRONT], [FRONT, REAR]))
    single, double = run("shunting", one), run("shunting", both)
    assert off_m(double, both) < off_m(single, one) + 0.002
    assert np.mean([estimate.converged for estimate in double.estimates]) > 0.999
    assert single.system._loops.edges
    assert double.system._loops.edges


def test_one_scanner_is_what_it_was_whatever_the_geometry_of_its_scans() -> None:
    """A mount makes a scanner, not its beams: drivers whose scans vary have one."""
    fewer = replace(laser(180, range_max=25.0), T_robot_laser=FRONT.T_robot_laser)
    kept = Scanners(Matcher(create("shunting").config))
    looks = [kept.look(frame) for frame in of(FRONT, fewer, FRONT)]
    assert looks == [None, None, None]
    assert not kept.new


def test_a_scanner_s_look_is_since_its_own_last_one_and_it_has_its_own_usual_match() -> None:
    matcher = Matcher(create("shunting").config)
    kept = Scanners(matcher)
    first, *others = of(FRONT, REAR, FRONT, REAR, REAR)
    usual = matcher.usual
    assert kept.look(first) is None
    assert kept.look(others[0]) == matcher.config.map.first_look_s
    assert kept.new
    assert matcher.usual is not usual
    assert kept.look(others[1]) == pytest.approx(2.0)
    assert not kept.new
    assert matcher.usual is usual
    assert [kept.look(frame) for frame in others[2:]] == pytest.approx([2.0, 1.0])


def of(*specs: LaserSpec) -> list[Frame]:
    """A frame a second of those scanners."""
    still = Drive((0.0, 0.0, 0.0), ((0.0, 0.0, 10.0),))
    made = [frames(World2D(arena()), still, rate_hz=1.0, spec=spec) for spec in specs]
    return [one[k] for k, one in enumerate(made)]

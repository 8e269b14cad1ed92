# SPDX-License-Identifier: Apache-2.0
"""What somebody may ask of a world, bounded and checked, and how it is done between two scans."""

import math
from dataclasses import dataclass
from typing import Annotated

from msgspec import Meta

from sim.world import hands
from sim.world.hands import MOST_HOLD_S, MOST_SPEED
from sim.world.world import World
from slam.shaped import Metres, Point, Word, check


@dataclass(frozen=True, kw_only=True)
class Push:
    """Push a thing; "" for the nearest to the robot.

    speed    m/s, at most
    heading  rad; None: away from the robot, or ``towards`` a place (x m, y m)
    """

    name: Word = ""
    speed: Annotated[float, Meta(ge=0.05, le=MOST_SPEED)] = 1.0
    heading: Annotated[float, Meta(ge=-100.0, le=100.0)] | None = None
    towards: tuple[Metres, Metres] | None = None

    def __post_init__(self) -> None:
        check(self)


@dataclass(frozen=True, kw_only=True)
class MoveDoor:
    """Hold a door, "" for the nearest to the robot, open or shut for so long, s."""

    opened: bool
    name: Word = ""
    seconds: Annotated[float, Meta(ge=0.1, le=MOST_HOLD_S)] = 20.0

    def __post_init__(self) -> None:
        check(self)


@dataclass(frozen=True, kw_only=True)
class Kidnap:
    """Carry the robot to a pose (m, m, rad) in the world, to a goal, or to the farthest goal."""

    pose: Point | None = None
    goal: Word = ""

    def __post_init__(self) -> None:
        check(self)


def carry_out(world: World, request: Push | MoveDoor | Kidnap) -> str:
    """Do it to the world as it is now; what was done, in words.

    Raises a ``MobiliaError`` that says why it cannot be done.
    """
    if isinstance(request, Push):
        return _push(world, request)
    if isinstance(request, MoveDoor):
        return _door(world, request)
    pose = request.pose or hands.free_goal(world, request.goal)
    hands.carry(world, pose)
    return f"the robot is carried to ({pose[0]:.2f}, {pose[1]:.2f})"


def _push(world: World, request: Push) -> str:
    rx, ry, _ = world.robot_pose().tolist()
    name = request.name or hands.nearest(world, hands.pushable(world), rx, ry)[0]
    heading = request.heading
    if heading is None:
        rows = [k for k, own in enumerate(world.mover_names) if own == name]
        x, y = world.mover_poses()[rows[0], :2].tolist() if rows else (rx, ry)
        heading = math.atan2(y - ry, x - rx)
        if request.towards is not None:
            heading = math.atan2(request.towards[1] - y, request.towards[0] - x)
    speed = hands.push(world, name, request.speed, heading)
    return f"{name} is pushed at {speed:.2g} m/s to {math.degrees(heading):.0f} deg"


def _door(world: World, request: MoveDoor) -> str:
    rx, ry, _ = world.robot_pose().tolist()
    name = request.name or hands.nearest(world, world.doors.names, rx, ry)[0]
    hands.hold_door(world, name, opened=request.opened, seconds=request.seconds)
    return f"{name} is held {'open' if request.opened else 'shut'} for {request.seconds:g} s"

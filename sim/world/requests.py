# SPDX-License-Identifier: Apache-2.0
"""What somebody may ask of a world, bounded and checked, and how it is done between two scans."""

from __future__ import annotations

import math
from dataclasses import dataclass

from sim.core.checks import FAR_M, numbers, switch, three, within, word
from sim.world import hands
from sim.world.hands import MOST_HOLD_S, MOST_SPEED
from sim.world.world import World


@dataclass(frozen=True, kw_only=True)
class Push:
    """Push a thing; "" for the nearest to the robot.

    speed    m/s, at most
    heading  rad; None: away from the robot, or ``towards`` a place (x m, y m)
    """

    name: str = ""
    speed: float = 1.0
    heading: float | None = None
    towards: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        word("push: name", self.name)
        within("push: speed", self.speed, 0.05, MOST_SPEED)
        within("push: heading", self.heading or 0.0, -100.0, 100.0)
        if self.towards is not None:
            for value in numbers("push: towards", self.towards, 2, "two numbers, x and y in m"):
                within("push: towards", value, -FAR_M, FAR_M)


@dataclass(frozen=True, kw_only=True)
class MoveDoor:
    """Hold a door, "" for the nearest to the robot, open or shut for so long, s."""

    opened: bool
    name: str = ""
    seconds: float = 20.0

    def __post_init__(self) -> None:
        switch("door: opened", self.opened)
        word("door: name", self.name)
        within("door: seconds", self.seconds, 0.1, MOST_HOLD_S)


@dataclass(frozen=True, kw_only=True)
class Kidnap:
    """Carry the robot to a pose (m, m, rad) in the world, to a goal, or to the farthest goal."""

    pose: tuple[float, float, float] | None = None
    goal: str = ""

    def __post_init__(self) -> None:
        word("kidnap: goal", self.goal)
        if self.pose is not None:
            three("kidnap: pose", self.pose)


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

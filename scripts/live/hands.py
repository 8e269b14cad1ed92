# SPDX-License-Identifier: Apache-2.0
"""What a client does to the world, between two scans, and who drives the robot."""

from __future__ import annotations

import math
from collections.abc import Iterator

from scripts.live.requests import Drive, Kidnap, MoveDoor, OnWorld, Push, Touch, Tour
from sim.driving.pilot import Pilot
from sim.moments import Moment, observed
from sim.simulation import Simulation, n_frames
from sim.world import hands
from slam.errors import InvalidValueError
from slam.frames import NS_PER_S

HOLD_NS = NS_PER_S  # a twist holds so long, then the robot stands: its sender may be gone
REACH_M = 1.0  # of a click: what is farther from it was not meant


class Hands:
    """Carries out requests on a simulation's world and steers its robot.

    client_drives  whether a client does, from its first twist until it gives the robot back
    """

    def __init__(self, simulation: Simulation) -> None:
        self.simulation = simulation
        self.client_drives = False
        self._twist, self._asked_ns = Drive(v=0.0, omega=0.0), -HOLD_NS

    def moments(self, seconds: float) -> Iterator[Moment]:
        """A tour of ``seconds``, as ``sim.moments.toured`` where no client drives."""
        simulation, world = self.simulation, self.simulation.world
        pilot, period_s = Pilot(world), simulation.scan_period_s
        for _ in range(n_frames(seconds, period_s)):
            world.set_command(*self._steer(pilot.command(period_s)))
            yield observed(simulation)

    def _steer(self, tour: tuple[float, float]) -> tuple[float, float]:
        if not self.client_drives:
            return tour
        if self.simulation.world.time_ns - self._asked_ns > HOLD_NS:
            return 0.0, 0.0
        return self._twist.v, self._twist.omega

    def do(self, request: OnWorld) -> str:
        """Do it to the world as it is now; what was done, in words.

        Raises a ``MobiliaError`` that says why it cannot be done.
        """
        if isinstance(request, Drive):
            self.client_drives = True
            self._twist, self._asked_ns = request, self.simulation.world.time_ns
            return "the robot takes twists"
        if isinstance(request, Tour):
            self.client_drives = False
            return "the built-in driver drives"
        if isinstance(request, Push):
            return self._push(request)
        if isinstance(request, MoveDoor):
            return self._door(request)
        if isinstance(request, Touch):
            return self._touch(request)
        return self._kidnap(request)

    def _push(self, request: Push) -> str:
        world = self.simulation.world
        rx, ry, _ = world.robot_pose().tolist()
        name = request.name or hands.nearest(world, hands.pushable(world), rx, ry)[0]
        heading = request.heading
        if heading is None:
            rows = [k for k, own in enumerate(world.mover_names) if own == name]
            x, y = world.mover_poses()[rows[0], :2].tolist() if rows else (rx, ry)
            heading = math.atan2(y - ry, x - rx)
        speed = hands.push(world, name, request.speed, heading)
        return f"{name} is pushed at {speed:.2g} m/s to {math.degrees(heading):.0f} deg"

    def _door(self, request: MoveDoor) -> str:
        world = self.simulation.world
        rx, ry, _ = world.robot_pose().tolist()
        name = request.name or hands.nearest(world, world.doors.names, rx, ry)[0]
        hands.hold_door(world, name, opened=request.opened, seconds=request.seconds)
        return f"{name} is held {'open' if request.opened else 'shut'} for {request.seconds:g} s"

    def _touch(self, request: Touch) -> str:
        world = self.simulation.world
        doors, things = world.doors.names, hands.pushable(world)
        name, apart = request.name, 0.0
        if name not in (*doors, *things):
            name, apart = hands.nearest(world, [*things, *doors], request.x, request.y)
        if apart > REACH_M:
            raise InvalidValueError(
                f"nothing to push or to open within {REACH_M:g} m of "
                f"({request.x:.2f}, {request.y:.2f})"
            )
        if name in doors:
            return self._door(MoveDoor(opened=True, name=name))
        return self._push(Push(name=name))

    def _kidnap(self, request: Kidnap) -> str:
        world = self.simulation.world
        pose = request.pose or hands.free_goal(world, request.goal)
        hands.carry(world, pose)
        return f"the robot is carried to ({pose[0]:.2f}, {pose[1]:.2f})"

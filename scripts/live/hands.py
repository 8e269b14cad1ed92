# SPDX-License-Identifier: Apache-2.0
"""What a client does to the world, between two scans, and who drives the robot."""

from __future__ import annotations

from collections.abc import Iterator

from scripts.live.requests import Click, Drive, OnWorld, Tour
from sim.driving.pilot import Pilot
from sim.moments import Moment, observed
from sim.simulation import Simulation, n_frames
from sim.view.parts import Parts, Placed
from sim.world import hands
from sim.world.requests import Kidnap, MoveDoor, Push, carry_out
from slam.errors import InvalidValueError
from slam.frames import NS_PER_S

HOLD_NS = NS_PER_S  # a twist holds so long, then the robot stands: its sender may be gone
REACH_M = 1.0  # of a click: what is farther from it was not meant


class Hands:
    """Carries out requests on a simulation's world and steers its robot.

    client_drives  whether a client does, from its first twist until it gives the robot back
    """

    def __init__(self, simulation: Simulation) -> None:
        self.simulation, self._world = simulation, simulation.world
        self.client_drives = False
        self._twist, self._asked_ns = Drive(v=0.0, omega=0.0), -HOLD_NS
        self._parts: Parts | None = None

    def moments(self, seconds: float) -> Iterator[Moment]:
        """A tour of ``seconds``, as ``sim.moments.toured`` where no client drives."""
        pilot, period_s = Pilot(self._world), self.simulation.scan_period_s
        for _ in range(n_frames(seconds, period_s)):
            self._world.set_command(*self._steer(pilot.command(period_s)))
            yield observed(self.simulation)

    def _steer(self, tour: tuple[float, float]) -> tuple[float, ...]:
        if not self.client_drives:
            return tour
        if self._world.time_ns - self._asked_ns > HOLD_NS:
            return 0.0, 0.0
        return self._twist.v, self._twist.omega, self._twist.side

    def do(self, request: OnWorld) -> str:
        """Do it to the world as it is now; what was done, in words.

        Raises a ``MobiliaError`` that says why it cannot be done.
        """
        if isinstance(request, Drive):
            self._world.set_command(request.v, request.omega, request.side)  # or says why not
            self.client_drives = True
            self._twist, self._asked_ns = request, self._world.time_ns
            return "the robot takes twists"
        if isinstance(request, Tour):
            self.client_drives = False
            return "the built-in driver drives"
        if isinstance(request, Click):
            return self._click(request)
        return carry_out(self.simulation.world, request)

    def _click(self, request: Click) -> str:
        """Do it to the part that the ray meets first; there, or on the floor, the robot goes."""
        world = self._world
        self._parts = parts = self._parts or Parts(world.scene, world.model)
        parts.place(Placed.of(world))
        found = parts.hit(request.origin, request.direction)
        if found is None:
            raise InvalidValueError("nothing is there")
        name, (x, y, _) = found[0], found[1].tolist()
        if request.carry:
            return carry_out(world, Kidnap(pose=(x, y, 0.0)))
        doors, things, apart = world.doors.names, hands.pushable(world), 0.0
        if name not in (*doors, *things):
            name, apart = hands.nearest(world, [*things, *doors], x, y)
        if apart > REACH_M:
            raise InvalidValueError(
                f"nothing to push or to open within {REACH_M:g} m of ({x:.2f}, {y:.2f})"
            )
        if name in doors:
            return carry_out(world, MoveDoor(opened=True, name=name))
        return carry_out(world, Push(name=name))

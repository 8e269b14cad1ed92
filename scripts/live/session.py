# SPDX-License-Identifier: Apache-2.0
"""A run as it is shown live: what is served, scan by scan, and what has happened since."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

from scripts.film.footage import KNOBS, Footage, of_log, of_simulation, title_of
from scripts.live.playback import Anew, Click, Drive, OnWorld, Tour
from sim.driving.pilot import Pilot
from sim.events import KIDNAP, Event
from sim.moments import Moment, observed
from sim.simulation import Simulation, n_frames
from sim.view.moment import BIG_MAP_S, MAP_S, Moments, Shown, verdict_of
from sim.view.parts import Parts, Placed
from sim.world import hands
from sim.world.requests import Kidnap, MoveDoor, Push, carry_out
from slam.errors import InvalidValueError
from slam.estimate import Raster
from slam.frames import NS_PER_S
from slam.names import NameFromFile

EVENTS_NS = NS_PER_S // 5
_SAYS = {
    "door": "moves", "person": "comes near the robot", "change": "stands elsewhere, unseen",
}  # fmt: skip
HOLD_NS = NS_PER_S  # a twist holds so long, then the robot stands: its sender may be gone
KEPT = 2  # estimates of a SLAM: a stream without odometry goes on as the last two
REACH_M = 1.0  # of a click: what is farther from it was not meant


class Session:
    """Runs SLAMs on footage and gives what is shown, scan by scan.

    hands    of a simulation, None for a log
    moments  what is noted for drawing
    every    factor on the time between two looks at the map
    """

    def __init__(self, footage: Footage, moments: Moments, hands: "Hands | None" = None) -> None:
        self.footage, self.hands, self.moments = footage, hands, moments
        self.every = 1.0
        self._events_ns = 0
        self._verdict = "tracking"
        self._known: set[tuple[str, str, float]] = set()

    @property
    def static_map(self) -> Raster | None:
        """What never moves, in the world; None for a log."""
        return None if self.hands is None else self.hands.simulation.world.scene.static_map

    @property
    def scan_height_m(self) -> float:
        """m, of the scanner above the floor; 0 for a log, which does not say."""
        return 0.0 if self.hands is None else self.hands.simulation.world.scene.scan_height_m

    def run(self) -> Iterator[Shown]:
        """All frames of the stream."""
        for frame in self.moments.replay.run(self.footage.stream):
            said = self._said(frame.stamp_ns)
            self.moments.look(self.every * MAP_S, self.every * BIG_MAP_S)
            shown = self.moments.note(frame, self.footage.stage.placed, said)
            self.moments.replay.forget(KEPT)
            yield shown

    def _said(self, stamp_ns: int) -> list[str]:
        said: list[str] = []
        if stamp_ns - self._events_ns >= EVENTS_NS:
            self._events_ns = stamp_ns
            said = self._begun()
        primary = self.moments.primary
        verdict = verdict_of(self.moments.replay.tracks[primary].estimates[-1])
        if verdict != self._verdict:
            self._verdict = verdict
            said = [*said, f"{self.moments.seconds:.1f} s: {primary}: {verdict}"]
        return said

    def _begun(self) -> list[str]:
        """Events that have begun since it was last asked."""
        events = {(e.kind, e.name, e.start_s): e for e in self.footage.stage.events()}
        fresh = [event for key, event in events.items() if key not in self._known]
        self._known.update(events)
        return [_told(event) for event in fresh]


def _told(event: Event) -> str:
    if event.kind == KIDNAP:
        return f"{event.start_s:.1f} s: the robot is carried elsewhere"
    return f"{event.start_s:.1f} s: {event.name} {_SAYS.get(event.kind, 'is moved')}"


@dataclass(frozen=True, kw_only=True)
class Opener:
    """Makes sessions, each from its start.

    slams     by name, the first of them shown;   typed  those that the user named, at first all
    path      of a log or a bag, None for a scene
    settings  of the scene, as ``Simulation`` takes them;   seconds  that it lives
    """

    slams: Sequence[str]
    path: Path | None = None
    settings: Mapping[str, Any] = field(default_factory=dict)
    seconds: float = 0.0
    typed: Sequence[str] = ()

    def anew(self, request: Anew) -> "Opener":
        """The same with what a page has asked for, whose names are no code but those typed."""
        typed = self.typed or tuple(self.slams)
        first = request.slam or self.slams[0]
        slams = [first if first in typed else NameFromFile(first, "a page"), *self.slams[1:]]
        asked = {k: getattr(request, k) for k in KNOBS if getattr(request, k) is not None}
        settings = {**self.settings, **asked} if self.path is None else self.settings
        return replace(self, slams=list(dict.fromkeys(slams)), settings=settings, typed=typed)

    def open(self) -> Session:
        """A session at its start.

        Raises ``NeedsLabelsError`` for an oracle on a log without labels, ``LogFormatError`` for a
        file that cannot be read.
        """
        hands = None
        if self.path is None:
            simulation = Simulation(**self.settings, labels=True)
            hands = Hands(simulation)
            moments = partial(hands.moments, self.seconds)
            footage = of_simulation(
                simulation, moments, seconds=self.seconds, title=title_of(self.settings), view=None
            )
        else:
            footage = of_log(self.path)
        return Session(footage, footage.show(self.slams).moments, hands)


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

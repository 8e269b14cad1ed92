# SPDX-License-Identifier: Apache-2.0
"""Part of a tour: from a moment on, with few movers, fewer scans and fewer beams.

The tour is simulated from its start as it was, so everything stands and moves at that moment as it
did. From there on the robot gets the commands of the tour, scan by scan, in a world in which only
those who are kept are there (``sim.twins.absence``).
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Annotated, Any

from msgspec import Meta

from sim.driving.pilot import Pilot
from sim.moments import Moment, observed, thinned
from sim.simulation import Simulation, n_frames
from sim.twins import absence
from sim.twins.absence import Change
from slam.errors import InvalidValueError, UnknownNameError
from slam.frames import BeamLabels, Frame, LaserSpec
from slam.shaped import NotNegative, Word, check

Names = Annotated[tuple[Word, ...], Meta(max_length=1000)]
Step = Annotated[int, Meta(ge=1, le=1000)]


@dataclass(frozen=True, kw_only=True)
class Cut:
    """What of a tour a SLAM gets; ``WHOLE`` is all of it.

    from_s  scans before that, s, are simulated and not told
    keep    movers that are there from then on, the others are out; None: all stay
    every   one scan in so many;   beams  and of that one beam in so many
    """

    from_s: NotNegative = 0.0
    keep: Names | None = None
    every: Step = 1
    beams: Step = 1

    def __post_init__(self) -> None:
        check(self)

    def moments(
        self, simulation: Simulation, settings: Mapping[str, Any], seconds: float
    ) -> Iterator[Moment]:
        """What is told of ``seconds`` of a tour; ``simulation`` is fresh, made with ``settings``.

        Raises ``InvalidValueError`` for a beginning after the end, and as ``begin``.
        """
        thin = Thin(self.beams)
        for moment in thinned(self._every_one(simulation, settings, seconds), self.every):
            yield replace(moment, frame=thin(moment.frame))

    def _every_one(
        self, simulation: Simulation, settings: Mapping[str, Any], seconds: float
    ) -> Iterator[Moment]:
        period_s = simulation.scan_period_s
        first, last = round(self.from_s / period_s), n_frames(seconds, period_s)
        if first >= last:
            raise InvalidValueError(f"cut.from_s must be < {seconds:g} s, got {self.from_s:g}")
        tour = simulation if self.keep is None else Simulation(**{**settings, "labels": True})
        pilot = Pilot(tour.world)
        for scan in range(last):
            if scan == first and self.keep is not None:
                begin(simulation, tour.save_state(), self.keep)
            command = pilot.command(period_s)
            tour.world.set_command(*command)
            moment = observed(tour)
            if scan >= first and tour is not simulation:
                simulation.world.set_command(*command)
                moment = observed(simulation)
            if scan >= first:
                yield moment


WHOLE = Cut()


def begin(simulation: Simulation, state: bytes, keep: tuple[str, ...]) -> None:
    """Go on from the state of another simulation made alike, with only these movers.

    What is kept without who holds it stands where it was let go. Raises ``UnknownNameError`` for a
    name that no mover has.
    """
    movers = simulation.world.scene.movers
    for name in set(keep) - {mover.name for mover in movers}:
        raise UnknownNameError(f"no mover is called '{name}', which is to be kept")
    simulation.load_state(state)
    out = [m.name for m in movers if m.group != "robot" and m.name not in keep]
    absence.apply(simulation, Change(out=tuple(out)), held=False)


class Thin:
    """Frames with the first of each ``step`` beams, and their labels."""

    def __init__(self, step: int) -> None:
        self._step = step
        self._specs: dict[int, tuple[LaserSpec, LaserSpec]] = {}  # SLAMs keep tables of one object

    def spec(self, spec: LaserSpec) -> LaserSpec:
        """Of such a scan."""
        if self._step > 1 and id(spec) not in self._specs:
            times, wide = spec.beam_time_offsets[:: self._step], spec.angle_increment * self._step
            thin = replace(
                spec, n_beams=len(times), angle_increment=wide, beam_time_offsets=times
            )  # fmt: skip
            self._specs[id(spec)] = spec, thin
        return self._specs.get(id(spec), (spec, spec))[1]

    def __call__(self, frame: Frame) -> Frame:
        """The frame with fewer beams."""
        scan, labels, step = frame.scan, frame.labels, self._step
        if step == 1 or scan is None:
            return frame
        strength = None if scan.intensities is None else scan.intensities[::step]
        spec, ranges = self.spec(scan.spec), scan.ranges[::step]
        if labels is not None:
            labels = BeamLabels(**{name: of[::step] for name, of in vars(labels).items()})
        scan = replace(scan, ranges=ranges, spec=spec, intensities=strength)
        return replace(frame, scan=scan, labels=labels)

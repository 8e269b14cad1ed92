# SPDX-License-Identifier: Apache-2.0
"""World + scanner + encoders = frames, the same for every listener."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, replace
from typing import Any

import numpy as np

from sim.actors.rearranging import Rearrangement
from sim.actors.robot import DriveConfig
from sim.core import state
from sim.core.contacts import Contact
from sim.core.dynamism import Dynamism
from sim.core.seeds import Seeds
from sim.driving.drive import TourConfig
from sim.driving.pilot import Pilot
from sim.sensors.lidar.device import LaserScanner, ScanResult
from sim.sensors.lidar.link import SerialLink, over_link
from sim.sensors.lidar.registry import ScannerConfig
from sim.sensors.odometry.encoders import WheelOdometry
from sim.world.kidnapping import Kidnapping
from sim.world.labels import BeamLabeller
from sim.world.robots import places_of
from sim.world.script import Script, cues_of, of_file, visitors
from sim.world.sweep import Sweep
from sim.world.world import World
from slam.errors import InvalidValueError
from slam.frames import (
    NS_PER_S,
    BeamLabels,
    Float,
    Frame,
    LaserSpec,
    Scan,
    Stream,
    StreamMetadata,
)
from slam.logs.together import one_by_one
from slam.shaped import Positive, shaped

# Of a state, by their words in it.
_PARTS = {
    "kidnaps": "kidnaps are", "changed": "a moment of change is",
    "events": "events are",
}  # fmt: skip
MOST_FRAMES = 1 << 31  # of one simulation: almost two years


class Simulation:
    """A world seen by its robot: each ``observe`` is one whole scan and the frame it makes.

    scene      name of a registered scene, or ``module:function``
    seed       whole number or ``Seeds``; every part draws from its own stream
    dynamism   0 (nothing moves) to 1, or the rates themselves
    motion     in [0, 1]: that axis alone at this level instead (``sim.core.dynamism``)
    moving_share  in [0, 1]: of the chairs, on the move at any time (``sim.actors.rolling``)
    change     in [0, 1]: of what is out of sight, the share that is found elsewhere later
               (``sim.actors.rearranging``)
    change_at_s  the one moment at which that happens, s, before the first scan from then on; None:
               all along
    session    number of a session of the same building (``sim.world.sessions``)
    kidnap_every_s  s after which the robot is carried elsewhere, again and again
               (``sim.world.kidnapping``); None: never
    events     what happens at stated times, as rows of ``sim.world.script``; None: what the scene's
               own file says
    robot      another than the scene's, by name or from its tables (``sim.world.robots``);
               None: what the scene's own file says
    scene_sha256  that the files of a scene by its file must have (``scenes.scene_file``); None: any
    laser      a scanner by name ("utm30lx", "lms221:noise"; ``sim.sensors.lidar.registry``), a
               ``Scanner`` or a ``Lms221Config``; default the LMS-221 with every effect
    also_at    further scanners of that model on the robot, at the same height, turning with the
               first: (x_m, y_m, yaw_deg) of each by name (``sim.world.robots.Place``)
    odometry   preset of the wheel encoders: "pioneer3dx", "probabilistic_robotics", "ideal"
    drive      limits of the robot
    start      (x m, y m, heading rad) of the robot, where the scene's own is not wanted; a crowd
               is put around it
    chairs     their physics: "planar" or "free" (``sim.actors.chairs``)
    labels     whether frames carry truth per beam
    options    passed on to ``scenes.build``: ``scan_height_m`` of the robot's scanner above the
               floor (0.36), and the scene's own, e.g. ``n_chairs=10``
    """

    def __init__(  # noqa: PLR0913 (settings by keyword)
        self,
        scene: str = "office",
        *,
        seed: int | Seeds = 0,
        dynamism: float | Dynamism = 0.5,
        moving_share: float | None = None,
        motion: float | None = None,
        change: float | None = None,
        change_at_s: float | None = None,
        session: int | None = None,
        kidnap_every_s: float | None = None,
        events: Sequence[Mapping[str, Any]] | None = None,
        robot: str | Mapping[str, Any] | None = None,
        scene_sha256: str | None = None,
        laser: ScannerConfig | str | None = None,
        also_at: Sequence[Mapping[str, float]] | None = None,
        odometry: str = "pioneer3dx",
        drive: DriveConfig | None = None,
        start: Sequence[float] | None = None,
        chairs: str = "planar",
        labels: bool = False,
        **options: Any,
    ) -> None:
        rates = Dynamism.of(dynamism, moving_share, motion=motion, change=change)
        own = of_file(scene, scene_sha256)
        cues = cues_of(own.get("events", ()) if events is None else events)
        robot = own.get("robot") if robot is None else robot
        self.world = World(
            scene, seed=seed, dynamism=rates, change=change, session=session, drive=drive,
            start=start, chairs=chairs, visitors=visitors(cues), robot=robot, **options,
        )  # fmt: skip
        source = scene if events is None else ""
        self._script = Script(cues, self.world, source) if cues else None
        self.odometry_preset, self.session = odometry, session
        seeds = self.world.seeds
        self._change_at_s = checked_moment(change_at_s, session)
        self._changed = False  # whether that moment has been
        self._kidnapping: Kidnapping | None = None
        if kidnap_every_s is not None:
            self._kidnapping = Kidnapping(kidnap_every_s, seeds)
        self.laser = LaserScanner(self.world.model, laser, seeds.generator("lidar"))
        if also_at is not None:
            self.laser.beside(places_of(also_at), seeds.sequence("lidar"))
        track = self.world.drive_config.track
        self.encoders = WheelOdometry(odometry, seeds.generator("odometry"), track=track)
        self._labeller = BeamLabeller(self.world, len(self.specs)) if labels else None
        self._stamp_ns = 0
        self._scan: ScanResult | None = None
        self._labels: list[BeamLabels | None] = []
        self._frame: Frame | None = None
        self.contacts: list[Contact] = []  # what the robot touched during the last scan
        self.rearranged: list[Rearrangement] = []  # what changed out of sight just before it
        self._sweep = Sweep(self.laser)

    @property
    def spec(self) -> LaserSpec:
        """Geometry and timing of the scanner, as in every frame's scan."""
        return self.laser.spec

    @property
    def specs(self) -> tuple[LaserSpec, ...]:
        """Of all scanners, the first and those beside it."""
        return (self.spec, *self.laser.others)

    def use_laser(self, laser: LaserScanner) -> None:
        """Go on with another scanner of the same timing on the same robot."""
        self.laser = laser
        self._sweep.renew()

    @property
    def path(self) -> Float:
        """(rows, 3) true poses of the robot at the steps of the last scan.

        Where it began between two steps, row 0 is the step before.
        """
        return self._sweep.path

    @property
    def scan_period_s(self) -> float:
        """Seconds of simulated time from scan to scan."""
        return float(self.laser.scanner.period_s)

    def _changed_out_of_sight(self) -> list[Rearrangement]:
        """What is put elsewhere before this scan."""
        if self._change_at_s is None:
            return self.world.rearrange(*self.specs)
        if self._changed or self.world.time_ns < round(self._change_at_s * NS_PER_S):
            return []
        self._changed = True
        return self.world.rearrange(*self.specs, at_once=True)

    def observe(self) -> Frame:
        """Let one scan's worth of time pass under the present command; the frame it gives.

        The frame's stamp is that of the earliest beam, so its odometry and truth lie one scan
        period before the world's present: nobody can know a scan before it is over.
        """
        self.sense()
        frame = self.frame
        assert frame is not None
        return frame

    def sense(self) -> ScanResult:
        """As ``observe``, without the frame, which ``frame`` makes when it is asked for."""
        self.live()
        return self.look()

    def live(self) -> None:
        """Let one scan's worth of time pass: ``look`` or ``blink`` comes next, and only once."""
        if self._kidnapping is not None:
            self._kidnapping.carried(self.world)
        if self._script is not None:
            self._script.happen(self.world)
        self.rearranged = self._changed_out_of_sight()
        self._stamp_ns = self._sweep.over_scan(self.world, self.laser)
        self.contacts = self.world.take_contacts()
        self._sweep.timing.roll(self.encoders, self._sweep.travel, bool(self.contacts))

    def look(self) -> ScanResult:
        """The scan of the time that ``live`` let pass."""
        self._scan, self._frame = self.laser.finish(), None
        scans = [self._scan, *self.laser.seen_by_others]
        for scan in scans:
            self.world.saw(scan.bodies)
        of = self._labeller
        self._labels = [of.label(scan, k) if of else None for k, scan in enumerate(scans)]
        return self._scan

    def blink(self) -> None:
        """Instead of ``look``: nobody wants that scan. The noise of later scans is the same.

        What that scan would have shown counts as unseen, so with ``change`` things may be put
        elsewhere that it would have kept in their place.
        """
        if self._labeller is not None or not self.laser.blink():
            self.look()

    @property
    def frame(self) -> Frame | None:
        """Of the last scan; None before the first."""
        if self._frame is None and self._scan is not None:
            stamp_ns, sweep_s = self._stamp_ns, self._sweep.timing.sweep_s
            self._frame = Frame(
                stamp_ns=stamp_ns,
                odometry=self.encoders.reading(stamp_ns=stamp_ns, sweep_s=sweep_s),
                scan=Scan(stamp_ns=stamp_ns, ranges=self._scan.ranges, spec=self.spec),
                truth=self._sweep.timing.truth(self.path),
                labels=self._labels[0],
            )
        return self._frame

    @property
    def frames_of_others(self) -> tuple[Frame, ...]:
        """``frame`` with the scan of each scanner beside the first instead, at the same time."""
        if self.frame is None:
            return ()
        seen = zip(self.specs[1:], self.laser.seen_by_others, self._labels[1:], strict=True)
        scans = [(Scan(stamp_ns=self._stamp_ns, ranges=s.ranges, spec=of), n) for of, s, n in seen]
        return tuple(replace(self.frame, scan=scan, labels=labels) for scan, labels in scans)

    def save_state(self) -> bytes:
        """World, scanner, encoders, labels: all that decides what comes next.

        Load it into a simulation made with the same arguments, in this or another process; it goes
        on bit for bit. Save between two calls of ``observe``.
        """
        arrays, words = self.encoders.save()
        world = np.frombuffer(self.world.save_state(), dtype=np.uint8)
        seen = self._labeller.last_seen if self._labeller else np.zeros((0, 3))
        lasers = [state.random_words(rng) for rng in self.laser.streams]
        between, scan = self.laser.save()
        if scan:  # the next scan begins within the last step
            between |= {"path": self.path[-2:], "travel": self._sweep.travel[-2:]}
        kidnapping = self._kidnapping
        places, kidnaps = ({}, None) if kidnapping is None else kidnapping.save()
        return state.pack(
            {
                **arrays, **places, "world": world, "seen": seen,
                **{f"scan.{name}": values for name, values in between.items()},
            },
            {
                "encoders": words, "lasers": lasers, "scan": scan,
                "scanner": self.laser.scanner.name,
                **({} if kidnaps is None else {"kidnaps": kidnaps}),
                **({} if self._change_at_s is None else {"changed": self._changed}),
                **({} if self._script is None else {"events": self._script.done}),
            },
        )  # fmt: skip

    def load_state(self, block: bytes) -> None:
        """Go on from ``save_state``; ``InvalidValueError`` if it is of another simulation."""
        arrays, words = state.unpack(block)
        self._check_state(arrays, words)
        self._changed = bool(words.get("changed", False))
        if self._kidnapping is not None:
            self._kidnapping.load(arrays, words["kidnaps"])
        if self._script is not None:
            self._script.done = [bool(each) for each in words["events"]]
        own = {k.removeprefix("scan."): v for k, v in arrays.items() if k.startswith("scan.")}
        self.laser.load(own, words.get("scan", {}))
        self.world.load_state(arrays["world"].tobytes())
        self._sweep.renew()
        if own:
            self._sweep.path, self._sweep.travel = own["path"], own["travel"]
        self.encoders.load(arrays, words["encoders"])
        for rng, saved in zip(self.laser.streams, words["lasers"], strict=True):
            state.restore_random(rng, saved)
        if self._labeller is not None and len(arrays["seen"]):
            self._labeller.last_seen[...] = arrays["seen"]
        self.contacts, self.rearranged, self._scan, self._frame = [], [], None, None

    def _check_state(self, arrays: Mapping[str, Any], words: Mapping[str, Any]) -> None:
        """``InvalidValueError`` for the state of a world, another scanner or other parts."""
        if not {"encoders", "lasers"} <= set(words) or "world" not in arrays:
            raise InvalidValueError("this is the state of a world, not of a simulation")
        own_name = self.laser.scanner.name
        if words.get("scanner", own_name) != own_name or (
            len(words["lasers"]) != len(self.laser.streams)
        ):
            raise InvalidValueError(
                f"the state is of scanner '{words.get('scanner')}', expected '{own_name}'"
            )
        for what, own_part in (
            ("kidnaps", self._kidnapping), ("changed", self._change_at_s),
            ("events", self._script),
        ):  # fmt: skip
            if (words.get(what) is None) != (own_part is None):
                raise InvalidValueError(f"{_PARTS[what]} in the state or in the simulation only")

    def metadata(self) -> StreamMetadata:
        """What a recording says about itself; ``extra`` has a session, where there is one."""
        session = {} if self.session is None else {"session": self.session}
        first = StreamMetadata(
            source="simulation",
            scene=self.world.scene.name,
            seed=self.world.seeds.seed,
            laser=self.spec,
            robot=self.odometry_preset,
            truth="simulator",
            extra={
                "laser": asdict(self.laser.config),
                "scan_height_m": self.world.scene.scan_height_m,
                "dynamism": asdict(self.world.rates),
                **session,
            },
        )
        return replace(first, others=tuple(replace(first, laser=one) for one in self.laser.others))


def tour(
    simulation: Simulation, seconds: float, config: TourConfig | None = None
) -> Iterator[Frame]:
    """Frames of ``seconds`` of driving round the scene's goals, avoiding what truly is there."""

    def frames() -> Iterator[tuple[Frame, ...]]:
        pilot = Pilot(simulation.world, config)
        for _ in range(n_frames(seconds, simulation.scan_period_s)):
            simulation.world.set_command(*pilot.command(simulation.scan_period_s))
            yield simulation.observe(), *simulation.frames_of_others

    return one_by_one(frames())


def checked_moment(change_at_s: float | None, session: int | None = None) -> float | None:
    """``change_at_s``, s; ``InvalidValueError`` where it is neither None nor a time > 0.

    So it is in a session, within which nothing changes out of sight.
    """
    if change_at_s is not None:
        shaped("change_at_s", change_at_s, Positive)
        if session is not None:
            raise InvalidValueError(
                f"change_at_s and session exclude each other: {change_at_s:g} and {session}"
            )
    return change_at_s


def n_frames(seconds: float, period_s: float) -> int:
    """Whole scans in ``seconds``."""
    if not (isinstance(seconds, int | float) and math.isfinite(seconds) and seconds > 0.0):
        raise InvalidValueError(f"seconds must be > 0 and finite, got {seconds!r}")
    count = seconds / period_s
    if count > MOST_FRAMES:
        most_s = MOST_FRAMES * period_s
        raise InvalidValueError(f"seconds must be at most {most_s:g}, got {seconds!r}")
    return max(1, round(count))


def stream(
    scene: str = "office", *, seconds: float = 60.0, baud: int | None = None, **settings: Any
) -> Stream:
    """A stream that simulates a tour again each time it is iterated, byte for byte the same.

    baud      of the scanner's serial line: most scans are lost at 38400
              (``sim.sensors.lidar.link``); None: all arrive
    settings  as for ``Simulation``
    """
    probe = Simulation(scene, **settings)
    metadata, n = probe.metadata(), n_frames(seconds, probe.scan_period_s)
    config: Any = probe.laser.config  # the link refuses any but the LMS-221
    if baud is not None and probe.laser.others:
        raise InvalidValueError(f"baud is of one scanner's line, and also_at has more: {baud}")
    link = None if baud is None else SerialLink(baud=baud, config=config)
    if link is not None:
        line = {"baud": link.baud, "latency_ns": link.latency_ns}
        metadata = replace(metadata, extra={**metadata.extra, "link": line})

    def frames() -> Iterator[Frame]:
        driven = tour(Simulation(scene, **settings), seconds)
        return driven if link is None else over_link(driven, link)

    length = n * len(probe.specs) if link is None else sum(map(link.sends, range(n)))
    return Stream(metadata=metadata, frames=frames, length=length)

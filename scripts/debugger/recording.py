# SPDX-License-Identifier: Apache-2.0
"""A run on tape: everything that is needed to go back into it and change one thing.

The pilot of a tour steers by the truth around it, so in a changed world it would drive elsewhere.
A re-run therefore gets the commands of the original, scan by scan: with them the robot drives the
same path, and the scanner and the encoders draw the same numbers, unless the robot touches
something else than it did.
"""

import copy
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenes.scene import Hold, Mover
from scripts.comparison.again import again
from scripts.comparison.run_file import RunFile
from scripts.names import file_name, is_run
from scripts.options import admitted, whole
from sim.driving.pilot import Pilot
from sim.recording.recipe import Made
from sim.recording.sums import check_vouched
from sim.simulation import Simulation, n_frames
from sim.twins import absence
from sim.twins.absence import Change
from sim.twins.cut import Cut
from slam import se2
from slam.errors import (
    InvalidValueError,
    LogFormatError,
    MissingPathError,
    MobiliaError,
    SlamFailedError,
)
from slam.evaluation.lost import errors_since_m
from slam.frames import Float, Frame
from slam.frontend.odometry_steps import MotionSum
from slam.oracle import shown
from slam.replay import Track
from slam.system import create
from slam.trajectory import read_tum

NO_OPTIONS = (
    "scene", "seed", "dynamism", "motion", "change", "crowd", "laser", "labels",
)  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Case:
    """A simulated tour and the SLAM on it.

    settings  arguments of ``Simulation``
    seconds   of the tour
    slam      name or ``module:Class``
    every     the SLAM gets one scan in so many
    title     for people
    recorded  (n, 3) what it believed then, if that is on file
    made      who recorded it, if that is known
    """

    settings: Mapping[str, Any]
    seconds: float
    slam: str = "shunting"
    every: int = 1
    recorded: Float | None = field(default=None, repr=False)
    made: Made | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        whole("--every", self.every, 1)

    @property
    def title(self) -> str:
        """The world in a line."""
        options = {k: v for k, v in self.settings.items() if isinstance(v, str | int | float)}
        scene = options.pop("scene", "?")
        options.pop("scene_sha256", None)
        return " · ".join([str(scene), *(f"{k} {v}" for k, v in sorted(options.items()))])


def case_of(folder: Path, slam: str | None, every: int, trust: bool = False) -> Case:
    """The case of a folder of ``mobilia run`` or ``demo``, of an episode of a dataset, or of a run
    of a comparison. Raises as ``scripts.comparison.again.again``, which has ``trust``, too."""
    if not folder.exists():
        raise MissingPathError(folder, "no such folder")
    found, recorded = again(folder, trust), None
    if found.twin:
        raise LogFormatError(
            folder, f"a {found.twin} twin cannot be changed: take an episode made without --twins"
        )
    if found.settings.get("also_at"):
        raise LogFormatError(
            folder, "a drive with several scanners cannot be changed: take one without --also-at"
        )
    usual = "odometry" if found.slams else "shunting"
    slam = admitted(slam or found.slam or usual, "SLAM", trust)
    if found.cut != Cut(every=found.cut.every):
        raise LogFormatError(folder, "is part of a run, which cannot be changed: take the whole")
    if is_run(folder) and every not in (1, found.cut.every):
        raise InvalidValueError(
            f"--every: in this comparison SLAMs got one scan in {found.cut.every}"
        )
    every = found.cut.every if every == 1 else every
    if is_run(folder):
        recorded = RunFile(folder).believed(slam).poses if slam in found.slams else None
    elif found.made is None:
        home = folder if folder.is_dir() else folder.parent
        online = home / f"trajectory_{file_name(slam)}.tum"
        check_vouched(online)
        recorded = read_tum(online).poses if every == 1 and online.exists() else None
    return Case(
        settings=found.settings, seconds=found.seconds, slam=slam, every=every, recorded=recorded,
        made=found.made,
    )  # fmt: skip


def options_of(words: list[str]) -> dict[str, Any]:
    """``["walls=none", "n_chairs=6"]`` as arguments; ``InvalidValueError`` for anything else."""
    found: dict[str, Any] = {}
    for word in words:
        name, equals, value = word.partition("=")
        if not (name.isidentifier() and equals and value):
            raise InvalidValueError(f"--option must be NAME=VALUE, got {word!r}")
        if name in NO_OPTIONS:
            raise InvalidValueError(f"--option {name}: that has an option of its own or none")
        try:
            found[name] = json.loads(value)
        except ValueError:
            found[name] = value
    return found


Pair = tuple[Float, Float]
KEPT_S = 0.5  # the world's state is kept this often


@dataclass(eq=False)
class Strip:
    """What a SLAM was shown and what it made of it, row by row; n updates, m movers.

    frames  n, as it may see them     truth   n poses of the robot in the world
    believed  n poses in the map      poses   n times (m, 3) of the movers
    beams   n times (m,) returns from each mover
    """

    frames: list[Frame] = field(default_factory=list)
    truth: list[Float] = field(default_factory=list)
    believed: list[Float] = field(default_factory=list)
    poses: list[Float] = field(default_factory=list)
    beams: list[NDArray[np.int64]] = field(default_factory=list)

    def take(
        self, frame: Frame, poses: Float, beams: NDArray[np.int64], track: Track | None
    ) -> None:
        """One more row; without a track the frame keeps its truth and its labels."""
        assert frame.truth is not None
        seen = frame if track is None else shown(track.system, frame)
        self.frames.append(seen)
        self.truth.append(frame.truth)
        if track is not None:
            self.believed.append(track.take(seen).T_map_robot)
        self.poses.append(poses)
        self.beams.append(beams)

    def cut(self, first: int, last: int) -> "Strip":
        """Rows ``first`` to ``last``."""
        return Strip(*(column[first : last + 1] for column in vars(self).values()))

    def stamps_ns(self) -> NDArray[np.int64]:
        """(n,) of the rows."""
        return np.array([frame.stamp_ns for frame in self.frames], dtype=np.int64)

    def errors_m(self, then: Pair) -> Float:
        """(n,) gathered since a moment whose true and believed pose are ``then``."""
        return errors_since_m(then, self.truth, self.believed)


@dataclass(eq=False)
class Tape:
    """A whole run.

    commands  (v m/s, omega rad/s) before each scan; rows of ``strip`` are every ``case.every``th
    states    by row: the scan with which it begins, and the simulation saved before that
    movers, holds  of the scene
    """

    case: Case
    names: tuple[str, ...]
    kinds: tuple[str, ...]
    movers: tuple[Mover, ...] = ()
    holds: tuple[Hold, ...] = ()
    strip: Strip = field(default_factory=Strip)
    commands: list[tuple[float, float]] = field(default_factory=list)
    states: dict[int, tuple[int, bytes]] = field(default_factory=dict)

    @property
    def T_world_map(self) -> Float:
        """(3,) of the frame in which the SLAM began."""
        return self.strip.truth[0]

    def then(self, row: int) -> Pair:
        """The true and the believed pose before a row: that of the row before."""
        if row == 0:
            return self.T_world_map, np.zeros(3)
        return self.strip.truth[row - 1], self.strip.believed[row - 1]

    def row_before(self, row: int) -> int:
        """The last row at or before ``row`` at which a state was kept."""
        return max(kept for kept in self.states if kept <= row)


def simulate(case: Case) -> Simulation:
    """The world of a case, with labels, at its start."""
    return Simulation(**{**case.settings, "labels": True})


def record(
    case: Case, note: Callable[[int, int], None] = lambda done, of: None, *, heard: bool = True
) -> Tape:
    """Run the case from beginning to end; ``note`` gets scans done and of how many.

    heard  whether its SLAM hears them; else frames keep their truth and their labels
    """
    simulation = simulate(case)
    world, track = simulation.world, Track(case.slam, create(case.slam)) if heard else None
    movers = world.scene.movers
    tape = Tape(
        case=case, names=world.mover_names, kinds=tuple(m.kind for m in movers), movers=movers,
        holds=world.scene.holds,
    )  # fmt: skip
    pilot, period = Pilot(world), simulation.scan_period_s
    keep = case.every * max(1, round(KEPT_S / (period * case.every)))
    count = n_frames(case.seconds, period)
    ear = _Ear(simulation, tape.strip, track, case.every)
    for scan in range(count):
        if scan == 0 or (scan - 1) % keep == 0:  # a row begins after the scan of the one before
            row = (scan - 1) // case.every + 1
            tape.states[row] = (scan, simulation.save_state())
        command = pilot.command(period)
        tape.commands.append(command)
        ear.scan(scan, command)
        note(scan + 1, count)
    return tape


class _Ear:
    """Hears every scan and passes on one in so many, with the covariance of all motion since."""

    def __init__(
        self, simulation: Simulation, strip: Strip, track: Track | None, every: int
    ) -> None:
        self._simulation, self._strip, self._track = simulation, strip, track
        self._every, self._motion = every, MotionSum()

    def scan(self, number: int, command: tuple[float, float]) -> None:
        """Let the time of scan ``number`` pass under a command."""
        world = self._simulation.world
        world.set_command(*command)
        poses = world.mover_poses()
        frame = self._simulation.observe()
        self._motion.add(frame.odometry)
        if number % self._every or frame.labels is None:
            return
        bodies = frame.labels.body
        seen = world.bodies.mover_of_body[bodies[bodies >= 0]]
        beams = np.bincount(seen[seen >= 0], minlength=len(poses))
        self._strip.take(self._motion.passed_on(frame), poses, beams, self._track)


class Checkpoint:
    """The world and the SLAM just before a row of the tape.

    how  "copy": the SLAM there is copied for each re-run; "replay": it cannot be, so a fresh one
         is given all frames up to there each time
    """

    def __init__(self, tape: Tape, row: int) -> None:
        self.tape, self.row = tape, row
        self._scan, self._state = tape.states[row]
        self._there = self._replayed()
        self.how = "copy"
        try:
            copy.deepcopy(self._there.system)
        except Exception:  # noqa: BLE001  (whatever somebody else's object raises: it is no copy)
            self.how = "replay"

    def verify(self, last: int) -> None:
        """Nothing changed, the re-run up to row ``last`` must be the original, bit for bit.

        Raises ``SlamFailedError`` for a SLAM that does not repeat itself.
        """
        for how in dict.fromkeys((self.how, "replay")):
            self.how = how
            if self._repeats(last):
                return
        raise SlamFailedError(
            f"SLAM '{self.tape.case.slam}' does not repeat itself on the same frames: "
            "no counterfactual can be told from chance"
        )

    def _repeats(self, last: int) -> bool:
        again, once = self.rerun(Change(), last), self.tape.strip.cut(self.row, last)
        same = again.frames == once.frames and _equal(again.truth, once.truth)
        if not (same and _equal(again.poses, once.poses)):
            raise MobiliaError("the world re-run from its checkpoint is not the one it was")
        return _equal(again.believed, once.believed)

    def rerun(self, change: Change, last: int, *, noise: int = 0) -> Strip:
        """Rows from here to ``last`` with a change; ``noise`` > 0: other draws of the scanner."""
        case = self.tape.case
        simulation = simulate(case)
        simulation.load_state(self._state)
        if change != Change():
            absence.apply(simulation, change)
        if noise:
            seed = simulation.world.seeds.integer("lidar")
            for k, stream in enumerate(simulation.laser.streams):
                other = np.random.default_rng([seed, noise, k])
                stream.bit_generator.state = other.bit_generator.state
        strip = Strip()
        ear = _Ear(simulation, strip, self._slam(), case.every)
        for scan in range(self._scan, last * case.every + 1):
            ear.scan(scan, self.tape.commands[scan])
        return strip

    def _slam(self) -> Track:
        if self.how == "replay":
            return self._replayed()
        return Track(self.tape.case.slam, copy.deepcopy(self._there.system))

    def _replayed(self) -> Track:
        track = Track(self.tape.case.slam, create(self.tape.case.slam))
        for frame in self.tape.strip.frames[: self.row]:
            track.take(frame)
        return track


def _equal(ours: Sequence[Float], theirs: Sequence[Float]) -> bool:
    return len(ours) == len(theirs) and all(map(np.array_equal, ours, theirs))


@dataclass(frozen=True, kw_only=True)
class Sighting:
    """A mover that was in view: returns from it, and how far it moved between looks at it, m."""

    name: str
    beams: int
    moved_m: float


def sightings(tape: Tape, first: int, last: int) -> list[Sighting]:
    """Movers seen in rows ``first`` to ``last``, likeliest suspects first.

    That is by returns times way; a mover that was displaced unseen has moved when it is seen again.
    """
    strip, found = tape.strip, []
    for m, (name, kind) in enumerate(zip(tape.names, tape.kinds, strict=True)):
        if kind == "robot":
            continue
        count = sum(int(strip.beams[row][m]) for row in range(first, last + 1))
        if count:
            found.append(Sighting(name=name, beams=count, moved_m=_way(strip, m, first, last)))
    return sorted(found, key=lambda s: (-s.beams * s.moved_m, -s.beams, s.name))


def _way(strip: Strip, m: int, first: int, last: int) -> float:
    """m between looks; a turn counts by the metre."""
    rows = [row for row in range(last + 1) if strip.beams[row][m]]
    start = next((k for k, row in enumerate(rows) if row >= first), len(rows))
    seen = np.array([strip.poses[row][m] for row in rows[max(start - 1, 0) :]])
    step = np.diff(seen, axis=0)
    step[:, 2] = se2.wrap_array(step[:, 2])
    return float(np.sqrt((step * step).sum(axis=1)).sum())


def row_at(tape: Tape, seconds: float) -> int:
    """The row nearest to a time since the first; ``InvalidValueError`` outside the run."""
    stamps = tape.strip.stamps_ns()
    times = (stamps - stamps[0]) * 1e-9
    if not 0.0 <= seconds <= float(times[-1]) + 0.5:
        raise InvalidValueError(f"--at must lie in 0..{times[-1]:.1f} s, got {seconds}")
    return int(np.argmin(np.abs(times - seconds)))

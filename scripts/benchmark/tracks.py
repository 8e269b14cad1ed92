# SPDX-License-Identifier: Apache-2.0
"""The tracks of the benchmark. A track never changes: what is new is a new version of it.

A new track, or a new version of one, is one more declaration, which moves the hash of no other: in
``_ALL`` here, or with ``register`` in a file of one's own (``mobilia --with``).
"""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field, replace
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from scripts.comparison.plan import Plan
from scripts.comparison.rules import LEVEL
from scripts.report.answer import ODOMETRY
from sim.core import versions
from slam.errors import InvalidValueError, LogFormatError, UnknownNameError
from slam.variants import MAP_ORACLE

LEVELS = (0.0, 0.25, 0.5, 0.75, 1.0)  # of every track, from nothing to all that it has
QUICK_LEVELS = (0.0, 0.5, 1.0)
TRAIN = tuple(range(20))  # seeds to tune on; those that the SLAMs here were tuned on
TEST = tuple(range(720, 740))  # seeds that count, of the first versions
FRESH = tuple(range(906, 926))  # of what came after: nothing was run on them before it was frozen
GOOD_ODOMETRY = "pioneer3dx"  # in large halls, where with the poor one even an oracle drifts
# One row of a depth camera's picture: the field of view of a RealSense D435, the limits that ROS'
# depthimage_to_laserscan has by default. Its error is one number here, and grows with the range.
DEPTH_CAMERA = (
    "scanner(fov_deg=87, beams=174, rate_hz=30, sigma_m=0.02, range_min_m=0.45, range_max_m=10)"
)
Sets = Mapping[str, Any]
_NAME = re.compile(r"([a-z0-9]+(?:-[a-z0-9]+)*)-v([1-9][0-9]*)")


@dataclass(frozen=True, kw_only=True)
class Track:
    """One track: a room, a drive through it, and five levels of one kind of trouble.

    name     with its version at the end: ``rush-hour-v1``
    about    one line
    world    version of the world (``sim.core.versions.WORLD``) that it was published in. It can be
             run in that one only; its name, hash and published results stay
    scene    by name
    axis     what a level is, in words, and ``says`` what each of the five is
    sets     what each of them sets: fields of ``sim.recording.recipe.Recipe``, options of the scene
    oracle   the SLAM that is shown no returns from what moves: while it, or ``oracle(map)``, holds
             (``scripts.benchmark.scores.fairness``), the track is fair
    every    one scan in so many is kept, of a scanner of 37.5 scans a second
    counts   whether its runs count, decided once from many seeds (docs/benchmark.md); None: not
             decided, the oracle of each run says
    train, test  seeds: those to tune on, those that count
    """

    name: str
    about: str
    world: int
    scene: str
    axis: str
    says: tuple[str, ...]
    sets: tuple[Sets, ...]
    oracle: str = "oracle(shunting)"
    scanner: str = "noise"
    odometry: str = "probabilistic_robotics"
    seconds: float = 60.0
    every: int = 8
    counts: bool | None = None
    train: tuple[int, ...] = field(default=TRAIN, repr=False)
    test: tuple[int, ...] = field(default=TEST, repr=False)

    def __post_init__(self) -> None:
        if not _NAME.fullmatch(self.name):
            raise InvalidValueError(
                f"the name of a track must be small letters, digits and '-', and end in its "
                f"version, such as rush-hour-v1, got '{self.name}'"
            )
        for name in ("says", "sets"):
            if len(getattr(self, name)) != len(LEVELS):
                raise InvalidValueError(f"Track.{name} must have {len(LEVELS)} levels: {self.name}")
        if set(self.train) & set(self.test):
            raise InvalidValueError(f"Track.train and test must be apart: {self.name}")

    @property
    def controls(self) -> tuple[str, ...]:
        """The SLAMs that are in every table."""
        return (ODOMETRY, *self.oracles)

    @property
    def oracles(self) -> tuple[str, ...]:
        """Either of them may show that the track is fair; they share no code."""
        return (self.oracle, MAP_ORACLE)

    @property
    def family(self) -> str:
        """The name without its version: that of all versions of this track."""
        return self.name.rpartition("-v")[0]

    @property
    def version(self) -> int:
        """1 for the first."""
        return int(self.name.rpartition("-v")[2])

    def later(self, **changes: Any) -> Track:
        """The next version of it, with these fields changed."""
        name = f"{self.family}-v{self.version + 1}"
        return replace(self, **{"name": name, "counts": None, **changes})

    @property
    def sha256(self) -> str:
        """Of all that its runs are made of, with the version of the world it was published in."""
        told = {name: value for name, value in asdict(self).items() if name != "counts"}
        return hashlib.sha256(json.dumps(told, sort_keys=True).encode()).hexdigest()

    def plan(
        self,
        slams: Iterable[str],
        seeds: tuple[int, ...],
        *,
        levels: tuple[float, ...] = LEVELS,
        seconds: float | None = None,
        oracles: bool = True,
    ) -> Plan:
        """The comparison of these SLAMs and the controls; ``seconds`` as the track has them.

        oracles  False: without them, where their runs are published

        Raises ``InvalidValueError`` for a level that is none of ``LEVELS``, ``WorldVersionError``
        for a track of another world: its seeds give other scans here.
        """
        versions.check_world(f"track {self.name}", self.world)
        for level in levels:
            if level not in LEVELS:
                known = ", ".join(f"{one:g}" for one in LEVELS)
                raise InvalidValueError(f"the level of a track must be one of {known}, got {level}")
        return Plan(
            slams=tuple(dict.fromkeys((*slams, *self.controls[: None if oracles else 1]))),
            scenes=(self.scene,),
            axis=LEVEL,
            levels=levels,
            sets=tuple(self.sets[LEVELS.index(level)] for level in levels),
            seeds=seeds,
            seconds=self.seconds if seconds is None else seconds,
            every=self.every,
            scanner=self.scanner,
            odometry=self.odometry,
            judge_maps=False,
        )


def _each(**values: Iterable[Any] | Any) -> tuple[Sets, ...]:
    """Five levels: of what is given as five values each its own, of the rest the same."""
    rows = {k: v if isinstance(v, tuple) else (v,) * len(LEVELS) for k, v in values.items()}
    return tuple({k: v[level] for k, v in rows.items()} for level in range(len(LEVELS)))


def _crowds(kind: str, *counts: int) -> tuple[str, ...]:
    """So many of a kind at each level; "none" for none."""
    return tuple(f"{kind}:{n}" if n else "none" for n in counts)


def _of(unit: str, *counts: float) -> tuple[str, ...]:
    return tuple(f"{n:g} {_ONE.get(unit, unit) if n == 1 else unit}" for n in counts)


_ONE = {"people": "person", "boards": "board", "trains": "train", "beds": "bed"}
_QUIET: Sets = {"n_chairs": 0, "n_people": 0}  # nobody but the crowd
_SCATTERED: Sets = {  # chairs at rest are most of what is in reach
    "motion": 0.0, "crowd": "none", "n_people": 0, "n_chairs": 60, "clutter": 0.1,
    "range_mode": "8m",
}  # fmt: skip
_BEDS = ((1, 2), (1, 5), (2, 8), (3, 12))  # and doctors
_TRAINS = ((1, 2), (2, 4), (3, 7), (4, 10))  # and pickers
_CARRIED = ((2, 75), (4, 60), (6, 40), (8, 25))  # people, and s from one time to the next
_ALL = (
    Track(
        name="tour-guide-v1", world=2, counts=True,
        about="the robot leads visitors through a museum; they walk with it, all round it",
        scene="gallery", axis="people who walk with the robot", says=_of("people", 0, 2, 5, 9, 14),
        sets=_each(motion=1.0, change=0.0, crowd=_crowds("escorts", 0, 2, 5, 9, 14), **_QUIET),
    ),
    Track(
        name="rush-hour-v1", world=2, counts=True,
        about="streams of people cross a station hall",
        scene="station", axis="people in the streams", says=_of("people", 0, 15, 35, 60, 80),
        seconds=90.0, odometry=GOOD_ODOMETRY,
        sets=_each(
            motion=LEVELS, change=0.0, crowd=_crowds("streams", 0, 15, 35, 60, 80),
        ),
    ),
    Track(
        name="busy-chairs-v1", world=2, counts=True,
        about="chairs roll about in a flat and hardly rest",
        scene="apartment", axis="share of 80 chairs on the move at any time",
        says=_of("% of 80 chairs", 0, 25, 50, 75, 100), seconds=120.0,
        sets=_each(
            motion=0.0, change=0.0, crowd="none", n_people=0, n_chairs=80, moving_share=LEVELS,
        ),
    ),
    Track(
        name="moving-boards-v1", world=2, counts=True,
        about="partitions of 1.6 m are pushed about",
        scene="gallery", axis="boards on castors", says=_of("boards", 0, 1, 3, 5, 8),
        seconds=120.0,
        sets=_each(motion=1.0, change=0.0, crowd=_crowds("boards", 0, 1, 3, 5, 8), **_QUIET),
    ),
    Track(
        name="moving-day-v1", world=2, counts=True,
        about="what the robot has seen stands elsewhere when it comes back, all day long",
        scene="random-rooms", axis="share of things put elsewhere while out of sight",
        says=_of("% of things", 0, 25, 50, 75, 100), seconds=120.0,
        sets=_each(change=LEVELS, **_SCATTERED),
    ),
    Track(
        name="overnight-v1", world=2, counts=True,
        about="two days in one stream: in the middle things out of sight are put elsewhere, once",
        scene="random-rooms", axis="share of things put elsewhere at half time",
        says=_of("% of things", 0, 25, 50, 75, 100), seconds=120.0,
        sets=_each(change=LEVELS, change_at_s=60.0, **_SCATTERED),
    ),
    Track(
        name="classroom-break-v1", world=2, counts=True,
        about="the lesson is over: pupils in groups, chairs pushed back",
        scene="classroom", axis="pupils in groups", says=_of("pupils", 0, 4, 10, 18, 28),
        sets=_each(motion=LEVELS, change=0.0, crowd=_crowds("groups", 0, 4, 10, 18, 28)),
    ),
    Track(
        name="warehouse-shift-v1", world=2, counts=False,
        about="trains of trolleys, pickers beside the robot, pallets gone when it is back",
        scene="warehouse", axis="trains of two trolleys, and pickers",
        says=("0 trains", *(f"{_of('trains', a)[0]}, {b} pickers" for a, b in _TRAINS)),
        odometry=GOOD_ODOMETRY,
        sets=_each(
            motion=LEVELS, change=LEVELS,
            crowd=("none", *(f"trains:{a},streams:{a},escorts:{b}" for a, b in _TRAINS)),
        ),
    ),
    Track(
        name="ward-round-v1", world=2, counts=False,
        about="doctors walk with the robot from bed to bed, and beds are pushed past them",
        scene="gallery", axis="beds on the move, and doctors",
        says=("0 beds", *(f"{_of('beds', a)[0]}, {b} doctors" for a, b in _BEDS)),
        sets=_each(
            motion=1.0, change=0.0, **_QUIET,
            crowd=("none", *(f"beds:{a},escorts:{b}" for a, b in _BEDS)),
        ),
    ),
    Track(
        name="slow-scans-v1", world=2, counts=True,
        about="two scans a second, 35 cm of way between them, among people",
        scene="office", axis="people, half of them walk with the robot",
        says=_of("people", 0, 2, 4, 8, 12), seconds=90.0, every=19,
        sets=_each(
            motion=LEVELS, change=0.0,
            crowd=("none", *(f"escorts:{n},streams:{n}" for n in (1, 2, 4, 6))),
        ),
    ),
    Track(
        name="kidnapped-in-a-crowd-v1", world=2, counts=False,
        about="among people the robot is carried away, and its wheels do not know",
        scene="apartment", axis="people who walk about, and s from one time to the next",
        says=("0 people, never", *(f"{n} people, {at} s" for n, at in _CARRIED)),
        seconds=90.0,
        sets=_each(
            motion=LEVELS, change=0.0, n_people=0,
            kidnap_every_s=(None, *(float(at) for _, at in _CARRIED)),
            crowd=("none", *(f"escorts:{n // 2},streams:{n // 2}" for n, _ in _CARRIED)),
        ),
    ),
    Track(
        name="no-walls-v1", world=2, counts=True,
        about="walls that no beam meets: chairs at rest are all there is, and people walk between",
        scene="arena", axis="people who walk with the robot", says=_of("people", 0, 1, 2, 4, 6),
        oracle="oracle(shunting,moving)",
        sets=_each(
            motion=1.0, change=0.0, moving_share=0.0, n_chairs=40, walls="none",
            crowd=_crowds("escorts", 0, 1, 2, 4, 6),
        ),
    ),
)  # fmt: skip

# Since then, their tops found by scripts.benchmark.search on training seeds.
_HALF_TURN = ((1, 1), (2, 2), (4, 3), (5, 4))  # boards, and people who walk with the robot
_HALL = ((1, 5, 2), (3, 10, 4), (4, 15, 6), (6, 20, 8))  # people with it, past it; boards
_ROUND = ((1, 0, 75), (1, 1, 60), (2, 1, 50), (2, 2, 40))  # doctors, visitors; s between times
_CLEARED = ((1, 75), (2, 60), (3, 50), (4, 40))  # people, and s from one time to the next
_HARD = (
    _ALL[3].later(
        test=FRESH, counts=True, says=_of("boards", 0, 3, 6, 9, 12),
        sets=_each(motion=1.0, change=0.0, crowd=_crowds("boards", 0, 3, 6, 9, 12), **_QUIET),
    ),
    _ALL[10].later(
        test=FRESH, counts=True, sets=tuple({**sets, "n_chairs": 10} for sets in _ALL[10].sets)
    ),
    Track(
        name="half-turn-v1", world=2, counts=True, test=FRESH, seconds=120.0,
        about="boards and people in a bare hall that looks the same after half a turn",
        scene="arena", axis="boards on castors, and people who walk with the robot",
        says=("0 boards", *(f"{_of('boards', a)[0]}, {b} people" for a, b in _HALF_TURN)),
        sets=_each(
            motion=1.0, change=0.0, **_QUIET,
            crowd=("none", *(f"boards:{a},escorts:{b}" for a, b in _HALF_TURN)),
        ),
    ),
    Track(
        name="slow-boards-v1", world=2, counts=True, test=FRESH,
        about="partitions of 1.6 m are pushed about, and there are two scans a second",
        scene="gallery", axis="boards on castors", says=_of("boards", 0, 2, 4, 7, 9),
        seconds=120.0, every=19,
        sets=_each(motion=1.0, change=0.0, crowd=_crowds("boards", 0, 2, 4, 7, 9), **_QUIET),
    ),
    Track(
        name="depth-camera-v1", world=2, counts=True, test=FRESH, seconds=120.0,
        about="a depth camera in place of a scanner: a hall is rebuilt while people pass",
        scene="station", axis="boards on castors, and people who walk past or with the robot",
        says=("0 boards", *(f"{c} boards, {a + b} people" for a, b, c in _HALL)),
        scanner=DEPTH_CAMERA, odometry=GOOD_ODOMETRY,
        sets=_each(
            motion=1.0, change=0.0, **_QUIET,
            crowd=("none", *(f"escorts:{a},streams:{b},boards:{c}" for a, b, c in _HALL)),
        ),
    ),
    _ALL[8].later(
        test=FRESH, scene="apartment", seconds=180.0, scanner=DEPTH_CAMERA, odometry=GOOD_ODOMETRY,
        about="a depth camera among doctors and visitors, who carry the robot to other rooms",
        axis="people, and s from one time to the next",
        says=("0 people, never", *(f"{a + b} people, {at} s" for a, b, at in _ROUND)),
        sets=_each(
            motion=1.0, change=0.0, **_QUIET,
            kidnap_every_s=(None, *(float(at) for *_, at in _ROUND)),
            crowd=("none", *(f"escorts:{a},streams:{b}" for a, b, _ in _ROUND)),
        ),
    ),
    _ALL[4].later(
        test=FRESH, scene="apartment", seconds=180.0, scanner=DEPTH_CAMERA, odometry=GOOD_ODOMETRY,
        about="a depth camera in a flat that is cleared: chairs roll, and the robot is carried",
        axis="people who walk to and fro, share of 20 chairs on the move, and s between carries",
        says=("0 people, 0 %, never", *(f"{n} people, {25 * n} %, {at} s" for n, at in _CLEARED)),
        sets=_each(
            motion=1.0, change=0.0, n_people=0, n_chairs=20, moving_share=LEVELS,
            kidnap_every_s=(None, *(float(at) for _, at in _CLEARED)),
            crowd=_crowds("streams", 0, 1, 2, 3, 4),
        ),
    ),
)  # fmt: skip

TRACKS: dict[str, Track] = {}


def register(*tracks: Track) -> None:
    """Declare tracks; ``InvalidValueError`` for a name that another one has."""
    for track in tracks:
        if TRACKS.setdefault(track.name, track) != track:
            raise InvalidValueError(
                f"track {track.name} is there already and never changes; a new version of it is "
                f"TRACKS['{track.name}'].later(...)"
            )


register(*_ALL, *_HARD)


def newest() -> dict[str, Track]:
    """By name without version: the newest version of every track."""
    found: dict[str, Track] = {}
    for track in sorted(TRACKS.values(), key=lambda track: track.version):
        found[track.family] = track
    return found


def chosen(names: Iterable[str] | None) -> tuple[Track, ...]:
    """The tracks of these names, without a version the newest; without any, the newest of all.

    Raises ``UnknownNameError`` with the nearest name.
    """
    latest = newest()
    found: dict[str, Track] = {}
    for name in names or latest:
        track = TRACKS.get(name) or latest.get(name)
        if track is None:
            near = get_close_matches(name, (*TRACKS, *latest), n=1)
            hint = f" Did you mean '{near[0]}'?" if near else ""
            raise UnknownNameError(f"no track is called '{name}'.{hint} Known: {', '.join(TRACKS)}")
        found[track.name] = track
    return tuple(found.values())


def check_known(path: Path, world: int, hashes: Mapping[str, str]) -> None:
    """That the tracks in a file, by name with their hash, are those of that name here.

    Raises ``LogFormatError``, and ``WorldVersionError`` for a file of a newer world. One of an
    older world may be read: only to make its scans again is refused (``Track.plan``).
    """
    if world > versions.WORLD:
        versions.check_world(path, world)
    for name, sha256 in hashes.items():
        track = TRACKS.get(name)
        if track is None or track.sha256 != sha256:
            raise LogFormatError(path, f"track {name!r:.80} is none of this version's")
        if track.world != world:
            raise LogFormatError(
                path, f"{name} must be of world {track.world}, the file says {world}"
            )

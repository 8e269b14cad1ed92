# SPDX-License-Identifier: Apache-2.0
"""The tracks of the benchmark. A track never changes: what is new is a new version of it.

A new track, or a new version of one, is one more table of ``tracks.toml``, which moves the hash of
no other, or is declared with ``register`` in a file of one's own (``mobilia --with``).
"""

import hashlib
import json
import re
import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

from scripts.comparison.plan import Plan
from scripts.comparison.rules import LEVEL
from scripts.report.answer import ODOMETRY
from sim.core import versions
from slam.errors import InvalidValueError, LogFormatError, UnknownNameError, meant
from slam.variants import MAP_ORACLE

LEVELS = (0.0, 0.25, 0.5, 0.75, 1.0)  # of every track, from nothing to all that it has
QUICK_LEVELS = (0.0, 0.5, 1.0)
TRAIN = tuple(range(20))  # seeds to tune on; those that the SLAMs here were tuned on
TEST = tuple(range(720, 740))  # seeds that count, of the first versions
FRESH = tuple(range(906, 926))  # of what came after: nothing was run on them before it was frozen
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

    def later(self, **changes: Any) -> "Track":
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


TRACKS: dict[str, Track] = {}


def register(*tracks: Track) -> None:
    """Declare tracks; ``InvalidValueError`` for a name that another one has."""
    for track in tracks:
        if TRACKS.setdefault(track.name, track) != track:
            raise InvalidValueError(
                f"track {track.name} is there already and never changes; a new version of it is "
                f"TRACKS['{track.name}'].later(...)"
            )


def _of(name: str, row: dict[str, Any]) -> Track:
    """A table of ``tracks.toml``: five values are each a level's own, one is that of all."""
    sets, fresh = row.pop("sets"), row.pop("fresh", False)
    each = {k: v if isinstance(v, list) else [v] * len(LEVELS) for k, v in sets.items()}
    levels = [
        {k: None if v[at] == "never" else v[at] for k, v in each.items()}
        for at in range(len(LEVELS))
    ]
    row |= {"says": tuple(row["says"]), "sets": tuple(levels)}
    return Track(name=name, test=FRESH if fresh else TEST, **row)


_OURS = tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))
register(*(_of(name, row) for name, row in _OURS.items()))


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
            hint = meant(name, (*TRACKS, *latest))
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

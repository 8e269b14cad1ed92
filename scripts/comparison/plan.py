# SPDX-License-Identifier: Apache-2.0
"""What is to be compared, and the jobs that it takes: one a run, and one for each SLAM on it."""

from __future__ import annotations

import importlib.util
import shlex
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path
from typing import Any

import scenes
import sim
import slam
from scripts.checked import whole
from scripts.comparison import entry, recording
from scripts.comparison.rules import LEVEL
from scripts.comparison.schema import LATER, settings
from scripts.imports import with_imports
from scripts.jobs import Job
from scripts.knobs import axis_of, options_with
from scripts.names import file_name
from sim.recording.recipe import Recipe
from sim.simulation import n_frames
from sim.world.times_of_day import MOST_SESSIONS
from slam.errors import InvalidValueError
from slam.guests import Limits
from slam.names import join_folders, loaded
from slam.variants import PIPE, inside

RECORDINGS, ENTRIES = "recordings", "entries"
MAX_RUNS = 100_000
# What a level may set of a recipe; whatever else it sets are options of the scene.
_OF_RECIPE = (
    "dynamism", "motion", "change", "moving_share", "change_at_s", "kidnap_every_s", "range_mode",
)  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Run:
    """One simulated run; ``name`` as in the files: ``office_d0.25_s100``, ``office_m0.25_s100``.

    dynamism  its level, which is of ``axis``
    """

    scene: str
    dynamism: float
    seed: int
    axis: str = "dynamism"

    @property
    def name(self) -> str:
        """Letters, digits, - _ . only."""
        return f"{file_name(self.scene)}_{self.axis[0]}{self.dynamism:g}_s{self.seed}"


@dataclass(frozen=True, kw_only=True)
class Plan:
    """Every SLAM on every scene at every level with every seed.

    slams, scenes  by name or as module:Class, module:function
    levels    of dynamism, each in [0, 1], or of another ``axis`` (``scripts.knobs``)
    seeds     whole numbers >= 0, the same at every level
    seconds   of driving
    every     one scan in so many is kept
    scanner   by name (``sim.sensors.lidar.registry``)
    odometry  preset of the wheel encoders
    motion, change, crowd  the same in every run; None: as ``scripts.knobs.Axis`` says
    sets      of axis "level": what each level sets, fields of ``Recipe`` and options of the scene
    scan_limit_s  that module:Class and pipe:COMMAND may take for a scan before they count as hung
    judge_maps  once a second against the truth (``scripts.comparison.maps``); it can take as long
             as the SLAM does
    sessions  of a building beside each run, in whose map SLAMs live from session to session
             (``scripts.days.plan``); None: no buildings
    """

    slams: tuple[str, ...]
    scenes: tuple[str, ...]
    levels: tuple[float, ...]
    seeds: tuple[int, ...]
    seconds: float = 60.0
    every: int = 8
    scanner: str = "full"
    scan_limit_s: float = Limits.scan_s
    axis: str = "dynamism"
    motion: float | None = None
    change: float | None = None
    crowd: str | None = None
    odometry: str = "pioneer3dx"
    sets: tuple[Mapping[str, Any], ...] = ()
    judge_maps: bool = True
    sessions: int | None = None

    def __post_init__(self) -> None:
        Limits(scan_s=self.scan_limit_s)
        self._check_axis()
        for name in ("slams", "scenes", "levels", "seeds"):
            values = getattr(self, name)
            if not values or len(set(values)) != len(values):
                raise InvalidValueError(f"Plan.{name} must be one or more, each once, got {values}")
        whole("Plan.every", self.every, 1, 1000)
        if len(self.scenes) * len(self.levels) * len(self.seeds) > MAX_RUNS:
            raise InvalidValueError(f"a comparison has at most {MAX_RUNS} runs")
        for run in self.runs():
            self.recipe(run)  # complains of values that cannot be
        self._check_sessions()
        self._check_file()
        period_s = self.recipe(self.runs()[0]).laser().scanner().period_s
        if n_frames(self.seconds, float(period_s)) <= self.every:
            raise InvalidValueError(
                f"a comparison needs 2 scans a run: {self.seconds:g} s with one scan in "
                f"{self.every} of {float(1 / period_s):g} a second has 1"
            )

    def _check_axis(self) -> None:
        if self.axis != LEVEL:
            axis_of(asdict(self))
        elif (self.motion, self.change, self.crowd) != (None, None, None):
            raise InvalidValueError("Plan: with axis 'level' the levels set motion, change, crowd")
        fits = len(self.sets) == (len(self.levels) if self.axis == LEVEL else 0)
        if not fits or not all(isinstance(one, Mapping) for one in self.sets):
            raise InvalidValueError(
                f"Plan.sets must have a mapping a level of axis 'level', got {self.sets!r:.80}"
            )

    def _check_file(self) -> None:
        """What no recipe could hold would not be read again."""
        for name, rule in {**settings(self.axis), **LATER}.items():
            value = getattr(self, name, None)
            if hasattr(self, name) and not rule.holds(value):
                raise InvalidValueError(f"Plan.{name} must be {rule.wanted}, got {value!r:.80}")

    def _check_sessions(self) -> None:
        if self.sessions is None:
            return
        whole("--sessions", self.sessions, 2, MOST_SESSIONS)
        changes = self.levels if self.axis == "change" else (self.change or 0.0,)
        if self.axis == LEVEL or not max(changes) > 0.0:
            raise InvalidValueError(
                "--sessions needs a share of things that stand elsewhere from one session to the "
                "next: levels of it, as --change 0.3 0.6, or one held beside levels of --motion "
                "or --dynamism, as --change 0.3. Without it all sessions would find the same room"
            )

    def settings(self) -> dict[str, Any]:
        """For a recipe; without ``sessions`` where there are none, as it was before these."""
        return {k: v for k, v in asdict(self).items() if k != "sessions" or v is not None}

    def runs(self) -> list[Run]:
        """Every simulated run, scene by scene, level by level."""
        return [
            Run(scene=scene, dynamism=level, seed=seed, axis=self.axis)
            for scene in self.scenes
            for level in self.levels
            for seed in self.seeds
        ]

    def recipe(self, run: Run) -> Recipe:
        """Of a run's simulation."""
        if self.axis == LEVEL:
            given = self.sets[self.levels.index(run.dynamism)]
            own = {"dynamism": 0.0, **{k: v for k, v in given.items() if k in _OF_RECIPE}}
            options = {k: v for k, v in given.items() if k not in _OF_RECIPE}
        else:
            own, options = axis_of(asdict(self)).at(run.dynamism), options_with(self.crowd)
        return Recipe(
            scene=run.scene, seed=run.seed, **own, seconds=self.seconds, scanner=self.scanner,
            odometry=self.odometry, options=options,
        )  # fmt: skip

    def recordings(self) -> dict[str, Job]:
        """The jobs that simulate, by the names of the runs."""
        code = (*sources(sim, scenes), *scripts_of(recording.__file__, recording.__name__))
        own = {name: (*code, *source_of_scene(name), *source_of_loaded()) for name in self.scenes}
        return {
            run.name: Job(
                name=run.name,
                call=recording.record,
                arguments={**asdict(self.recipe(run)), "every": self.every},
                code=own[run.scene],
            )
            for run in self.runs()
        }

    def entries(self) -> Iterator[tuple[Run, str, Job]]:
        """The jobs that run a SLAM over a recording: run, SLAM, job."""
        recordings = {name: job.file_name() for name, job in self.recordings().items()}
        own = (*sources(slam), *scripts_of(entry.__file__, entry.__name__))
        for name in self.slams:
            code = (*own, *source_of(name), *source_of_loaded())
            for run in self.runs():
                file = f"{RECORDINGS}/{recordings[run.name]}"
                arguments: dict[str, Any] = {"recording": file, "slam": name}
                if ":" in name:  # ours are not limited
                    arguments["scan_limit_s"] = self.scan_limit_s
                if not self.judge_maps:
                    arguments["judge_maps"] = False
                job = Job(
                    name=f"{run.name}_{file_name(name)}",
                    call=entry.enter,
                    arguments=arguments,
                    code=code,
                )
                yield run, name, job


def sources(*packages: Any) -> tuple[Path, ...]:
    """The folders of packages, for ``Job.code``."""
    return tuple(Path(package.__file__).parent for package in packages)


@cache
def scripts_of(file: str, module: str) -> tuple[Path, ...]:
    """A script and those that it imports, for ``Job.code`` beside the packages that it calls."""
    folder = Path(__file__).resolve().parents[1]
    return tuple(path for path in with_imports(Path(file), module) if folder in path.parents)


def source_of(slam: str) -> tuple[Path, ...]:
    """The file of a SLAM's own module, or those that a command names, and what Python files among
    them import from beside them: with any of it changed, its runs are made again."""
    slam = inside(slam)
    kind, _, command = slam.partition(":")
    if not command:
        return ()
    if slam.startswith(PIPE):
        named = [path for path in map(Path, shlex.split(command)) if path.is_file()]
        return tuple(file for path in named for file in _whole(path, path.stem))
    return _of_module(kind)


def source_of_scene(scene: str) -> tuple[Path, ...]:
    """The files of a scene's own module as ``source_of`` has them, and the plans and parts (MJCF)
    in their folders."""
    module, colon, _ = scene.partition(":")
    python = _of_module(module) if colon else ()
    return (*python, *sorted({xml for file in python for xml in file.parent.glob("*.xml")}))


def source_of_loaded() -> tuple[Path, ...]:
    """The files of the modules that ``--with`` has loaded: what they register is known by a name
    that does not tell where it comes from."""
    return tuple(file for module in loaded() for file in _of_module(module))


def _of_module(module: str) -> tuple[Path, ...]:
    join_folders()
    spec = importlib.util.find_spec(module)
    return _whole(Path(spec.origin), module) if spec and spec.origin and spec.has_location else ()


def _whole(file: Path, module: str) -> tuple[Path, ...]:
    return with_imports(file, module) if file.suffix == ".py" else (file,)

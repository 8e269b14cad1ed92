# SPDX-License-Identifier: Apache-2.0
"""What is to be compared, and the jobs that it takes: one a run, and one for each SLAM on it."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields, replace
from pathlib import Path
from typing import Any

import scenes
import sim
import slam
from scenes import is_file
from scenes.scene_file import sha256_of
from scripts.comparison import entry, recording
from scripts.comparison.rules import LEVEL
from scripts.comparison.schema import LATER, settings
from scripts.engine import Stage
from scripts.imports import code_of
from scripts.jobs import Job
from scripts.names import file_name
from scripts.options import Axis, options_with, whole
from sim.recording.recipe import Recipe
from sim.simulation import n_frames
from sim.world.times_of_day import MOST_SESSIONS
from slam.errors import InvalidValueError
from slam.guests import Limits
from slam.names import NameFromFile
from slam.shaped import shaped

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
class Asked:
    """What every study of simulated rooms has: SLAMs at every level with every seed.

    slams     by name or as module:Class
    levels    of dynamism, each in [0, 1], or of another ``axis`` (``scripts.options``)
    seeds     whole numbers >= 0, the same at every level
    scanner   by name (``sim.sensors.lidar.registry``)
    motion, change, crowd  the same in every run; None: as ``scripts.options.Axis`` says
    """

    slams: tuple[str, ...]
    levels: tuple[float, ...]
    seeds: tuple[int, ...]
    scanner: str = "full"
    axis: str = "dynamism"
    motion: float | None = None
    change: float | None = None
    crowd: str | None = None

    @property
    def levels_of(self) -> Axis:
        """What the levels are of; errors for an axis that is none."""
        return Axis(name=self.axis, motion=self.motion, change=self.change, crowd=self.crowd)

    def check_each_once(self, *names: str) -> None:
        """``InvalidValueError`` for a field that names nothing, or something twice."""
        for name in names:
            values = getattr(self, name)
            if not values or len(set(values)) != len(values):
                raise InvalidValueError(f"Plan.{name} must be one or more, each once, got {values}")


@dataclass(frozen=True, kw_only=True)
class Plan(Asked):
    """Every SLAM on every scene at every level with every seed.

    scenes    by name or as module:function
    seconds   of driving
    every     one scan in so many is kept
    odometry  preset of the wheel encoders
    sets      of axis "level": what each level sets, fields of ``Recipe`` and options of the scene
    scan_limit_s  that module:Class and pipe:COMMAND may take for a scan before they count as hung
    judge_maps  once a second against the truth (``scripts.comparison.maps``); it can take as long
             as the SLAM does
    sessions  of a building beside each run, in whose map SLAMs live from session to session
             (``scripts.days.buildings``); None: no buildings
    scene_sha256  of scenes by their files; found where the names are not from a file themselves
    """

    scenes: tuple[str, ...]
    seconds: float = 60.0
    every: int = 8
    scan_limit_s: float = Limits.scan_s
    odometry: str = "pioneer3dx"
    sets: tuple[Mapping[str, Any], ...] = ()
    judge_maps: bool = True
    sessions: int | None = None
    scene_sha256: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        typed = [s for s in self.scenes if is_file(s) and not isinstance(s, NameFromFile)]
        found = {scene: sha256_of(scene) for scene in typed if scene not in self.scene_sha256}
        object.__setattr__(self, "scene_sha256", {**self.scene_sha256, **found})
        Limits(scan_s=self.scan_limit_s)
        self._check_axis()
        self.check_each_once("slams", "scenes", "levels", "seeds")
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
            self.levels_of.at(0.0)  # complains of an axis that cannot be
        elif (self.motion, self.change, self.crowd) != (None, None, None):
            raise InvalidValueError("Plan: with axis 'level' the levels set motion, change, crowd")
        fits = len(self.sets) == (len(self.levels) if self.axis == LEVEL else 0)
        if not fits or not all(isinstance(one, Mapping) for one in self.sets):
            raise InvalidValueError(
                f"Plan.sets must have a mapping a level of axis 'level', got {self.sets!r:.80}"
            )

    def _check_file(self) -> None:
        """What no recipe could hold would not be read again."""
        kinds = {**settings(self.axis), **LATER}
        for one in fields(self):  # a new one wants a row of ``LATER``
            shaped(f"Plan.{one.name}", getattr(self, one.name), kinds[one.name])

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
        """For a recipe; without what later came where there is none of it, as it was before."""
        later = ("sessions", "scene_sha256")
        return {k: v for k, v in asdict(self).items() if k not in later or v}

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
            axis = self.levels_of
            own, options = axis.at(run.dynamism), options_with(axis.crowd_at(run.dynamism))
        return Recipe(
            scene=run.scene, seed=run.seed, **own, seconds=self.seconds, scanner=self.scanner,
            odometry=self.odometry, options=options,
            scene_sha256=self.scene_sha256.get(run.scene),
        )  # fmt: skip

    def recordings(self) -> dict[str, Job]:
        """The jobs that simulate, by the names of the runs."""
        code = {scene: simulator(scene) for scene in self.scenes}
        return {
            run.name: simulating(run.name, self.recipe(run), self.every, code[run.scene])
            for run in self.runs()
        }

    def entries(self, call: Callable[..., None] = entry.enter) -> Iterator[tuple[Run, str, Job]]:
        """The jobs that run a SLAM over a recording, by ``call``: run, SLAM, job."""
        recordings = {name: job.file_name() for name, job in self.recordings().items()}
        for name in self.slams:
            job = running(call, name, self.scan_limit_s)
            for run in self.runs():
                own: dict[str, Any] = {"recording": f"{RECORDINGS}/{recordings[run.name]}"}
                own |= {} if self.judge_maps else {"judge_maps": False}
                yield run, name, replace(job.over(run.name, own), seconds=self.seconds)

    def stages(self) -> tuple[Stage, Stage]:
        """All of these jobs."""
        simulations = tuple(self.recordings().values())
        entries = tuple(job for _, _, job in self.entries())
        return (
            Stage(title="simulating", folder=RECORDINGS, jobs=simulations),
            Stage(title="running SLAMs", folder=ENTRIES, jobs=entries),
        )


def ahead(plan: Plan, out: Path) -> tuple[list[Job], int]:
    """The jobs that are not done yet in ``out``, of how many; buildings over days aside."""
    stages = plan.stages()
    missing = [job for stage in stages for job in stage.missing(out)]
    return missing, sum(len(stage.jobs) for stage in stages)


def simulator(scene: str) -> tuple[Path, ...]:
    """What a recording in that scene depends on."""
    return code_of(recording.record, sim, scenes, scene=scene)


def simulating(name: str, recipe: Recipe, every: int, code: Sequence[Path]) -> Job:
    """The job that records one scan in ``every`` of a simulation."""
    arguments = {**asdict(recipe), "every": every}
    seconds = recipe.seconds
    return Job(name=name, call=recording.record, arguments=arguments, seconds=seconds, code=code)


def running(call: Callable[..., None], name: str, scan_limit_s: float) -> Job:
    """The job of a SLAM on nothing yet: ``Job.over`` says on what. Ours are not limited."""
    limit = {"scan_limit_s": scan_limit_s} if ":" in name else {}
    return Job(
        name=file_name(name),
        call=call,
        arguments={"slam": name, **limit},
        code=code_of(call, slam, slam=name),
    )

# SPDX-License-Identifier: Apache-2.0
"""Many buildings, every SLAM in each: the jobs that it takes, and the rows that come of them."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from scripts.comparison.make import Beside, Tables
from scripts.comparison.plan import Plan, running, simulating, simulator
from scripts.comparison.schema import AGES, AGES_LEVELS
from scripts.comparison.tables import Row
from scripts.days import lifelong, scores
from scripts.days.sessions import EVERY, checked_count
from scripts.engine import Files, Stage, make
from scripts.jobs import Job
from scripts.names import file_name
from sim.recording.recipe import MAX_SECONDS, Recipe
from slam.errors import InvalidValueError
from slam.guests import Limits

SESSIONS, LIVES = "sessions", "lives"  # folders
FIRST = 3.0  # times as long as the others is the first session, which maps the building


def identity(recipe: Recipe) -> Row:
    """The first columns of its rows: scene, motion, change, seed."""
    motion = recipe.dynamism if recipe.motion is None else recipe.motion
    return {
        "scene": recipe.scene, "motion": float(motion), "change": recipe.share_changed,
        "seed": recipe.seed,
    }  # fmt: skip


def name_of(recipe: Recipe) -> str:
    """Of a building, as in the files: ``random-rooms_m0_c0.3_s720``."""
    of = identity(recipe)
    return f"{file_name(of['scene'])}_m{of['motion']:g}_c{of['change']:g}_s{of['seed']}"


@dataclass(frozen=True, kw_only=True)
class Buildings:
    """Every SLAM in every building.

    slams     by name or as module:Class
    recipes   one for each building, as of any of its sessions but the first
    sessions  of each building, the first included
    every     one scan in so many is kept
    scan_limit_s  that module:Class and pipe:COMMAND may take for a scan before they count as hung
    """

    slams: tuple[str, ...]
    recipes: tuple[Recipe, ...]
    sessions: int
    every: int = EVERY
    scan_limit_s: float = Limits.scan_s

    def __post_init__(self) -> None:
        checked_count(self.sessions)
        Limits(scan_s=self.scan_limit_s)
        names = [name_of(recipe) for recipe in self.recipes]
        if not names or len(set(names)) != len(names):
            raise InvalidValueError(
                f"Buildings.recipes must be one or more, each once, got {names}"
            )
        longest = max(recipe.seconds for recipe in self.recipes)
        if FIRST * longest > MAX_SECONDS:
            raise InvalidValueError(
                f"--seconds must be at most {MAX_SECONDS / FIRST:g}, as session 0 lasts {FIRST:g} "
                f"times as long, got {longest:g}"
            )

    def session(self, recipe: Recipe, number: int) -> Recipe:
        """Of that session of a building."""
        seconds = FIRST * recipe.seconds if number == 0 else recipe.seconds
        return replace(recipe, session=number, seconds=seconds)

    def recordings(self) -> dict[str, list[Job]]:
        """The jobs that simulate, session by session, by the names of the buildings."""
        found = {}
        for recipe in self.recipes:
            name, code = name_of(recipe), simulator(recipe.scene)
            found[name] = [
                simulating(f"{name}_session{k:02d}", self.session(recipe, k), self.every, code)
                for k in range(self.sessions)
            ]
        return found

    def lives(self) -> Iterator[tuple[Recipe, str, Job]]:
        """The jobs in which a SLAM lives in a building: building, SLAM, job."""
        files = {
            name: [f"{SESSIONS}/{job.file_name()}" for job in jobs]
            for name, jobs in self.recordings().items()
        }
        for name in self.slams:
            job = replace(running(lifelong.live, name, self.scan_limit_s), suffix=".json")
            for recipe in self.recipes:
                building = name_of(recipe)
                yield recipe, name, job.over(building, {"sessions": files[building]})

    def stages(self, folder: str = "") -> tuple[Stage, Stage]:
        """All of these jobs, their files in a folder within that of a study."""
        sessions = tuple(job for own in self.recordings().values() for job in own)
        lives = tuple(job for _, _, job in self.lives())
        return (
            Stage(title="simulating sessions", folder=str(Path(folder, SESSIONS)), jobs=sessions),
            Stage(title="living in buildings", folder=str(Path(folder, LIVES)), jobs=lives),
        )

    def rows(self, done: Files) -> list[Row]:
        """A row (``scores.COLUMNS``) for each SLAM and building."""
        rows = []
        for recipe, slam, job in self.lives():
            found = lifelong.read(done[job.name])
            of = {**identity(recipe), "slam": slam}
            rows.append(scores.of_building(of, found["rows"], found["ages"], found["failure"]))
        return rows


def of_comparison(plan: Plan) -> Buildings | None:
    """The buildings beside the runs of a comparison, one at each level; None without sessions."""
    if plan.sessions is None:
        return None
    recipes = [plan.recipe(run) for run in plan.runs()]
    return Buildings(
        slams=plan.slams,
        recipes=tuple({name_of(recipe): recipe for recipe in recipes}.values()),
        sessions=plan.sessions,
        every=plan.every,
        scan_limit_s=plan.scan_limit_s,
    )


DAYS = "days"  # folder of what buildings take, within a comparison or a benchmark


def carry_out(buildings: Buildings, out: Path, **ways: Any) -> list[Row]:
    """Make what is missing in ``out``, as ``scripts.engine.make`` does; ``Buildings.rows``."""
    return buildings.rows(make(buildings.stages(), out, **ways))


def beside(plan: Plan) -> Beside | None:
    """For ``scripts.comparison.make.carry_out``: the buildings of a comparison, and the tables of
    their scores; None of one without sessions. Raises ``InvalidValueError`` for what cannot be.
    """
    buildings = of_comparison(plan)
    if buildings is None:
        return None

    def tables(done: Files) -> Tables:
        rows = buildings.rows(done)
        return {AGES: rows, AGES_LEVELS: scores.levels(rows)}

    return Beside(stages=buildings.stages(DAYS), tables=tables)

# SPDX-License-Identifier: Apache-2.0
"""Many buildings, every SLAM in each, and the jobs that it takes: one a session, one a SLAM."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from typing import Any

import scenes
import sim
import slam
from scripts.comparison import recording
from scripts.comparison.plan import (
    Plan,
    scripts_of,
    source_of,
    source_of_loaded,
    source_of_scene,
    sources,
)
from scripts.days import living
from scripts.days.sessions import EVERY, checked_count
from scripts.jobs import Job
from scripts.names import file_name
from sim.recording.recipe import MAX_SECONDS, Recipe
from slam.errors import InvalidValueError
from slam.guests import Limits

SESSIONS, LIVES = "sessions", "lives"  # folders
FIRST = 3.0  # times as long as the others is the first session, which maps the building


def identity(recipe: Recipe) -> dict[str, Any]:
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
        code = (*sources(sim, scenes), *scripts_of(recording.__file__, recording.__name__))
        code += source_of_loaded()
        return {
            name_of(recipe): [
                Job(
                    name=f"{name_of(recipe)}_session{number:02d}",
                    call=recording.record,
                    arguments={**asdict(self.session(recipe, number)), "every": self.every},
                    code=(*code, *source_of_scene(recipe.scene)),
                )
                for number in range(self.sessions)
            ]
            for recipe in self.recipes
        }

    def lives(self) -> Iterator[tuple[Recipe, str, Job]]:
        """The jobs in which a SLAM lives in a building: building, SLAM, job."""
        files = {
            name: [f"{SESSIONS}/{job.file_name()}" for job in jobs]
            for name, jobs in self.recordings().items()
        }
        own = (*sources(slam), *scripts_of(living.__file__, living.__name__), *source_of_loaded())
        for slam_name in self.slams:
            for recipe in self.recipes:
                arguments: dict[str, Any] = {"sessions": files[name_of(recipe)], "slam": slam_name}
                if ":" in slam_name:  # ours are not limited
                    arguments["scan_limit_s"] = self.scan_limit_s
                job = Job(
                    name=f"{name_of(recipe)}_{file_name(slam_name)}",
                    call=living.live,
                    arguments=arguments,
                    suffix=".json",
                    code=(*own, *source_of(slam_name)),
                )
                yield recipe, slam_name, job


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

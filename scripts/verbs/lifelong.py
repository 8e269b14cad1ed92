# SPDX-License-Identifier: Apache-2.0
"""``mobilia lifelong``: SLAMs over the sessions of a building, each in the map of those before."""

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.markup import escape

from scripts.console import console, say, working
from scripts.names import check
from scripts.options import CrowdOption, Motion, Overwrite, PlanOnly, Scanner, named, options_with
from slam.errors import InvalidValueError

if TYPE_CHECKING:
    from scripts.days.lifelong import Building
    from scripts.days.sessions import Drive
    from sim.recording.recipe import Recipe


Row = dict[str, Any]


def lifelong(
    folder: Annotated[
        Path | None,
        typer.Argument(help="A dataset of [bold]mobilia generate --sessions[/bold]."),
    ] = None,
    slam: Annotated[
        list[str] | None, typer.Option(help="SLAMs: --slam A B C; default shunting occupancy.")
    ] = None,
    scene: Annotated[
        str | None, typer.Option(help="Or a scene, whose sessions are simulated here.")
    ] = None,
    sessions: Annotated[int, typer.Option(help="How many of them, the first included.")] = 11,
    change: Annotated[
        float, typer.Option(help="Share of things and doors put elsewhere between two sessions.")
    ] = 0.3,
    dynamism: Annotated[float, typer.Option(help="How much the room moves in a session.")] = 0.5,
    motion: Motion = None,
    crowd: CrowdOption = None,
    seconds: Annotated[float, typer.Option(help="Length of a simulated session, s.")] = 60.0,
    first_seconds: Annotated[
        float | None, typer.Option(help="Of the first one, which maps the building; default three.")
    ] = None,
    seed: Annotated[int, typer.Option(help="Of the building.")] = 0,
    scanner: Scanner = "full",
    out: Annotated[Path | None, typer.Option(help="Folder to write; default out/lifelong.")] = None,
    overwrite: Overwrite = False,
    plan_only: PlanOnly = False,
) -> None:
    """Let SLAMs live in a building: each session starts anywhere in the map of those before.

    [bold]mobilia lifelong --scene random-rooms --sessions 10 --change 0.3[/bold]

    [bold]mobilia lifelong out/days --slam shunting,occupancy,kiss-icp[/bold]
    """
    if (folder is None) == (scene is None):
        raise InvalidValueError("name exactly one of FOLDER and --scene")
    names = list(dict.fromkeys(named(["shunting", "occupancy"] if slam is None else slam)))
    if not names:
        raise InvalidValueError("--slam must name at least one SLAM")
    check(names, *([scene] if scene else []))
    from scripts.days import sessions as days
    from scripts.days.buildings import FIRST
    from scripts.pace import Work, announce, timed
    from sim.recording.recipe import MAX_SECONDS, Recipe

    if folder is not None:
        count = len(days.recorded(folder))  # complains before anything is written
        work = Work(f"lifelong, recorded, {' '.join(names)}", count)
        announce(f"{count} sessions, {len(names)} SLAMs", [work])
        if not plan_only:
            with timed(work):
                _write(names, days.read(folder), {"dataset": folder.name}, out, overwrite)
        return
    assert scene is not None
    recipe = Recipe(
        scene=scene, seed=seed, dynamism=dynamism, motion=motion, change=change, seconds=seconds,
        scanner=scanner, session=days.checked_count(sessions) - 1, options=options_with(crowd),
    )  # fmt: skip
    first_s = FIRST * seconds if first_seconds is None else first_seconds
    if not 0.0 < first_s <= MAX_SECONDS:
        raise InvalidValueError(
            f"--first-seconds must be > 0 and at most {MAX_SECONDS:g}, got {first_s}"
        )
    work = Work(f"lifelong {' '.join(names)}", first_s + seconds * (sessions - 1))
    announce(f"{sessions} sessions of {scene}, {len(names)} SLAMs", [work])
    if plan_only:
        return
    with timed(work):
        drives = days.simulated(recipe, sessions, first_s)
        _write(names, drives, _settings(recipe, sessions, first_s), out, overwrite)


def _settings(recipe: "Recipe", sessions: int, first_seconds: float) -> dict[str, Any]:
    return {
        "scene": recipe.scene, "seed": recipe.seed, "dynamism": recipe.dynamism,
        "motion": recipe.motion, "change": recipe.change, "sessions": sessions,
        "seconds": recipe.seconds, "first_seconds": first_seconds,
        "scanner": recipe.scanner, "options": dict(recipe.options),
    }  # fmt: skip


def _write(
    names: list[str],
    drives: "Iterator[Drive]",
    settings: dict[str, Any],
    out: Path | None,
    overwrite: bool,
) -> None:
    from scripts.days import lifelong as life
    from scripts.days import tables
    from scripts.days.report import Changed, changes_of
    from scripts.output import write_recipe
    from scripts.pages.page import Page, Part, command, tell
    from scripts.pages.page import write as write_page
    from scripts.whole_folder import whole_folder

    settings = {"slams": names, **settings}
    path = out or Path("out") / "lifelong"
    with whole_folder(path, overwrite=overwrite, command="lifelong", settings=settings) as folder:
        buildings = life.started(names, folder)
        (folder / "replays").mkdir()
        for building in buildings:
            building.replays = folder / "replays"
        kept: dict[int, Drive] = {}
        with working("living through the sessions"):
            rows, aged = life.lived(buildings, _noted(drives, kept))
        living = next((b for b in buildings if not b.anew), None)
        changed = Changed() if living is None else changes_of(folder, living, kept)
        tables.write(folder, rows, settings, changed.score, aged)
        by_slam = {name: [row for row in rows if row["slam"] == name] for name in names}
        said = {b.name: _sentence(b, by_slam[b.name], aged) for b in buildings}
        lives = [
            Part(
                title=f"The life of {name}", note=said[name],
                table=tables.printed(name, own, whole=True),
            )
            for name, own in by_slam.items()
        ]  # fmt: skip
        older = [Part(title="Older maps", table=tables.ages_table(aged))] if aged else []
        first = names[0] if living is None else living.name
        page = Page(
            title=f"A building over {len(kept)} sessions",
            said=[tables.last_session(by_slam[first], changed.said)],
            parts=[*changed.parts, *lives, *older], settings=settings,
            next={} if living is None else {
                "A session of your own in this map:": command(
                    "run", first, "--log", "LOG", "--map-in", path / living.map.name
                )
            },
        )  # fmt: skip
        write_recipe(folder, "lifelong", settings)
        write_page(folder, page)
    for name, own in by_slam.items():
        console.print(tables.printed(name, own))
        say(escape(said[name]))
    tell(path, page)


def _sentence(building: "Building", rows: list[Row], aged: list[Row]) -> str:
    """What the sessions of a SLAM come to."""
    from scripts.days.scores import of_building
    from scripts.report.score_tables import sentences

    of = {"scene": "", "motion": 0.0, "change": 0.0, "seed": 0, "slam": building.name}
    old = [row for row in aged if row["slam"] == building.name]
    failure = building.failures[0] if building.failures else None
    return sentences([of_building(of, rows, old, failure)])[0]


def _noted(drives: "Iterator[Drive]", kept: "dict[int, Drive]") -> "Iterator[Drive]":
    """The same, each also kept for the comparison of sessions."""
    for drive in drives:
        kept[drive.number] = drive
        yield drive

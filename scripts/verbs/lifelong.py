# SPDX-License-Identifier: Apache-2.0
"""``mobilia lifelong``: SLAMs over the sessions of a building, each in the map of those before."""

from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import TYPE_CHECKING, Any

from scripts import options
from scripts.console import console, working
from scripts.names import check
from scripts.spec import SCENES, SLAMS, argument, command_line, option, part, spec
from slam.errors import InvalidValueError

if TYPE_CHECKING:
    from scripts.days.lifelong import Building
    from scripts.days.sessions import SessionDrive
    from sim.recording.recipe import Recipe


Row = dict[str, Any]


@spec
class Lifelong:
    """Let SLAMs live in a building: each session starts anywhere in the map of those before.

    [bold]mobilia lifelong --scene random-rooms --sessions 10 --change 0.3[/bold]

    [bold]mobilia lifelong out/days --slam shunting,occupancy,kiss-icp[/bold]
    """

    folder: Path | None = argument("A dataset of [bold]mobilia generate --sessions[/bold].")
    slam: list[str] | None = option(
        "SLAMs: --slam A B C; default shunting occupancy.", complete=SLAMS
    )
    scene: str | None = option("Or a scene, whose sessions are simulated here.", complete=SCENES)
    sessions: int = option("How many of them, the first included.", 11)
    change: float = option("Share of things and doors put elsewhere between two sessions.", 0.3)
    dynamism: float = option("How much the room moves in a session.", 0.5)
    moves: options.Moves = part(options.Moves, without=("dynamism", "change"))
    seconds: float = option("Length of a simulated session, s.", 60.0)
    first_seconds: float | None = option(
        "Of the first one, which maps the building; default three times as long."
    )
    seed: int = option("Of the building.", 0)
    scanner: str = options.SCANNER()
    out: Path | None = option("Folder to write; default out/lifelong.", writes=True)
    overwrite: bool = options.OVERWRITE()
    plan_only: bool = options.PLAN()

    def __call__(self) -> None:
        options.exactly_one("FOLDER and --scene", self.folder, self.scene)
        usual = ["shunting", "occupancy"]
        names = list(dict.fromkeys(options.named(usual if self.slam is None else self.slam)))
        if not names:
            raise InvalidValueError("--slam must name at least one SLAM")
        check(names, self.scene)
        from scripts.days import sessions as days
        from scripts.jobs import try_names
        from scripts.pace import Work, announce, timed
        from scripts.whole_folder import replaceable

        try_names(names, [] if self.scene is None else [self.scene])

        if self.folder is not None:
            count = len(days.recorded(self.folder))
            work = Work(f"lifelong, recorded, {' '.join(names)}", count)
            ahead = f"{count} sessions"
            settings: dict[str, Any] = {"dataset": self.folder.name}
            drives = days.read(self.folder)
        else:
            recipe, first_s = self._recipe(), self._first_s()
            work = Work(f"lifelong {' '.join(names)}", first_s + self.seconds * (self.sessions - 1))
            ahead = f"{self.sessions} sessions of {self.scene}"
            drives = days.simulated(recipe, self.sessions, first_s)
            settings = {
                "scene": recipe.scene, "seed": recipe.seed, "dynamism": recipe.dynamism,
                "motion": recipe.motion, "change": recipe.change, "sessions": self.sessions,
                "seconds": recipe.seconds, "first_seconds": first_s,
                "scanner": recipe.scanner, "options": dict(recipe.options),
            }  # fmt: skip
        settings = {"slams": names, **settings}
        path = self.out or Path("out") / "lifelong"
        replaceable(path, self.overwrite, "lifelong", settings)
        announce(f"{ahead}, {len(names)} SLAMs", [work])
        if not self.plan_only:
            with timed(work):
                self._live(names, drives, settings, path)

    def _recipe(self) -> "Recipe":
        """Of the last session; ``InvalidValueError`` for what cannot be."""
        from scripts.days.sessions import checked_count
        from sim.recording.recipe import Recipe

        assert self.scene is not None
        return Recipe(
            scene=self.scene, seed=self.seed, dynamism=self.dynamism, motion=self.moves.motion,
            change=self.change, seconds=self.seconds, scanner=self.scanner,
            session=checked_count(self.sessions) - 1,
            options=options.options_with(self.moves.crowd),
        )  # fmt: skip

    def _first_s(self) -> float:
        """Length of the first session, s."""
        from scripts.days.buildings import FIRST
        from sim.recording.recipe import MAX_SECONDS

        first_s = FIRST * self.seconds if self.first_seconds is None else self.first_seconds
        if not 0.0 < first_s <= MAX_SECONDS:
            raise InvalidValueError(
                f"--first-seconds must be > 0 and at most {MAX_SECONDS:g}, got {first_s}"
            )
        return first_s

    def _live(
        self,
        names: list[str],
        drives: "Iterator[SessionDrive]",
        settings: dict[str, Any],
        path: Path,
    ) -> None:
        """Live it, write it, and say how it went."""
        from scripts.days import lifelong as life
        from scripts.days import tables
        from scripts.days.report import Changed, changes_of
        from scripts.output import write_recipe
        from scripts.pages.page import Page, Part, tell
        from scripts.pages.page import write as write_page
        from scripts.whole_folder import whole_folder

        with whole_folder(
            path, overwrite=self.overwrite, command="lifelong", settings=settings
        ) as folder:
            buildings = life.started(names, folder)
            (folder / "replays").mkdir()
            for building in buildings:
                building.replays = folder / "replays"
            kept: dict[int, SessionDrive] = {}
            with working("living through the sessions"):
                rows, aged = life.lived(buildings, _noted(drives, kept))
            living = next((b for b in buildings if not b.anew), None)
            changed = Changed() if living is None else changes_of(folder, living, kept)
            tables.write(folder, rows, settings, changed.score, aged)
            by_slam = {name: [row for row in rows if row["slam"] == name] for name in names}
            said = [_sentence(building, by_slam[building.name], aged) for building in buildings]
            lives = [
                Part(title=f"The life of {name}", table=tables.printed(name, own, whole=True))
                for name, own in by_slam.items()
            ]
            older = [Part(title="Older maps", table=tables.ages_table(aged))] if aged else []
            first = names[0] if living is None else living.name
            page = Page(
                title=f"A building over {len(kept)} sessions",
                said=[*said, tables.last_session(by_slam[first], changed.said)],
                parts=[*changed.parts, *lives, *older], settings=settings,
                next={} if living is None else {
                    "A session of your own in this map:": command_line(
                        "run", slam=first, log="LOG", map_in=path / living.map.name,
                        map_out="NEXT.npz", at=_a_day_after(kept[max(kept)]),
                    )
                },
            )  # fmt: skip
            write_recipe(folder, "lifelong", settings)
            write_page(folder, page)
        for name, own in by_slam.items():
            console.print(tables.printed(name, own))
        tell(path, page)


def _a_day_after(drive: "SessionDrive") -> str:
    """As ``--at`` takes it."""
    return f"{datetime.fromtimestamp(drive.time_s, UTC) + timedelta(days=1):%Y-%m-%dT%H:%M}"


def _sentence(building: "Building", rows: list[Row], aged: list[Row]) -> str:
    """What the sessions of a SLAM come to."""
    from scripts.days.scores import of_building
    from scripts.report.score_tables import sentences

    of = {"scene": "", "motion": 0.0, "change": 0.0, "seed": 0, "slam": building.name}
    old = [row for row in aged if row["slam"] == building.name]
    failure = building.failures[0] if building.failures else None
    return sentences([of_building(of, rows, old, failure)])[0]


def _noted(
    drives: "Iterator[SessionDrive]", kept: "dict[int, SessionDrive]"
) -> "Iterator[SessionDrive]":
    """The same, each also kept for the comparison of sessions."""
    for drive in drives:
        kept[drive.number] = drive
        yield drive

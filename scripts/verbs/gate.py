# SPDX-License-Identifier: Apache-2.0
"""``mobilia gate``: has a SLAM got worse?"""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from scripts import options
from scripts.console import console, note, say
from scripts.names import check
from scripts.options import named
from scripts.spec import REQUIRED, SLAMS, command_line, names_of, option, part, spec
from slam.errors import InvalidValueError, MissingPathError, MobiliaError
from slam.files import replacing
from slam.set_numbers import with_set

if TYPE_CHECKING:
    from scripts.gate.told import Paired

WORSE, TROUBLE = 1, 2  # exit status, as diff(1) has them
OF_SAVE = ("tracks", "level", "seeds", "seconds")


@spec
class Gate:
    """Say whether a SLAM has got worse, in as few runs as that takes.

    --save runs it and writes the results. --against runs it on the same recordings, until it is
    sure that it is worse, or that it is not worse by a fifth. Writes summary.md and junit.xml.

    Exit status: 0 not worse, or not decided after all runs. 1 worse. 2 anything else.

    [bold]mobilia gate --slam my_slam:MySlam --save results.json --jobs 2[/bold]

    [bold]mobilia gate --slam my_slam:MySlam --against results.json --jobs 2[/bold]
    """

    slam: str = option("SLAM, by name, module:Class or pipe:COMMAND.", REQUIRED, complete=SLAMS)
    against: Path | None = option("Is it worse than these results?", metavar="FILE")
    save: Path | None = option(
        "Write the results here.", metavar="FILE", writes="file", suffix=".json"
    )
    tracks: list[str] | None = option(
        "With --save: tracks, by name; default busy-chairs, rush-hour, classroom-break.",
        complete=names_of("scripts.benchmark.tracks:TRACKS"),
    )
    level: float | None = option("With --save: level of the tracks; default 0.5.")
    seeds: int | None = option("With --save: seeds of each track, 1 to 20; default 20.")
    seconds: float | None = option(
        "With --save: length of a run; default 20.", span=(2.0, 600.0), unit="s"
    )
    out: Path = option("Folder of recordings and of what came out.", Path("out/gate"), writes=True)
    work: options.Work = part(options.Work, without=("plan_only",))
    set_: list[str] | None = options.SET()

    def __call__(self) -> None:
        options.exactly_one("--against and --save", self.against, self.save)
        try:
            self._save() if self.save else self._hold()
        except MobiliaError as error:
            vars(error)["status"] = TROUBLE
            raise

    def _asked(self) -> tuple[str, dict[str, Any]]:
        """The SLAM with its numbers, and where it runs."""
        check([self.slam])
        from scripts.workers import check_jobs

        check_jobs(self.work.jobs)
        ways = {"jobs": self.work.jobs, "cluster": self.work.cluster}
        return with_set((self.slam,), self.set_ or [])[0], ways

    def _save(self) -> None:
        assert self.save is not None
        slam, ways = self._asked()
        from scripts.benchmark import runs_file
        from scripts.gate.make import save
        from scripts.gate.runs import SECONDS, of_tracks

        if self.out.resolve() in self.save.resolve().parents:
            raise InvalidValueError(f"--save must lie outside --out, {self.out}, got {self.save}")
        given = {name: getattr(self, name) for name in OF_SAVE}
        given["tracks"] = named(self.tracks or []) or None
        given = {name: value for name, value in given.items() if value is not None}
        runs = of_tracks(**given)
        with replacing(self.save) as temporary:  # before the runs: what cannot be written is told
            made = save(runs, slam, given.get("seconds", SECONDS), self.out, **ways)
            runs_file.write(temporary, made)
        rows = [row for track in made.runs.values() for _, slams in track.values()
                for row in slams.values()]  # fmt: skip
        lost = sum(row["lost"] for row in rows)
        if 2 * lost > len(rows):
            note("lost in most runs, where no error can be compared: a lower --level has more")
        say(f"{self.save}: {len(rows)} runs, {lost} lost")

    def _hold(self) -> None:
        assert self.against is not None
        for name in OF_SAVE:
            if getattr(self, name) is not None:
                raise InvalidValueError(f"--{name} is of --save: {self.against} has its runs")
        slam, ways = self._asked()
        if not self.against.exists():
            line = command_line("gate", slam=self.slam, save=self.against)
            raise MissingPathError(self.against, f"no such file; to make it: {line}")
        from scripts.benchmark import submission
        from scripts.gate.make import hold

        saved = submission.read(self.against)
        _tell(hold(self.against, saved, slam, self.out, **ways), self.out)


def _tell(paired: "Paired", out: Path) -> None:
    from scripts.pages.page import Page, Part, publish

    table, worst = paired.table().printed(), paired.worst()
    console.print(table)
    then = {} if worst is None else {f"What misled it, {worst}:": worst.blame(paired.slam)}
    publish(out, Page(
        title=f"Has {paired.slam} got worse?", said=paired.said(),
        parts=[Part(title="Track by track", table=table)], next=then,
    ))  # fmt: skip
    if paired.verdict == "worse":
        raise typer.Exit(WORSE)

# SPDX-License-Identifier: Apache-2.0
"""``mobilia tune``: numbers of a SLAM searched on training seeds, judged on fresh ones."""

from pathlib import Path
from typing import TYPE_CHECKING

from rich.markup import escape

from scripts import options
from scripts.console import console, say
from scripts.names import check, file_name
from scripts.spec import REQUIRED, SLAMS, argument, command_line, names_of, option, part, spec

if TYPE_CHECKING:
    from scripts.tuning.make import Tuned


@spec
class Tune:
    """Search numbers with which a SLAM gets lost less, and judge them on seeds that the search has
    not seen.

    Needs the extra tune. A run that is lost counts most, then the error. If it is killed, the same
    command continues; with more --minutes it searches on.

    [bold]mobilia tune karto --space space.toml --track tour-guide --level 0.5[/bold]
    """

    slam: str = argument(
        "SLAM by name, module:Class or pipe:COMMAND, which gets the numbers in its environment.",
        REQUIRED,
        complete=SLAMS,
    )
    space: Path = option(
        "TOML file, whose table numbers has PATH = {low = 1, high = 20}, also log = true or "
        "int = true; or choices = ... in place of low and high.",
        REQUIRED,
    )
    track: str = option(
        "A track of the benchmark.", REQUIRED, complete=names_of("scripts.benchmark.tracks:TRACKS")
    )
    level: float = option("Its level: 0, 0.25, 0.5, 0.75 or 1.", 0.5)
    minutes: float = option("How long all of it may take, min; the search ends accordingly.", 30.0)
    trials: int | None = option("Trials at most: the same on every machine that has the time.")
    seeds: int = option("So many of the track's 20 training seeds.", 20)
    seconds: float | None = option("Length of a run, s, to try out; default the track's own.")
    out: Path | None = option("Folder; default out/tune-...", writes=True)
    work: options.Work = part(options.Work, without=("cluster", "plan_only"))

    def __call__(self) -> None:
        check([self.slam])
        from scripts import workers
        from scripts.benchmark.tracks import chosen
        from scripts.tuning import space
        from scripts.tuning.make import carry_out
        from scripts.tuning.search import Task

        workers.check_jobs(self.work.jobs)
        track = chosen([self.track])[0]
        task = Task(
            slam=self.slam, space=space.read(self.space, self.slam), track=track,
            level=self.level, seeds=self.seeds, minutes=self.minutes, trials=self.trials,
            seconds=self.seconds,
        )  # fmt: skip
        name = f"tune-{file_name(self.slam)}-{track.family}"
        out = self.out or Path("out") / name
        _tell(carry_out(task, out, jobs=self.work.jobs), out)


def _tell(tuned: "Tuned", out: Path) -> None:
    from scripts.pages.page import Page, Part, publish
    from scripts.tuning.make import numbers_table
    from scripts.tuning.search import JUDGED

    best, task = tuned.best, tuned.task
    parts, then = [Part(title="The search", picture="trials.png")], dict[str, str]()
    if tuned.verdict is not None:
        table, note = numbers_table(tuned), f"As a name: `{best.name}`"
        console.print(table)
        say(escape(note), highlight=False)
        parts += [Part(title="Numbers to set", note=note, table=table)]
        then = {
            "The fresh runs, one by one:": command_line("report", folder=out / JUDGED),
            "All tracks with these numbers:": command_line("benchmark", slam=[best.name]),
        }
    publish(out, Page(
        title=f"{task.slam} tuned for {task.track.name} at level {task.level:g}", said=tuned.said,
        parts=parts, next=then, settings=task.settings(),
    ))  # fmt: skip

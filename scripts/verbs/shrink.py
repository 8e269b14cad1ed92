# SPDX-License-Identifier: Apache-2.0
"""``mobilia shrink``: the smallest part of a lost run in which its SLAM is lost again."""

import time
from pathlib import Path
from typing import TYPE_CHECKING

from scripts import options
from scripts.console import console
from scripts.names import check, file_name, run_name
from scripts.spec import REQUIRED, SLAMS, argument, command_line, option, spec
from slam.names import is_code

if TYPE_CHECKING:
    from scripts.debugger.shrunk import Shrunk


@spec
class Shrink:
    """Make of a lost run the shortest recipe in which the SLAM is lost again.

    Parts of the run are tried one after another: later beginnings and earlier ends, then with
    movers taken out, events left out, fewer scans and fewer beams. Writes the recipe, shrink.json,
    a film and the errors of what is left.

    [bold]mobilia shrink out/compare/runs/arena_d1_s100.npz --slam ekf[/bold]

    [bold]mobilia run shunting --recipe out/shrink-arena_d1_s100-ekf[/bold]
    """

    folder: Path = argument(
        "Folder of a simulated run, an episode, or DIR/runs/NAME.npz of a comparison.", REQUIRED,
        metavar="RUN",
    )  # fmt: skip
    slam: str | None = option("SLAM that is lost; default the run's first.", complete=SLAMS)
    every: int = option("The SLAM gets one scan in so many.", 1)
    out: Path | None = option("Folder; default out/shrink-...", writes=True)
    overwrite: bool = options.OVERWRITE()
    film: bool = options.FILM(True)
    trust: bool = options.TRUST()

    def __call__(self) -> None:
        check([self.slam])
        from scripts.debugger.recording import case_of
        from scripts.debugger.shrunk import carry_out

        case = case_of(self.folder, self.slam, self.every, self.trust)
        name = f"shrink-{file_name(run_name(self.folder))}-{file_name(case.slam)}"
        out, started = self.out or Path("out") / name, time.perf_counter()
        found = carry_out(case, out, overwrite=self.overwrite, filmed=self.film)
        _tell(found, out, time.perf_counter() - started)


def _tell(found: "Shrunk", out: Path, wall_s: float) -> None:
    from scripts.pages.page import Page, Part, publish

    shown = found.table()
    console.print(shown)
    trust = is_code(found.world["scene"])
    again = command_line("run", slam=found.slam, recipe=out, trust=trust, overwrite=True)
    publish(out, Page(
        title=f"The shortest way to lose {found.slam}", said=found.said(out, wall_s),
        parts=[
            Part(title="What is left", table=shown),
            Part(title="Error over time", picture="errors.png"),
        ],
        next={"Does it hold, once the SLAM is changed?": again}, settings=found.world,
    ))  # fmt: skip

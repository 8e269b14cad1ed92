# SPDX-License-Identifier: Apache-2.0
"""``mobilia reproduce``: each experiment of the paper by one command."""

import importlib
import os
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from rich.markup import escape

from scripts.console import note, say
from scripts.paper import EXPERIMENTS
from scripts.spec import REQUIRED, argument, names_of, option, spec
from slam.errors import UnknownNameError

if TYPE_CHECKING:
    from scripts.paper.runs import Plan


@spec
class Reproduce:
    """Reproduce the paper's experiments: figures, tables with its numbers beside ours, recipes.

    Finished runs are kept: if it is killed, the same command continues.

    [bold]mobilia reproduce landmarks[/bold]
    """

    what: list[str] = argument(
        f"Of {', '.join(EXPERIMENTS)}, or all.", REQUIRED, metavar="WHAT...",
        complete=names_of("scripts.paper:EXPERIMENTS"),
    )  # fmt: skip
    quick: bool = option("Short runs, of one seed: three minutes for all.", False)
    seeds: int | None = option("Runs of each simulated experiment.", show_default="20")
    out: Path = option(
        "Folder; each experiment gets one in it.", Path("out/reproduce"), writes=True
    )
    data: Path | None = option("Folder of the Victoria Park dataset.")
    jobs: int = option("Processes; 0: one for each core.", 0)

    def __call__(self) -> None:
        names = _named(self.what)
        from scripts.paper.runs import Plan

        plan = Plan(
            out=self.out, seeds=self.seeds, quick=self.quick, data=self.data,
            processes=self.jobs or os.cpu_count() or 1,
        )  # fmt: skip
        left_out = "all" in self.what and plan.data is None
        if left_out:
            names.remove("victoria-park")
        for name in names:
            experiment(name)(plan)
            page = escape(str(plan.out / name / "README.md"))
            say(f"[bold]{name}[/bold]: open {page}")
        if left_out:
            note("victoria-park is left out: pass --data with the folder of the dataset")


def experiment(name: str) -> "Callable[[Plan], None]":
    """The function that runs it."""
    module = importlib.import_module(f"scripts.paper.{name.replace('-', '_')}")
    function: Callable[[Plan], None] = module.reproduce
    return function


def _named(what: list[str]) -> list[str]:
    for name in what:
        if name != "all" and name not in EXPERIMENTS:
            raise UnknownNameError(
                f"no experiment is called '{name}'. Known: {', '.join(EXPERIMENTS)}, all."
            )
    return list(EXPERIMENTS) if "all" in what else list(dict.fromkeys(what))

# SPDX-License-Identifier: Apache-2.0
"""``mobilia reproduce``: each experiment of the paper by one command."""

import importlib
import os
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.markup import escape

from scripts.console import note, say
from scripts.paper import EXPERIMENTS
from slam.errors import UnknownNameError

if TYPE_CHECKING:
    from scripts.paper.runs import Plan


def reproduce(
    what: Annotated[
        list[str], typer.Argument(help=f"Of {', '.join(EXPERIMENTS)}, or all.", metavar="WHAT...")
    ],
    quick: Annotated[
        bool, typer.Option("--quick", help="Short runs, of one seed: three minutes for all.")
    ] = False,
    seeds: Annotated[
        int | None, typer.Option(help="Runs of each simulated experiment.", show_default="20")
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder; each experiment gets one in it.")] = Path(
        "out/reproduce"
    ),
    data: Annotated[Path | None, typer.Option(help="Folder of the Victoria Park dataset.")] = None,
    jobs: Annotated[int, typer.Option(help="Processes; 0: one for each core.")] = 0,
) -> None:
    """Reproduce the paper's experiments: figures, tables with its numbers beside ours, recipes.

    Finished runs are kept: if it is killed, the same command continues.

    [bold]mobilia reproduce landmarks[/bold]
    """
    names = _named(what)
    from scripts.paper.runs import Plan

    plan = Plan(out=out, seeds=seeds, quick=quick, data=data, processes=jobs or os.cpu_count() or 1)
    left_out = "all" in what and plan.data is None
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

# SPDX-License-Identifier: Apache-2.0
"""The console command ``mobilia``: parse, call, print. Each verb lives in a module of its own."""

from __future__ import annotations

import logging
import os
import sys
from typing import Annotated

import typer

from scripts import interrupt
from scripts.console import LogLines, console, fail, note
from scripts.many import ManyValues
from scripts.option_names import Verb
from scripts.verbs.bench import bench
from scripts.verbs.benchmark import benchmark
from scripts.verbs.blame import blame
from scripts.verbs.compare import compare
from scripts.verbs.config import config
from scripts.verbs.demo import demo
from scripts.verbs.doctor import doctor
from scripts.verbs.drive import drive
from scripts.verbs.export import export
from scripts.verbs.generate import generate
from scripts.verbs.lifelong import lifelong
from scripts.verbs.listing import listing
from scripts.verbs.live import live
from scripts.verbs.render import render
from scripts.verbs.report import report
from scripts.verbs.reproduce import reproduce
from scripts.verbs.run import run
from scripts.verbs.sensor_card import sensor_card
from scripts.verbs.verify import verify
from slam.errors import MissingPathError, MobiliaError
from slam.names import load, look_in

_log = logging.getLogger(__name__)

app = typer.Typer(
    name="mobilia",
    help=(
        "A testbed of rooms in which things move, and a SLAM for them.\n\n"
        "Start with [bold]mobilia demo[/bold]; every verb explains itself with --help."
    ),
    no_args_is_help=True,
    rich_markup_mode="rich",
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
app.command("demo", cls=Verb)(demo)
app.command("run", cls=Verb)(run)
app.command("render", cls=Verb)(render)
app.command("generate", cls=Verb)(generate)
app.command("verify", cls=Verb)(verify)
app.command("export", cls=Verb)(export)
app.command("list", cls=Verb)(listing)
app.command("config", cls=Verb)(config)
app.command("bench", cls=Verb)(bench)
app.command("doctor", cls=Verb)(doctor)
app.command("sensor-card", cls=Verb)(sensor_card)
app.command("reproduce", cls=Verb)(reproduce)
app.command("compare", cls=ManyValues)(compare)
app.command("benchmark", cls=ManyValues)(benchmark)
app.command("drive", cls=ManyValues)(drive)
app.command("blame", cls=ManyValues)(blame)
app.command("live", cls=ManyValues)(live)
app.command("report", cls=Verb)(report)
app.command("lifelong", cls=Verb)(lifelong)


@app.callback()
def options(
    verbose: bool = typer.Option(False, "--verbose", "-v", help="Also print what is going on."),
    modules: Annotated[
        list[str] | None,
        typer.Option(
            "--with",
            help="Import this Python module of yours first, so that the scene, scanner, SLAM, "
            "topic or film pane that it registers is known.",
        ),
    ] = None,
) -> None:
    """Options of every verb."""
    logging.basicConfig(
        level=logging.INFO if verbose else logging.WARNING,
        format="%(message)s",
        handlers=[LogLines(console=console, show_path=False, show_time=False)],
    )
    load(modules or ())


def main(warning: str | None = None) -> None:
    """Every failure we foresee is one clear line and a non-zero exit status.

    warning  of the environment, to be said first
    """
    look_in(os.getcwd())
    if warning:
        note(warning)
    try:
        app()
    except MobiliaError as error:
        fail(str(error))
        _log.info("where it came from:", exc_info=error)  # with --verbose
        sys.exit(2 if isinstance(error, MissingPathError) else 1)
    except interrupt.InterruptedBySignal:
        fail("interrupted: nothing half-written is left behind")
        sys.exit(130)
    except BrokenPipeError:
        sys.exit(1)
    except OSError as error:  # a folder that cannot be written, a full disk
        fail(f"{error.strerror or error}: {error.filename}" if error.filename else str(error))
        _log.info("where it came from:", exc_info=error)
        sys.exit(1)

# SPDX-License-Identifier: Apache-2.0
"""The console command ``mobilia``: parse, call, print. Each verb lives in a module of its own."""

import logging
import os
import sys
from importlib import metadata

import typer

from scripts import interrupt
from scripts.console import COMPILER, LogLines, console, fail, note
from scripts.option_names import Verb, Verbs
from scripts.spec import command, option, spec, spec_of
from scripts.verbs.scene import scene
from slam.errors import InvalidValueError, MissingPathError, MobiliaError, UnknownNameError
from slam.names import load, look_in

_log = logging.getLogger(__name__)
TYPED = (InvalidValueError, UnknownNameError, MissingPathError)  # mistakes in the command line: 2

app = typer.Typer(
    name="mobilia",
    cls=Verbs,
    help=(
        "A testbed of rooms in which things move, and a SLAM for them.\n\n"
        "Start with [bold]mobilia demo[/bold]; every verb explains itself with --help."
    ),
    no_args_is_help=True,
    rich_markup_mode="rich",
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
VERBS = (
    "demo", "run", "render", "generate", "verify", "export", "list", "config", "bench", "doctor",
    "sensor-card", "reproduce", "compare", "benchmark", "drive", "blame", "shrink", "live",
    "report", "lifelong", "twin", "score", "gate", "tune",
)  # fmt: skip
for _name in VERBS:
    app.command(_name, cls=Verb)(command(spec_of(_name)))

app.add_typer(scene, name="scene")


def _version(asked: bool) -> None:
    if asked:
        console.print(f"mobilia {metadata.version('mobilia')}", highlight=False)
        raise typer.Exit


@spec
class Everywhere:
    """Options of every verb."""

    verbose: bool = option("Also print what is going on.", False, "--verbose", "-v")
    version: bool = option(
        "Print the version and end.", False, "--version", callback=_version, is_eager=True
    )
    modules: list[str] | None = option(
        "Import this Python module of yours first, so that the scene, scanner, SLAM, topic or film "
        "pane that it registers is known.",
        None,
        "--with",
    )

    def __call__(self) -> None:
        logging.basicConfig(
            level=logging.INFO if self.verbose else logging.WARNING,
            format="%(message)s",
            handlers=[LogLines(console=console, show_path=False, show_time=False)],
        )
        logging.getLogger(COMPILER).setLevel(logging.INFO)  # what nothing else is said of for long
        load(self.modules or ())


app.callback()(command(Everywhere))


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
        sys.exit(getattr(error, "status", 2 if isinstance(error, TYPED) else 1))
    except interrupt.InterruptedBySignal:
        fail("interrupted: nothing half-written is left behind")
        sys.exit(130)
    except BrokenPipeError:
        sys.exit(1)
    except OSError as error:  # a folder that cannot be written, a full disk
        fail(f"{error.strerror or error}: {error.filename}" if error.filename else str(error))
        _log.info("where it came from:", exc_info=error)
        sys.exit(1)

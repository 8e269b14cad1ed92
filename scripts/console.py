# SPDX-License-Identifier: Apache-2.0
"""Where the verbs print: a rich console for results, one for errors, one progress bar."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence

from rich.console import Console
from rich.logging import RichHandler
from rich.markup import escape
from rich.progress import (
    BarColumn,
    Progress,
    SpinnerColumn,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.table import Table

console = Console()
_errors = Console(stderr=True)


def fail(message: str) -> None:
    """One line on stderr."""
    _errors.print(
        f"[bold red]mobilia:[/bold red] {escape(message)}", highlight=False, soft_wrap=True
    )


def note(message: str) -> None:
    """One line that the user should see but that is no error."""
    console.print(f"[yellow]note:[/yellow] {escape(message)}", highlight=False, soft_wrap=True)


class Lines(RichHandler):
    """Log records as in rich, but a warning as one line, however narrow the terminal is."""

    def emit(self, record: logging.LogRecord) -> None:
        """Print it."""
        if record.levelno < logging.WARNING or record.exc_info:
            super().emit(record)
            return
        words = escape(record.getMessage())
        self.console.print(f"[yellow]warning:[/yellow] {words}", highlight=False, soft_wrap=True)


def fact(sentence: str, *, bad: bool = False) -> None:
    """A sentence that is a result."""
    style = "bold red" if bad else "bold"
    console.print(escape(sentence), style=style, highlight=False, soft_wrap=True)


def progress() -> Progress:
    """A progress bar with time left; silent when the output is no terminal."""
    return Progress(
        SpinnerColumn(),
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.fields[unit]}"),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
        console=console,
        transient=False,
    )


def level_table(
    title: str,
    caption: str,
    levels: Sequence[float],
    slams: Sequence[str],
    cell: Callable[[float, str], str],
    axis: str = "dynamism",
) -> Table:
    """A row for each level of an axis, a column for each SLAM; ``cell`` gives the words."""
    table = Table(title=escape(title), title_justify="left", caption=escape(caption))
    table.add_column(axis, justify="right")
    for slam in slams:
        table.add_column(escape(slam), justify="right", overflow="fold")
    for level in levels:
        table.add_row(f"{level:g}", *(cell(level, slam) for slam in slams))
    return table

# SPDX-License-Identifier: Apache-2.0
"""Where the verbs print: a rich console for results, one for errors, one progress bar."""

import logging
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from functools import wraps
from typing import ParamSpec

from rich import box
from rich.console import Console
from rich.logging import RichHandler
from rich.markup import escape
from rich.progress import (
    BarColumn,
    Progress,
    ProgressColumn,
    SpinnerColumn,
    Task,
    TextColumn,
    TimeElapsedColumn,
)
from rich.table import Table
from rich.text import Text

from slam.errors import MobiliaError, printable

COMPILER = "slam._jit"  # name of its log
LINE_EVERY_S = 10.0  # between lines of progress where the output is no terminal
console = Console(emoji=False)  # "seat:chair:0" is a mark, and no picture of a chair
_errors = Console(stderr=True, emoji=False)
P = ParamSpec("P")


def plain(words: str) -> str:
    """Somebody's words, a file's name among them, as they are: no markup, nothing to be obeyed."""
    return escape(printable(words))


def fail(message: str) -> None:
    """One line on stderr."""
    _errors.print(
        f"[bold red]mobilia:[/bold red] {plain(message)}", highlight=False, soft_wrap=True
    )


def ended(main: Callable[P, int | None]) -> Callable[P, int]:
    """``main`` as a command: its exit status; an error of ours ends it with 1, told in one line."""

    @wraps(main)
    def command(*words: P.args, **named: P.kwargs) -> int:
        try:
            return main(*words, **named) or 0
        except (MobiliaError, OSError) as error:
            print(error, file=sys.stderr)
            return 1

    return command


def note(message: str) -> None:
    """One line that the user should see but that is no error."""
    console.print(f"[yellow]note:[/yellow] {plain(message)}", highlight=False, soft_wrap=True)


def say(words: str, *, highlight: bool = True) -> None:
    """A sentence with its markup, as one line however narrow the terminal is."""
    console.print(words, highlight=highlight, soft_wrap=True)


class LogLines(RichHandler):
    """Log records as in rich, but a warning, and that something is compiled, as one line, however
    narrow the terminal is."""

    def emit(self, record: logging.LogRecord) -> None:
        """Print it."""
        warning, compiling = record.levelno >= logging.WARNING, record.name == COMPILER
        if record.exc_info or not (warning or compiling):
            super().emit(record)
            return
        kind, words = "warning" if warning else "note", plain(record.getMessage())
        self.console.print(f"[yellow]{kind}:[/yellow] {words}", highlight=False, soft_wrap=True)


def fact(sentence: str, *, bad: bool = False) -> None:
    """A sentence that is a result."""
    style = "bold red" if bad else "bold"
    console.print(plain(sentence), style=style, highlight=False, soft_wrap=True)


def progress(*, quiet: bool = False) -> Progress:
    """A progress bar with time left; a line every ``LINE_EVERY_S`` where nobody can see a bar.

    quiet  nothing is shown: it is a step of what has a bar already
    """
    kind = Progress if console.is_interactive else Lines
    return kind(
        SpinnerColumn(),
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.fields[unit]}"),
        TimeElapsedColumn(),
        _Left(),
        console=console,
        transient=False,
        disable=quiet,
    )


class Lines(Progress):
    """Progress for files and pipes: what each task has done so far, as plain lines."""

    def start(self) -> None:
        """Begin to tell, from a thread of its own: a long step does not call anything."""
        self._ticks = ExitStack()
        if not self.disable:
            self._ticks.enter_context(_ticking(self._tell))

    def stop(self) -> None:
        """Tell once more, how it ended."""
        self._ticks.close()
        if not self.disable:
            self._tell()

    def _tell(self) -> None:
        for task in self.tasks:
            if task.visible:
                say(escape(_words(task)), highlight=False)


def _words(task: Task) -> str:
    """``office: 400/2250 scans, 12 s so far, about 54 s left``."""
    name, done = Text.from_markup(task.description).plain, str(task.fields.get("unit", ""))
    if task.total is not None and task.completed >= task.total:
        return f"{name}: {done or 'done'}, {task.elapsed or 0.0:.0f} s"
    left = _left_s(task)
    parts = [done, f"{task.elapsed or 0.0:.0f} s so far"]
    parts += [f"about {in_time(left)} left"] if left else []
    return f"{name}: {', '.join(filter(None, parts))}"


def in_time(seconds: float) -> str:
    """``40 s``, ``7 min``, ``2.5 h``: as exactly as an estimate is known."""
    if seconds < 100.0:
        return f"{seconds:.0f} s" if seconds < 20.0 else f"{5.0 * round(seconds / 5.0):.0f} s"
    return f"{seconds / 60.0:.0f} min" if seconds < 5400.0 else f"{seconds / 3600.0:.1f} h"


def _left_s(task: Task) -> float | None:
    """By the pace of all so far, which no single step turns; what was there before is not of it."""
    done = task.completed - float(task.fields.get("before", 0.0))
    if task.total is None or not done > 0.0 or task.elapsed is None:
        return None
    return task.elapsed * (task.total - task.completed) / done


class _Left(ProgressColumn):
    """About how long it still takes."""

    def render(self, task: Task) -> Text:
        left = _left_s(task)
        words = "" if left is None or task.finished else f"about {in_time(left)} left"
        return Text(words, style="progress.remaining")


@contextmanager
def working(words: str) -> Iterator[None]:
    """For a step that counts nothing: a spinner, or a line every ``LINE_EVERY_S``."""
    if console.is_interactive:
        with console.status(escape(words)):
            yield
        return
    started = time.monotonic()

    def tell() -> None:
        say(escape(f"{words}: {time.monotonic() - started:.0f} s so far"), highlight=False)

    with _ticking(tell):
        yield


@contextmanager
def _ticking(tell: Callable[[], None]) -> Iterator[None]:
    """Call ``tell`` every ``LINE_EVERY_S``, first after that time; no call begins after the end."""
    over = threading.Event()

    def run() -> None:
        with suppress(OSError):  # nobody reads any more
            while not over.wait(LINE_EVERY_S):
                tell()

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()


def plain_table(title: str, caption: str | None = None) -> Table:
    """A table without rules between rows, close enough for nine columns in 80 characters."""
    return Table(
        title=escape(title), title_justify="left", caption=caption, caption_justify="left",
        box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0), pad_edge=False,
    )  # fmt: skip


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

# SPDX-License-Identifier: Apache-2.0
"""What is printed where nobody sees a progress bar."""

import io
import logging
import time

import pytest
from rich.console import Console
from rich.progress import Progress

from scripts import console


@pytest.fixture
def printed(monkeypatch: pytest.MonkeyPatch) -> io.StringIO:
    """What a file gets, a line of progress every 50 ms."""
    file = io.StringIO()
    monkeypatch.setattr(console, "console", Console(file=file, width=40))
    monkeypatch.setattr(console, "LINE_EVERY_S", 0.05)
    return file


def wait_for(file: io.StringIO, words: str) -> None:
    deadline = time.monotonic() + 10.0
    while words not in file.getvalue():
        assert time.monotonic() < deadline, file.getvalue()
        time.sleep(0.01)


def test_a_file_gets_lines_while_a_long_step_calls_nothing(printed: io.StringIO):
    with console.progress() as bar:
        task = bar.add_task("office \\[x] of a long name and many words", total=100, unit="")
        wait_for(printed, "office [x] of a long name and many words: 0 s so far")
        bar.update(task, completed=50, unit="50/100 scans")
        wait_for(printed, "50/100 scans, 0 s so far")
        bar.update(task, completed=100, unit="100/100 scans")
    lines = printed.getvalue().splitlines()
    assert lines[-1] == "office [x] of a long name and many words: 100/100 scans, 0 s"
    time.sleep(0.15)
    assert printed.getvalue().splitlines() == lines  # it is over


def test_a_quick_step_is_one_line_and_an_unseen_one_none(printed: io.StringIO):
    with console.progress() as bar:
        bar.add_task("hidden", total=0, unit="", visible=False)
        bar.update(bar.add_task("seen", total=1, unit=""), completed=1)
    assert printed.getvalue() == "seen: done, 0 s\n"


def test_the_time_left_of_few_long_steps_is_that_of_all_so_far():
    bar = Progress(get_time=lambda: now)
    now = 0.0
    task = bar.add_task("simulating", total=6)
    now = 99.0
    bar.advance(task, 2)  # two that ended together
    now = 150.0
    assert console._words(bar.tasks[0]) == "simulating: 150 s so far, about 5 min left"


@pytest.mark.parametrize("say", [console.note, console.fact])
def test_a_file_s_name_is_no_order_to_the_terminal(printed: io.StringIO, say):
    say("a\x1b[2J\u202e[bold]b")
    assert "a\\x1b[2J\\u202e[bold]b\n" in printed.getvalue()


def test_that_something_is_compiled_is_a_note_of_one_line(printed: io.StringIO):
    record = logging.LogRecord(
        console.COMPILER, logging.INFO, "", 0, "compiling %s: %d s", ("a", 10), None
    )
    console.LogLines(console=console.console).handle(record)
    assert printed.getvalue() == "note: compiling a: 10 s\n"

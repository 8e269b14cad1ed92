# SPDX-License-Identifier: Apache-2.0
"""Inputs as people have them: what is done with each kind, and what is said.

The table of ``docs/logs.md`` is made of these: ``python -m tests.scripts.kinds.kind`` fills it.
Every module ``of_*.py`` here has a list ``KINDS``; ``test_kinds.py`` tries each of them.
"""

import importlib
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from scripts.marks import fill_page, table
from scripts.single_run.log_words import understood
from slam.logs import open_log

HERE = Path(__file__).parent
PAGE, MARK = HERE.parents[2] / "docs" / "logs.md", "kinds"
HEADS = ("in the file", "what is done", "what is said", "`--strict`")


@dataclass(frozen=True, kw_only=True)
class Kind:
    """A kind of input. The first three and the last are cells of the page's table.

    done    what is done with it
    said    in a warning, in the line of what was understood, or in the error; "…" stands for what
            varies, "" says that no warning is given
    write   puts one into a folder, and returns what is to be opened
    check   takes what was read, and asserts that it is right; None: the input is refused
    read    takes the path, and whether to be strict; gives what is said of it and what it is
    strict  whether ``--strict`` refuses what is read otherwise
    """

    name: str
    done: str
    said: str
    write: Callable[[Path], Path]
    check: Callable[[Any], None] | None
    read: Callable[[Path, bool], Any]
    strict: bool = False


def read_log(path: Path, strict: bool) -> tuple[str, list[Any]]:
    """What was understood of a log, and its frames."""
    stream = open_log(path, strict=strict)
    frames = list(stream)
    drive = frames[-1].stamp - frames[0].stamp if frames else 0.0
    seen = SimpleNamespace(stream=stream, title=path.name, scans=len(frames), duration_s=drive)
    return understood(seen), frames


def is_said(said: str, heard: str) -> bool:
    """Whether these words, with something for each "…", are among those."""
    return re.search(".*".join(map(re.escape, said.split("…"))), heard) is not None


def gathered() -> list[Kind]:
    """Of all modules, in the order of their names."""
    names = sorted(path.stem for path in HERE.glob("of_*.py"))
    modules = [importlib.import_module(f"tests.scripts.kinds.{name}") for name in names]
    return [kind for module in modules for kind in module.KINDS]


def told(kinds: Sequence[Kind]) -> str:
    """The table of the page."""
    rows = [
        (one.name, one.done, f"`{one.said}`" if one.said else "", "refused" * one.strict)
        for one in kinds
    ]
    return table(HEADS, rows, left=len(HEADS))


if __name__ == "__main__":
    text = told(gathered())
    fill_page(PAGE, MARK, text, most=len(text))  # all of it on the page

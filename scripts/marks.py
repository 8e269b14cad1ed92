# SPDX-License-Identifier: Apache-2.0
"""Marked places of a Markdown page, which a script fills: ``<!-- name -->`` … ``<!-- /name -->``.

A rendered page does not show the marks. Each stands on a line of its own.

A page has no long tables: their rows go to CSV files in ``docs/results``, which the page links.
"""

import csv
import io
import os
import re
from collections.abc import Iterable, Sequence
from pathlib import Path

from slam.errors import InvalidValueError, MissingPathError
from slam.files import write_text

MOST_CELLS = 40  # of a table on a page
_TABLE = re.compile(r"(?:^\|.*\|\n?){3,}", re.MULTILINE)
SUM = "all"  # how those rows of a long table begin that stay on the page


def table(heads: Sequence[str], rows: Iterable[Sequence[str]], *, left: int = 1) -> str:
    """A table in Markdown: the first ``left`` columns are words, the others numbers."""
    rule = [*["---"] * left, *["---:"] * (len(heads) - left)]
    each = ([cell.replace("|", "/") for cell in row] for row in (heads, rule, *rows))
    return "\n".join("| " + " | ".join(row) + " |" for row in each)


def filled(text: str, name: str, told: str, page: object) -> str:
    """``text`` with ``told`` at the place ``name``, empty lines round it.

    Raises ``InvalidValueError`` that names ``page`` where the marks are not there once, or are in
    the wrong order.
    """
    start, end = _marks(text, name, page)
    return f"{text[: start + len(f'<!-- {name} -->')]}\n\n{told}\n\n{text[end:]}"


def check_page(page: Path, name: str) -> None:
    """``fill_page`` will find its place: ``MissingPathError``, ``InvalidValueError`` otherwise."""
    if not page.is_file():
        raise MissingPathError(page, f"no such file: it must have the place <!-- {name} -->")
    _marks(page.read_text(encoding="utf-8"), name, page)


def fill_page(page: Path, name: str, told: str, most: int = MOST_CELLS) -> None:
    """Write ``told`` at the place ``name`` of a page that is there, the rest as it is.

    Tables of more than ``most`` cells become CSV files in the folder ``results`` beside the page.
    """
    text = filled(page.read_text(encoding="utf-8"), name, told, page)  # refuses wrong marks first
    stem = name if name == page.stem else f"{page.stem}_{name}"
    short = with_tables_apart(told, stem, page.parent / "results", page.parent, most)
    write_text(page, text if short == told else filled(text, name, short, page))


def with_tables_apart(
    told: str, stem: str, results: Path, folder: Path, most: int = MOST_CELLS
) -> str:
    """``told`` with a link in place of every table of more than ``most`` cells.

    Each is written to ``results``, as ``stem.csv``, ``stem_2.csv`` and so on. Of its rows those
    that sum up (``SUM``) stay. folder: where the page is that links it.
    """
    count = 0

    def apart(found: re.Match[str]) -> str:
        nonlocal count
        lines = found[0].strip().splitlines()
        head, *rows = ([cell.strip() for cell in line[1:-1].split("|")] for line in lines)
        if len(head) * len(rows[1:]) <= most:
            return found[0]
        count += 1
        path = results / (f"{stem}.csv" if count == 1 else f"{stem}_{count}.csv")
        text = io.StringIO()
        csv.writer(text, lineterminator="\n").writerows([head, *rows[1:]])
        write_text(path, text.getvalue())
        link = Path(os.path.relpath(path, folder)).as_posix()
        sums = [row[0].startswith(SUM) for row in rows[1:]]
        kept = [line for line, is_sum in zip(lines[2:], sums, strict=True) if is_sum]
        said = f"All {len(rows) - 1} rows: [{path.name}]({link}).\n"
        return "\n".join([*lines[:2], *kept, "", said]) if kept else said

    return _TABLE.sub(apart, told)


def _marks(text: str, name: str, page: object) -> tuple[int, int]:
    """Where the first mark begins and where the second does."""
    begin, end = f"<!-- {name} -->", f"<!-- /{name} -->"
    if text.count(begin) != 1 or text.count(end) != 1:
        raise InvalidValueError(f"{page} must have one {begin} and one {end}")
    start, stop = text.index(begin), text.index(end)
    if stop < start:
        raise InvalidValueError(f"{page} must have {begin} before {end}")
    return start, stop

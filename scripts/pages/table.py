# SPDX-License-Identifier: Apache-2.0
"""One table: for a page, for the console, and in Markdown."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

from rich.markup import escape
from rich.table import Table as Printed
from rich.text import Text

from scripts import marks
from scripts.console import plain_table

NONE = "–"  # where there is no number
_STYLES = {"better": "green", "worse": "red"}  # by the mark of a cell


@dataclass(frozen=True, kw_only=True)
class Cell:
    """``text`` with ``small`` print after it; ``mark`` is "better", "worse", "best" or ""."""

    text: str
    small: str = ""
    mark: str = ""

    def __str__(self) -> str:
        return f"{self.text} [{self.small}]" if self.small else self.text


@dataclass(frozen=True, kw_only=True)
class Table:
    """``slams`` are the heads that name one, for its colour; the first column names the row.

    words  so many columns at the left are words, the others numbers
    """

    caption: str
    head: Sequence[str]
    rows: Sequence[Sequence[Cell]]
    slams: Sequence[str] = field(default_factory=tuple)
    words: int = 1

    def markdown(self) -> str:
        """Its lines, small print in brackets."""
        return marks.table(self.head, [[*map(str, row)] for row in self.rows], left=self.words)

    def printed(self, *, ruled: bool = False) -> Printed:
        """For the console, small print in brackets; ``ruled``: with rules between the columns."""
        found = plain_table(self.caption)
        if ruled:
            found = Printed(title=escape(self.caption), title_justify="left")
        for k, heading in enumerate(self.head):
            side: Literal["left", "right"] = "left" if k < self.words else "right"
            found.add_column(
                escape(heading), justify=side, overflow="ellipsis" if ruled else "fold"
            )
        for row in self.rows:
            found.add_row(*(Text(str(cell), _STYLES.get(cell.mark, "")) for cell in row))
        return found


def grid(
    caption: str,
    corner: str,
    rows: Sequence[Any],
    columns: Sequence[Any],
    cell: Callable[[Any, Any], Cell],
    *,
    slams: Sequence[str] = (),
) -> Table:
    """A row for each of ``rows``, a column for each of ``columns``; ``corner`` heads the rows."""
    lines = [[Cell(text=_label(row)), *(cell(row, column) for column in columns)] for row in rows]
    head = [corner, *map(_label, columns)]
    return Table(caption=caption, head=head, rows=lines, slams=slams)


def _label(of: Any) -> str:
    """What a row or a column is called: a word, a number, or what has a ``heading``."""
    if isinstance(of, str):
        return of
    return f"{of:g}" if isinstance(of, float) else str(of.heading)


def of_printed(table: Printed) -> Table:
    """A table of the console for a page."""
    columns = [[_plain(cell) for cell in one.cells] for one in table.columns]
    rows = [[Cell(text=text) for text in row] for row in zip(*columns, strict=True)]
    head = [_plain(one.header) for one in table.columns]
    return Table(caption=_plain(table.title or ""), head=head, rows=rows)


def _plain(of: object) -> str:
    return of.plain if isinstance(of, Text) else Text.from_markup(str(of)).plain

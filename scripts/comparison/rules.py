# SPDX-License-Identifier: Apache-2.0
"""What a cell of a table or a setting of a recipe may be: a word, a number, a list of such.

A rule says it in words (``wanted``), judges a value (``holds``) and, of one that a cell can hold,
takes it from the cell (``parsed``).
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Protocol

from slam.checked import is_number, is_whole
from slam.csv_cells import word_of

MOST = 1e100  # of a finite number, either way: its squares and their sums are finite too
MAX_WORD = 2000  # letters of a name: what is longer is the name of no file
MAX_MESSAGE = 100_000  # letters of what a SLAM said when it failed; the csv module reads 131072
MAX_DEPTH = 16  # of lists and mappings within each other
_NUMBER = re.compile(r"[-+]?(\d{1,400}(\.\d{0,400})?(e[-+]?\d{1,4})?|inf)", re.ASCII)


class Rule(Protocol):
    """What a value must be."""

    @property
    def wanted(self) -> str:
        """It in words, for "must be ..."."""

    def holds(self, value: object) -> bool:
        """Whether this is one."""


class Cell(Rule, Protocol):
    """What the value of a cell must be; an empty cell is None."""

    def parsed(self, cell: str) -> Any:
        """The value of a cell that is not empty; NaN where it holds none, which no rule allows."""


@dataclass(frozen=True, kw_only=True)
class Word:
    """One line of letters that print; ``among`` these if any, None too where ``optional``."""

    among: tuple[str, ...] = ()
    most: int = MAX_WORD
    optional: bool = False

    @property
    def wanted(self) -> str:
        """In words."""
        what = f"a printable word of 1 to {self.most} letters"
        if self.among:
            what = self.among[0] if len(self.among) == 1 else f"one of {', '.join(self.among)}"
        return what + _or_none(self.optional)

    def holds(self, value: object) -> bool:
        """Whether this is one."""
        if value is None:
            return self.optional
        if not isinstance(value, str):
            return False
        if self.among:
            return value in self.among
        return 0 < len(value) <= self.most and value.isprintable()

    def parsed(self, cell: str) -> Any:
        """The word of a cell."""
        return word_of(cell)


@dataclass(frozen=True, kw_only=True)
class Number:
    """A number from ``least`` to ``most``. An infinite end allows ``MOST`` and itself.

    whole     whole numbers alone
    optional  None too
    """

    least: float = 0.0
    most: float = math.inf
    whole: bool = False
    optional: bool = False

    @property
    def wanted(self) -> str:
        """In words."""
        kind = "a whole number" if self.whole else "a number"
        low = -MOST if self.least == -math.inf else self.least
        high = f"{self.most:g}"
        if self.most == math.inf:
            high = f"{MOST:g} or infinite"
        elif int(self.most) == self.most:
            high = str(int(self.most))
        return f"{kind} from {low:g} to {high}" + _or_none(self.optional)

    def holds(self, value: object) -> bool:
        """Whether this is one."""
        if value is None:
            return self.optional
        if not (is_whole(value) or (is_number(value) and not self.whole)):
            return False
        within = self.least <= value <= self.most
        return within and (abs(value) <= MOST or value in (math.inf, -math.inf))

    def parsed(self, cell: str) -> Any:
        """The number of a cell; a whole one may be written as 3.0."""
        if not _NUMBER.fullmatch(cell):
            return math.nan
        value = float(cell)
        if self.whole and value.is_integer():
            return int(cell) if cell.isdecimal() else int(value)
        return value


SHARE = Number(most=1.0)
Columns = Mapping[str, Cell]
LEVEL = "level"  # the axis of ``scripts.comparison.plan.Plan.sets``


def level_of(axis: str) -> Number:
    """What a level of that axis may be."""
    return Number(least=-1e6, most=1e6) if axis == LEVEL else Number(most=1.0)


@dataclass(frozen=True, kw_only=True)
class Table:
    """What a table on file must be.

    columns   in the order in which they are written; "dynamism" is the level, of whatever axis
    key       those that name a row, of which no two have the same
    parts     (part, whole): of counts, the first is at most the second
    together  in a row they are all empty or none of them is
    """

    columns: Columns
    key: tuple[str, ...]
    parts: tuple[tuple[str, str], ...] = ()
    together: tuple[str, ...] = ()

    def at(self, axis: str) -> Columns:
        """The rules of its columns where levels are of that axis."""
        level = {"dynamism": level_of(axis)} if "dynamism" in self.columns else {}
        return {**self.columns, **level}

    def impossible(self, row: Mapping[str, Any]) -> str:
        """Why the cells of a row, each right by its rule, cannot stand together; "" if they can."""
        told = [name for name in self.together if row.get(name) is not None]
        if told and len(told) < len(self.together):
            return f"{', '.join(self.together)} must all be there or none, got {', '.join(told)}"
        for part, whole in self.parts:
            most, count = row.get(whole), row.get(part)
            if count is not None and most is not None and count > most:
                return f"{part} must be at most {whole}, {most}, got {count}"
        for name in ("value", "low", "high") if row.get("statistic") == "share" else ():
            if not SHARE.holds(row[name]):
                return f"{name} must be {SHARE.wanted}, as it is of a share, got {row[name]}"
        return ""


@dataclass(frozen=True, kw_only=True)
class Many:
    """A list of values, each of them by the same rule and there once; 1 at least."""

    of: Rule

    @property
    def wanted(self) -> str:
        """In words."""
        return f"a list of one or more, each once and {self.of.wanted}"

    def holds(self, value: object) -> bool:
        """Whether this is one."""
        if not isinstance(value, list | tuple) or not value:
            return False
        return all(map(self.of.holds, value)) and len(set(value)) == len(value)


@dataclass(frozen=True, kw_only=True)
class Named:
    """A mapping from words, with at least these; what else is in it is ``others``."""

    fields: Mapping[str, Rule]
    others: Rule | None = None

    @property
    def wanted(self) -> str:
        """In words."""
        if not self.fields:
            return "a mapping of plain values"
        told = "; ".join(f"{name!r}: {rule.wanted}" for name, rule in self.fields.items())
        return f"a mapping with {told}"

    def holds(self, value: object) -> bool:
        """Whether this is one."""
        if not isinstance(value, Mapping) or not all(isinstance(name, str) for name in value):
            return False
        if not all(name in value and rule.holds(value[name]) for name, rule in self.fields.items()):
            return False
        rest = [one for name, one in value.items() if name not in self.fields]
        return self.others is None or all(map(self.others.holds, rest))


@dataclass(frozen=True, kw_only=True)
class Plain:
    """What JSON has: anything, nested ``MAX_DEPTH`` deep at most."""

    wanted: str = f"plain data, nested {MAX_DEPTH} deep at most"

    def holds(self, value: object) -> bool:
        """Whether this is it."""
        level = [value]
        for _ in range(MAX_DEPTH):
            level = [inner for one in level for inner in _within(one)]
            if not level:
                return True
        return False


@dataclass(frozen=True, kw_only=True)
class Truth:
    """True or False."""

    wanted: str = "true or false"

    def holds(self, value: object) -> bool:
        """Whether this is it."""
        return isinstance(value, bool)


def _within(value: object) -> list[object]:
    if isinstance(value, Mapping):
        return list(value.values())
    return list(value) if isinstance(value, list | tuple) else []


def _or_none(optional: bool) -> str:
    return " or nothing" if optional else ""

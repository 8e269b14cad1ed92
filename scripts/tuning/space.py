# SPDX-License-Identifier: Apache-2.0
"""Which numbers of a SLAM are searched, between which bounds: a TOML file.

[numbers]
search_size = {low = 0.1, high = 1.0, log = true}
matching.local.points = {low = 60, high = 360, int = true}
objective = {choices = ["sum", "log"]}
"""

import math
import re
import shlex
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any

import msgspec
from msgspec import Meta

from slam import system
from slam.bounded import toml_of
from slam.errors import InvalidValueError, LogFormatError, MissingPathError, UnknownNameError
from slam.set_numbers import with_numbers
from slam.shaped import Number, Table, shaped
from slam.variants import COMMANDS, inside

MOST_BYTES, MOST_NUMBERS, MOST_CHOICES = 1 << 16, 50, 100
DIGITS = 4  # of a number that is tried: more tell nobody anything
_VARIABLE = re.compile(r"[A-Za-z_]\w*", re.ASCII)
Choice = bool | Number | Annotated[str, Meta(pattern=r"\A[\w.+-]{1,100}\Z")]


class Searched(Table, frozen=True, omit_defaults=True):
    """Between which bounds, which are allowed themselves, or among what a number is searched."""

    low: Number | None = None
    high: Number | None = None
    log: bool = False
    whole: bool = msgspec.field(default=False, name="int")
    choices: Annotated[list[Choice], Meta(min_length=2, max_length=MOST_CHOICES)] | None = None

    @property
    def ends(self) -> tuple[Any, ...]:
        """Both bounds, or all choices; ``InvalidValueError`` for what is neither."""
        low, high = self.low, self.high
        if self.choices is not None and self == Searched(choices=self.choices):
            return tuple(self.choices)
        if self.choices is not None or low is None or high is None:
            raise InvalidValueError("needs low and high, or choices alone")
        if not low < high:
            raise InvalidValueError(f"low must be below high, got {low:g} and {high:g}")
        if self.log and low <= 0.0:
            raise InvalidValueError(f"low must be > 0 with log, got {low:g}")
        if self.whole and (low != int(low) or high != int(high)):
            raise InvalidValueError(f"low and high must be whole with int, got {low:g}, {high:g}")
        return (int(low), int(high)) if self.whole else (low, high)

    def distribution(self, of: Any) -> Any:
        """The same for Optuna, whose module ``optuna.distributions`` is ``of``."""
        if self.choices is not None:
            return of.CategoricalDistribution(self.choices)
        kind = of.IntDistribution if self.whole else of.FloatDistribution
        return kind(*self.ends, log=self.log)

    def rounded(self, value: Any) -> Any:
        """A value as it is tried: a float of few digits, within the bounds."""
        if self.choices is not None or self.whole:
            return value
        low, high = self.ends
        return min(max(float(f"{value:.{DIGITS}g}"), low), high)


Space = Mapping[str, Searched]
"""By path."""


def read(path: Path, slam: str) -> Space:
    """The space of a file for that SLAM, at each end of which it can be made.

    Raises ``LogFormatError`` that names the file, the number and what is wrong with it.
    """
    if not path.exists():
        raise MissingPathError(path, "no such file")
    tables = toml_of(path, MOST_BYTES)
    try:
        words = shaped("", tables, Wanted).numbers
        space = {name: shaped(name, one, Searched) for name, one in _flat(words)}
        if not 1 <= len(space) <= MOST_NUMBERS:
            raise InvalidValueError(
                f"[numbers] must name 1 to {MOST_NUMBERS} numbers, got {len(space)}"
            )
        for name, one in space.items():
            _try(slam, name, one)
    except (InvalidValueError, UnknownNameError) as error:
        raise LogFormatError(path, str(error)) from error
    return space


class Wanted(Table, frozen=True):
    """The file."""

    numbers: dict[str, Any]


def _flat(tables: Mapping[str, Any], above: str = "") -> Iterator[tuple[str, Any]]:
    """Tables of numbers by their paths; TOML nests what is written ``a.b = {low = 1, ...}``."""
    for name, one in tables.items():
        nested = isinstance(one, dict) and one and all(isinstance(v, dict) for v in one.values())
        if nested:
            yield from _flat(one, f"{above}{name}.")
        else:
            yield above + name, one


def _try(slam: str, name: str, one: Searched) -> None:
    """Complain of what the SLAM cannot take, as far as its config tells."""
    try:
        ends = one.ends
    except InvalidValueError as error:
        raise InvalidValueError(f"{name}: {error}") from error
    if one.choices is None and not one.whole:  # between them what no whole number may be
        ends += (one.rounded(ends[0] + (ends[1] - ends[0]) / math.pi),)
    for value in ends:
        known = system.config_of(variant(slam, {name: value}))
        if known is None and ":" not in inside(slam):
            raise InvalidValueError(f"SLAM '{slam}' has no numbers to set")


def variant(slam: str, numbers: Mapping[str, Any]) -> str:
    """The name of the SLAM with these numbers; a command gets them in its environment.

    Raises ``InvalidValueError`` for a number of a command that is no name of a variable.
    """
    prefix = next((one for one in COMMANDS if slam.startswith(one)), "")
    if not prefix:
        return with_numbers(slam, numbers)
    for name in numbers:
        if not _VARIABLE.fullmatch(name):
            raise InvalidValueError(f"{name!r:.80} is no name of an environment variable")
    words = (f"{name}={str(one).lower() if isinstance(one, bool) else one}"
             for name, one in numbers.items())  # fmt: skip
    return f"{prefix}{shlex.join(['env', *words])} {slam.removeprefix(prefix)}"


def defaults(slam: str, space: Space) -> dict[str, Any]:
    """The values that the SLAM has as it is named, of the numbers that say theirs."""
    found = system.config_of(slam)
    rows = [] if found is None else list(found[0].rows())
    known = {path: row.value for row in rows for path in (row.path, row.about.alias) if path}
    return {path: known[path] for path in space if path in known}

# SPDX-License-Identifier: Apache-2.0
"""What a cell of a table, a setting of a recipe, a field of a submission or an array may be.

A rule is a word, a number, a list of such, a mapping: ``word``, ``number``, ``many``, ``named``,
``PLAIN``, ``TRUTH``, or whatever else passes a test. An ``Array`` of an archive has its type and
shape checked before it is unpacked, then its values.
"""

import math
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scripts.options import MOST_PEOPLE, PEOPLE
from slam.archives import Header
from slam.checked import is_number, is_whole
from slam.errors import LogFormatError
from slam.files import word_of

MOST = 1e100  # of a finite number, either way: its squares and their sums are finite too
MAX_WORD = 2000  # letters of a name: what is longer is the name of no file
MAX_MESSAGE = 100_000  # letters of what a SLAM said when it failed; the csv module reads 131072
MAX_DEPTH = 16  # of lists and mappings within each other
_NUMBER = re.compile(r"[-+]?(\d{1,400}(\.\d{0,400})?(e[-+]?\d{1,4})?|inf)", re.ASCII)


@dataclass(frozen=True)
class Rule:
    """What a value must be.

    wanted  it in words, for "must be ..."
    holds   whether a value is one
    parsed  the value of a cell that is not empty; NaN where it holds none, which no rule allows
    """

    wanted: str
    holds: Callable[[Any], bool]
    parsed: Callable[[str], Any] = word_of


def word(*, among: tuple[str, ...] = (), most: int = MAX_WORD, optional: bool = False) -> Rule:
    """One line of letters that print; ``among`` these if any, None too where ``optional``."""
    wanted = f"a printable word of 1 to {most} letters"
    if among:
        wanted = among[0] if len(among) == 1 else f"one of {', '.join(among)}"

    def holds(value: Any) -> bool:
        if value is None or not isinstance(value, str):
            return optional and value is None
        return value in among if among else 0 < len(value) <= most and value.isprintable()

    return Rule(wanted + _or_none(optional), holds)


def number(
    *, least: float = 0.0, most: float = math.inf, whole: bool = False, optional: bool = False
) -> Rule:
    """A number from ``least`` to ``most``. An infinite end allows ``MOST`` and itself.

    whole     whole numbers alone; a cell may have one as 3.0
    optional  None too
    """
    low, high = -MOST if least == -math.inf else least, f"{most:g}"
    if most == math.inf:
        high = f"{MOST:g} or infinite"
    elif int(most) == most < MOST:
        high = str(int(most))

    def holds(value: Any) -> bool:
        if value is None:
            return optional
        if not (is_whole(value) or (is_number(value) and not whole)):
            return False
        return least <= value <= most and (abs(value) <= MOST or value in (math.inf, -math.inf))

    def parsed(cell: str) -> Any:
        if not _NUMBER.fullmatch(cell):
            return math.nan
        value = float(cell)
        if whole and value.is_integer():
            return int(cell) if cell.isdecimal() else int(value)
        return value

    kind = "a whole number" if whole else "a number"
    return Rule(f"{kind} from {low:g} to {high}" + _or_none(optional), holds, parsed)


def many(of: Rule) -> Rule:
    """A list of values, each of them by the same rule and there once; 1 at least."""

    def holds(value: Any) -> bool:
        if not isinstance(value, list | tuple) or not value:
            return False
        return all(map(of.holds, value)) and len(set(value)) == len(value)

    return Rule(f"a list of one or more, each once and {of.wanted}", holds)


def named(fields: Mapping[str, Rule], others: Rule | None = None) -> Rule:
    """A mapping from words, with at least these; what else is in it is ``others``."""
    told = "; ".join(f"{name!r}: {rule.wanted}" for name, rule in fields.items())

    def holds(value: Any) -> bool:
        if not isinstance(value, Mapping) or not all(isinstance(name, str) for name in value):
            return False
        if not all(name in value and rule.holds(value[name]) for name, rule in fields.items()):
            return False
        rest = (one for name, one in value.items() if name not in fields)
        return others is None or all(map(others.holds, rest))

    return Rule(f"a mapping with {told}" if fields else "a mapping of plain values", holds)


def is_shallow(value: object, most: int = MAX_DEPTH) -> bool:
    """Whether lists and mappings are nested at most so deep."""
    level = [value]
    for _ in range(most):
        level = [inner for one in level for inner in _within(one)]
        if not level:
            return True
    return False


def _within(value: object) -> Iterable[object]:
    if isinstance(value, Mapping):
        return value.values()
    return value if isinstance(value, list | tuple) else ()


def _or_none(optional: bool) -> str:
    return " or nothing" if optional else ""


PLAIN = Rule(f"plain data, nested {MAX_DEPTH} deep at most", is_shallow)
TRUTH = Rule("true or false", lambda value: isinstance(value, bool))
SHARE = number(most=1.0)
Columns = Mapping[str, Rule]
LEVEL = "level"  # the axis of ``scripts.comparison.plan.Plan.sets``


def level_of(axis: str) -> Rule:
    """What a level of that axis may be."""
    if axis == PEOPLE:
        return number(most=MOST_PEOPLE)
    return number(least=-1e6, most=1e6) if axis == LEVEL else SHARE


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


def check_keys(path: Path, where: str, found: Mapping[str, Any], rules: Mapping[str, Rule]) -> None:
    """``LogFormatError`` for the first key that is not there, or not by its rule."""
    for key, rule in rules.items():
        if key not in found:
            raise LogFormatError(path, f"lacks {where}{key}, which must be {rule.wanted}")
        if not rule.holds(found[key]):
            raise LogFormatError(
                path, f"{where}{key} must be {rule.wanted}, got {found[key]!r:.80}"
            )


MOST_CELLS = 1 << 28  # of a raster, as ``slam.maps`` reads it
MAYBE_NONE = ("movers", "answered")  # lengths that may be 0
_TYPES = {"b": np.bool_, "i": np.int64, "u": np.uint8, "f": np.float64, "U": np.str_}
_KINDS = {"b": "booleans", "i": "whole numbers", "u": "whole numbers", "f": "floats", "U": "words"}


@dataclass(frozen=True, kw_only=True)
class Array:
    """One array.

    kinds   letters of NumPy's types, any of which it may have
    shape   lengths, or their names: what is called alike has the same length
    least, most  of its entries
    finite  without NaN and infinities
    rising  each entry is above the one before
    """

    kinds: str
    shape: tuple[int | str, ...] = ()
    least: float = 0.0
    most: float = math.inf
    finite: bool = True
    rising: bool = False

    def fit(self, header: Header, lengths: dict[str, int]) -> str:
        """What is wrong with its type or shape; "" for nothing. ``lengths`` learns new ones."""
        # One without entries has lost its type: ``np.array([])`` is of floats, whatever it is of.
        if math.prod(header.shape) and header.dtype.kind not in self.kinds:
            kinds = " or ".join(dict.fromkeys(_KINDS[kind] for kind in self.kinds))
            return f"must hold {kinds}, got {header.dtype}"
        if header.dtype.kind == "U" and header.dtype.itemsize > 4 * MAX_WORD:
            return f"must hold words of at most {MAX_WORD} letters, got {header.dtype}"
        if not self._fits(header.shape, lengths):
            wanted = ", ".join(_named(length, lengths) for length in self.shape)
            return f"must have shape ({wanted}), got {header.shape}"
        return ""

    def _fits(self, shape: tuple[int, ...], lengths: dict[str, int]) -> bool:
        """Whether a shape is this; of an array without entries up to its first length of 0."""
        for length, found in zip(self.shape, shape, strict=False):
            if (lengths.get(length, found) if isinstance(length, str) else length) != found:
                return False
            if isinstance(length, str):
                lengths[length] = found
            if found == 0:
                return length in MAYBE_NONE
        return len(shape) == len(self.shape)

    def of_none(self, lengths: Mapping[str, int]) -> NDArray[Any]:
        """The array without entries, in full shape."""
        shape = [lengths.get(length, 0) if isinstance(length, str) else length
                 for length in self.shape]  # fmt: skip
        return np.zeros(shape, dtype=_TYPES[self.kinds[0]])

    def wrong(self, array: NDArray[Any]) -> str:
        """What is wrong with its values; "" for nothing."""
        if array.size == 0 or array.dtype.kind == "b":
            return ""
        if array.dtype.kind == "U":
            bad = next((word for word in array.ravel().tolist() if not word.isprintable()), None)
            return "" if bad is None else f"must hold words that print, got {bad!r:.80}"
        if self.finite and not np.isfinite(array).all():
            return f"must be finite, got {_one(array, ~np.isfinite(array))}"
        out = (array < self.least) | (array > self.most)  # False for NaN
        if out.any():
            return f"must lie in {self.least:g}..{self.most:g}, got {_one(array, out)}"
        if self.rising and (array[1:] <= array[:-1]).any():
            return "must strictly increase"
        return ""


def _one(array: NDArray[Any], bad: NDArray[np.bool_]) -> Any:
    return np.asarray(array)[bad].ravel()[0]


def _named(length: int | str, lengths: Mapping[str, int]) -> str:
    known = lengths.get(length) if isinstance(length, str) else None
    return str(length) if known is None else f"{known} {length}"


def check_shapes(
    path: Path, headers: Mapping[str, Header], wanted: Mapping[str, Array], lengths: dict[str, int]
) -> None:
    """``LogFormatError`` unless these arrays are there, of their types and shapes.

    It asks for nothing that is packed. ``lengths`` are those that are known: it learns the others.
    """
    for name, array in wanted.items():
        if name not in headers:
            raise LogFormatError(path, f"holds no array {name!r}")
        if said := array.fit(headers[name], lengths):
            raise LogFormatError(path, f"array {name!r} {said}")

# SPDX-License-Identifier: Apache-2.0
"""What a cell of a table, a setting of a recipe, a field of a submission or an array may be.

A kind is a type as ``slam.shaped`` takes it: ``word``, ``number``, a list or table of such. An
``Array`` of an archive has its type and shape checked before it is unpacked, then its values.
"""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from msgspec import Meta, inspect
from numpy.typing import NDArray

from scripts.options import MOST_PEOPLE, PEOPLE
from slam.archives import Header
from slam.errors import InvalidValueError, LogFormatError
from slam.files import word_of
from slam.shaped import PRINTABLE, Share, shaped, wanted

MOST = 1e100  # of a finite number, either way: its squares and their sums are finite too
MAX_WORD = 2000  # letters of a name: what is longer is the name of no file
MAX_MESSAGE = 100_000  # letters of what a SLAM said when it failed; the csv module reads 131072
MAX_DEPTH = 16  # of lists and mappings within each other
Line = Annotated[str, Meta(min_length=1, max_length=MAX_WORD, pattern=PRINTABLE)]
Kind = Any  # a type as msgspec knows it


def word(*, among: tuple[str, ...] = (), most: int = MAX_WORD, optional: bool = False) -> Kind:
    """One line of letters that print; ``among`` these if any, None too where ``optional``."""
    kind: Kind = Annotated[str, Meta(min_length=1, max_length=most, pattern=PRINTABLE)]
    if among:
        kind = Literal[among]
    return kind | None if optional else kind


def number(
    *, least: float = 0.0, most: float = math.inf, whole: bool = False, optional: bool = False
) -> Kind:
    """A number from ``least`` to ``most``, or a whole one. None too where ``optional``."""
    sort: Kind = int if whole else float
    ends = {"ge": least, "le": most}
    bounds = {end: sort(bound) for end, bound in ends.items() if math.isfinite(bound)}
    kind: Kind = Annotated[sort, Meta(**bounds)] if bounds else sort
    return kind | None if optional else kind


def many(of: Kind) -> Kind:
    """A list of one or more of these."""
    return Annotated[list[of], Meta(min_length=1)]


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


Columns = Mapping[str, Kind]
LEVEL = "level"  # the axis of ``scripts.comparison.plan.Plan.sets``


def level_of(axis: str) -> Kind:
    """What a level of that axis may be."""
    if axis == PEOPLE:
        return number(most=MOST_PEOPLE)
    return number(least=-1e6, most=1e6) if axis == LEVEL else Share


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

    def row(self, given: Mapping[str, Any], axis: str) -> dict[str, Any]:
        """The row of these values, or of the words of their cells, where levels are of that axis.

        NaN and empty words are None. ``InvalidValueError`` names the column that is wrong.
        """
        level = {"dynamism": level_of(axis)} if "dynamism" in self.columns else {}
        row = {
            column: _cell(axis if column == "dynamism" else column, given.get(column), kind)
            for column, kind in {**self.columns, **level}.items()
        }
        if said := self._impossible(row):
            raise InvalidValueError(said)
        return row

    def _impossible(self, row: Mapping[str, Any]) -> str:
        """Why the cells of a row, each right by its kind, cannot stand together; "" if they can."""
        told = [name for name in self.together if row[name] is not None]
        if told and len(told) < len(self.together):
            return f"{', '.join(self.together)} must all be there or none, got {', '.join(told)}"
        for part, whole in self.parts:
            most, count = row[whole], row[part]
            if count is not None and most is not None and count > most:
                return f"{part} must be at most {whole}, {most}, got {count}"
        for name in ("value", "low", "high") if row.get("statistic") == "share" else ():
            if not 0.0 <= row[name] <= 1.0:
                return f"{name} must be a number from 0 to 1, as it is of a share, got {row[name]}"
        return ""


def _cell(name: str, given: Any, kind: Kind) -> Any:
    if given == "" or given != given:
        given = None
    value = shaped(name, word_of(given) if isinstance(given, str) else given, kind, strict=False)
    if isinstance(value, (int, float)) and not (abs(value) <= MOST or abs(value) == math.inf):
        raise InvalidValueError(f"{name} must be at most {MOST:g} or infinite, got {given!r:.80}")
    return value


def check_keys(path: Path, where: str, found: Mapping[str, Any], kinds: Columns) -> None:
    """``LogFormatError`` for the first key that is not there, or not of its kind."""
    for key, kind in kinds.items():
        if key not in found:
            told = wanted(inspect.type_info(kind))
            raise LogFormatError(path, f"lacks {where}{key}, which must be {told}")
        try:
            shaped(f"{where}{key}", found[key], kind)
        except InvalidValueError as error:
            raise LogFormatError(path, str(error)) from error


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

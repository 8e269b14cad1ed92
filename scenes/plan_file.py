# SPDX-License-Identifier: Apache-2.0
"""The border for MJCF files from elsewhere: what MuJoCo sees was checked (docs/scenes.md).

MuJoCo gets a text that is written anew of what passed: elements that are known, numbers within
bounds, no entity and no other file.
"""

import re
from collections import Counter
from collections.abc import Iterable
from functools import cache
from pathlib import Path
from xml.parsers import expat
from xml.sax.saxutils import quoteattr

from msgspec import inspect

from scenes.elements import ATTRIBUTES, HOLDS
from slam.bounded import bytes_of
from slam.errors import InvalidValueError
from slam.shaped import shaped

MAX_BYTES = 1 << 22  # of a file
MAX_DEPTH = 20  # elements in one another
LEAST_M = 1e-6  # m, of a size: the squares of much smaller ones are 0
MOST_BOXES = 10_000  # walls and other geoms of a plan; to build them takes 3 s
MOST_MARKS = 2000  # of a plan; to take them out again takes 3 s
MOST = 500  # elements of any other kind
MAX_M2 = 60_000.0  # m2 that a scene spans: its true map then has 150 million cells (0.6 GB)
MOST_GOALS_M2 = 1.5e6  # m2 that a scene spans times its goals: the ways to them take 0.9 GB
MOST_M = 20_000.0  # m of walls and geoms, each as long as its longer side: what maps of it cost
_MOST = {"geom": MOST_BOXES, "site": MOST_MARKS}
_WHOLE = re.compile(r"[-+]?[0-9]{1,9}")
_NUMBER = re.compile(r"[-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?")


def checked(path: Path, folder: str, shared: tuple[str, ...]) -> str:
    """The text of a file of the "plans" or "parts" for MuJoCo, every element on its line.

    shared  names of the files that it includes, whether it says so or not
    Raises ``InvalidValueError`` that names the file, line and element, ``LogFormatError`` for what
    is no file or too large.
    """
    border = _Border(HOLDS[folder], shared)
    try:
        return border.text(bytes_of(path, MAX_BYTES))
    except expat.ExpatError as error:
        raise InvalidValueError(f"{path}: no MJCF: {error}") from None
    except InvalidValueError as error:
        raise InvalidValueError(f"{path}:{border.line}: {error}") from None


def check_span(what: str, bounds: tuple[float, float, float, float], goals: int = 0) -> None:
    """Raise ``InvalidValueError`` for a scene (xmin, ymin, xmax, ymax m) too wide for its maps."""
    xmin, ymin, xmax, ymax = bounds
    area, wide = (xmax - xmin) * (ymax - ymin), f"{xmax - xmin:.0f} x {ymax - ymin:.0f} m"
    if area > MAX_M2:
        raise InvalidValueError(f"{what} spans {wide}, expected at most {MAX_M2:g} m2")
    if goals * area > MOST_GOALS_M2:
        most = int(MOST_GOALS_M2 / area)
        raise InvalidValueError(f"{what} has {goals} goals on {wide}, expected at most {most}")


def check_length(what: str, lengths: Iterable[float]) -> None:
    """Raise ``InvalidValueError`` for a scene with more walls (m each) than maps are made of."""
    length = sum(lengths)
    if length > MOST_M:
        raise InvalidValueError(
            f"{what} has {length:.0f} m of walls and geoms, expected at most {MOST_M:g} m"
        )


class _Border:
    """Takes in the elements of a file, and gives out those that may pass."""

    def __init__(self, holds: dict[str, tuple[str, ...]], shared: tuple[str, ...]) -> None:
        self._holds, self._shared = holds, shared
        self._open: list[str] = [""]
        self._count: Counter[str] = Counter()
        self._out: list[str] = []
        self._lines = 1  # given out
        self._parser = expat.ParserCreate("utf-8")
        self._parser.StartElementHandler = self._begin
        self._parser.EndElementHandler = self._end
        self._parser.StartDoctypeDeclHandler = self._doctype

    @property
    def line(self) -> int:
        """Where it is in the file."""
        return self._parser.CurrentLineNumber

    def text(self, data: bytes) -> str:
        """What passed of all that."""
        self._parser.Parse(data, True)
        return "".join(self._out)

    def _doctype(self, *_: object) -> None:
        raise InvalidValueError("it has a DOCTYPE, expected elements alone")

    def _begin(self, tag: str, given: dict[str, str]) -> None:
        what = f"{tag:.40} '{given['name']:.100}'" if given.get("name") else f"{tag:.40}"
        try:
            self._check(tag, given)
        except InvalidValueError as error:
            raise InvalidValueError(f"{what}: {error}") from None
        self._open.append(tag)
        if tag == "include":
            return
        self._out.append("\n" * (self.line - self._lines))
        self._lines = max(self._lines, self.line)
        self._out.append(f"<{tag}{''.join(f' {k}={quoteattr(v)}' for k, v in given.items())}>")
        if tag == "mujoco":
            self._out += [f"<include file={quoteattr(name)}/>" for name in self._shared]

    def _end(self, tag: str) -> None:
        self._open.pop()
        if tag != "include":
            self._out.append(f"</{tag}>")

    def _check(self, tag: str, given: dict[str, str]) -> None:
        """Raise ``InvalidValueError`` for an element that may not stand here."""
        inside = self._open[-1]
        may = self._holds.get(inside, ())
        if tag not in may:
            where = f"in {inside}" if inside else "as the whole"
            raise InvalidValueError(f"not known {where}, expected {', '.join(may) or 'nothing'}")
        self._count[tag] += 1
        most = _MOST.get(tag, MOST)
        if self._count[tag] > most:
            raise InvalidValueError(f"one too many, expected at most {most} of these")
        if len(self._open) > MAX_DEPTH:
            raise InvalidValueError(f"too deep, expected at most {MAX_DEPTH} levels")
        values = {key: _value(tag, key, text) for key, text in given.items()}
        found = shaped("", values, ATTRIBUTES[tag])
        if any(0.0 < size < LEAST_M for size in getattr(found, "size", ())):
            raise InvalidValueError(f"size must be 0 or at least {LEAST_M:g} m, got {found.size}")
        if tag == "include" and Path(given["file"]).name not in self._shared:
            known = ", ".join(self._shared)
            raise InvalidValueError(f"file must be one of {known}, got {given['file']!r:.80}")


def _value(tag: str, key: str, text: str) -> object:
    """An attribute as its type takes it; what is no number stays a word."""
    kind = _kinds(tag).get(key, inspect.StrType())
    if isinstance(kind, inspect.StrType) or (
        isinstance(kind, inspect.LiteralType) and isinstance(kind.values[0], str)
    ):
        return text
    values = tuple(map(_number, text.split()))
    many = isinstance(kind, inspect.TupleType | inspect.VarTupleType)
    return values[0] if len(values) == 1 and not many else values


def _number(word: str) -> int | float | str:
    if _WHOLE.fullmatch(word):
        return int(word)
    return float(word) if _NUMBER.fullmatch(word) else word


@cache
def _kinds(tag: str) -> dict[str, inspect.Type]:
    """The types of an element's attributes."""
    kind = inspect.type_info(ATTRIBUTES[tag])
    assert isinstance(kind, inspect.StructType)
    return {own.encode_name: own.type for own in kind.fields}

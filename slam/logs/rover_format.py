# SPDX-License-Identifier: Apache-2.0
"""What a TOML file says of somebody's text log: columns, units, ticks. One line is one scan.

Columns count from 1. Angles end in ``_deg``; lengths are in the ``unit`` of their table::

    separator = " "          # default: blanks and tabs; "," for CSV
    [time]
    column = 1
    unit = "us"              # s, ms, us or ns
    [odometry]               # encoder counts:
    left = 3
    right = 4
    ticks_per_turn = 1000    # of a wheel
    wheel_radius = 0.077
    track = 0.33             # between the wheels
    unit = "m"               # m, cm or mm
    [scan]
    first = 25               # column of the first range; up to the end of the line, or
    beams = 682              # so many
    unit = "mm"
    start_deg = -120.0       # direction of the first range, counter-clockwise from ahead
    step_deg = 0.352         # to the next
    range_max = 4000
    [laser]                  # on the robot; default its origin
    x = 0.145
    y = 0.0
    yaw_deg = 0.0
    unit = "m"

Odometry is instead ``x``, ``y``, ``theta`` (columns) with ``unit`` and ``angle`` ("rad" or "deg"),
or left out where there is none. ``counter`` says at how many ticks a count starts again at 0.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from slam.bounded import text_of
from slam.errors import LogFormatError
from slam.logs.text import MAX_BEAMS, MAX_RANGE_M

MAX_TOML_BYTES = 1 << 16
MAX_COLUMN = 100_000
SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
METRES = {"m": 1.0, "cm": 1e-2, "mm": 1e-3}
RADIANS = {"rad": 1.0, "deg": math.pi / 180.0}
LARGEST = 1e12  # of any number


@dataclass(frozen=True, kw_only=True)
class Ticks:
    """Encoder counts: columns from 0, m a tick, m between the wheels, where counts start again."""

    left: int
    right: int
    m_per_tick: float
    track_m: float
    counter: int


@dataclass(frozen=True, kw_only=True)
class Poses:
    """Poses by odometry: columns from 0, their units in m and rad."""

    x: int
    y: int
    theta: int
    m: float
    rad: float


@dataclass(frozen=True, kw_only=True)
class RoverFormat:
    """A log that somebody described. Columns from 0, SI units, ``beams`` 0 for the line's end."""

    path: Path
    separator: str
    time: int
    s: float
    odometry: Ticks | Poses | None
    first: int
    beams: int
    m: float
    start_rad: float
    step_rad: float
    range_max_m: float
    mount: tuple[float, float, float]
    mounted: str = ""


def read_format(path: str | Path) -> RoverFormat:
    """The description at ``path``.

    Raises ``LogFormatError`` that names the file, the key, its value and what was expected; keys
    that are not known are refused.
    """
    path = Path(path)
    try:
        tables = tomllib.loads(text_of(path, MAX_TOML_BYTES))
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        raise LogFormatError(path, f"is no TOML: {error}") from error
    whole = _Table(path, "", tables)
    separator = whole.word("separator", " ")
    if len(separator) != 1 or separator.isalnum() or separator in ".-+":
        raise LogFormatError(path, f"separator must be one mark such as ',', got {separator!r}")
    time, scan = whole.table("time"), whole.table("scan")
    odometry = whole.table("odometry") if "odometry" in tables else None
    laser = whole.table("laser") if "laser" in tables else _Table(path, "laser", {})
    m, laser_m = scan.unit("unit", METRES, "m"), laser.unit("unit", METRES, "m")
    made = RoverFormat(
        path=path,
        separator=separator,
        time=time.column("column"),
        s=time.unit("unit", SECONDS, "s"),
        odometry=None if odometry is None else _odometry(odometry),
        first=scan.column("first"),
        beams=scan.whole("beams", 0, MAX_BEAMS, default=0),
        m=m,
        start_rad=math.radians(scan.number("start_deg", -720.0, 720.0)),
        step_rad=math.radians(scan.number("step_deg", -90.0, 90.0)),
        range_max_m=scan.number("range_max", 0.0, MAX_RANGE_M / m) * m,
        mount=(
            laser.number("x", -30.0 / laser_m, 30.0 / laser_m, default=0.0) * laser_m,
            laser.number("y", -30.0 / laser_m, 30.0 / laser_m, default=0.0) * laser_m,
            math.radians(laser.number("yaw_deg", -360.0, 360.0, default=0.0)),
        ),
        mounted=f"[laser] of {path.name}" if "laser" in tables else "",
    )
    for table in (whole, time, scan, laser, *([] if odometry is None else [odometry])):
        table.refuse_others()
    if made.step_rad == 0.0 or made.range_max_m == 0.0:
        raise LogFormatError(path, "scan.step_deg and scan.range_max must not be 0")
    return made


def _odometry(table: _Table) -> Ticks | Poses:
    unit = table.unit("unit", METRES, "m")
    if "left" not in table.values:
        return Poses(
            x=table.column("x"),
            y=table.column("y"),
            theta=table.column("theta"),
            m=unit,
            rad=table.unit("angle", RADIANS, "rad"),
        )
    turn = table.number("ticks_per_turn", 1e-3, LARGEST)
    radius = table.number("wheel_radius", 1e-3, 10.0 / unit) * unit
    return Ticks(
        left=table.column("left"),
        right=table.column("right"),
        m_per_tick=math.tau * radius / turn,
        track_m=table.number("track", 1e-3, 10.0 / unit) * unit,
        counter=table.whole("counter", 0, 1 << 62, default=0),
    )


class _Table:
    """One table of the file; keeps which keys were asked for."""

    def __init__(self, path: Path, name: str, values: Mapping[str, Any]) -> None:
        self._path, self._name, self.values = path, name, values
        self._asked: set[str] = set()

    def table(self, key: str) -> _Table:
        """A table in it."""
        value = self._get(key, None)
        if not isinstance(value, dict):
            raise self._wrong(key, value, "a table")
        return _Table(self._path, key, value)

    def column(self, key: str) -> int:
        """A column, from 0."""
        return self.whole(key, 1, MAX_COLUMN) - 1

    def whole(self, key: str, low: int, high: int, default: int | None = None) -> int:
        """A whole number."""
        value = self._get(key, default)
        if type(value) is not int or not low <= value <= high:
            raise self._wrong(key, value, f"a whole number from {low} to {high}")
        return value

    def number(self, key: str, low: float, high: float, default: float | None = None) -> float:
        """Any number within."""
        value = self._get(key, default)
        if type(value) not in (int, float) or not low <= value <= high:
            raise self._wrong(key, value, f"a number from {low:g} to {high:g}")
        return float(value)

    def word(self, key: str, default: str) -> str:
        """A string."""
        value = self._get(key, default)
        if not isinstance(value, str):
            raise self._wrong(key, value, "a string")
        return value

    def unit(self, key: str, units: Mapping[str, float], default: str) -> float:
        """What a unit is in SI."""
        word = self.word(key, default)
        if word not in units:
            raise self._wrong(key, word, f"one of {', '.join(units)}")
        return units[word]

    def refuse_others(self) -> None:
        """``LogFormatError`` for keys that nobody asked for."""
        others = sorted(set(self.values) - self._asked)
        if others:
            known = ", ".join(sorted(self._asked))
            where = f"[{self._name}] " if self._name else ""
            raise LogFormatError(self._path, f"{where}unknown key {others[0]!r}; known: {known}")

    def _get(self, key: str, default: Any) -> Any:
        self._asked.add(key)
        return self.values.get(key, default)

    def _wrong(self, key: str, value: Any, expected: str) -> LogFormatError:
        name = f"{self._name}.{key}" if self._name else key
        got = "nothing" if value is None else repr(value)[:80]
        return LogFormatError(self._path, f"{name} must be {expected}, got {got}")

# SPDX-License-Identifier: Apache-2.0
"""Text logs of small robots, a line a scan, read by a TOML description of their columns.

docs/logs.md has its keys; ``read_format`` refuses others. Columns count from 1.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from slam import se2
from slam.bounded import toml_of
from slam.errors import LogFormatError
from slam.frames import NS_PER_S, Float, Stream
from slam.logs.repairs import FINE_DIGITS, Repairs
from slam.logs.scan_log import ScanLog, stream_of
from slam.logs.scan_poses import Beams, LaserMessage
from slam.logs.text import (
    MAX_BEAMS,
    MAX_COORDINATE,
    MAX_RANGE_M,
    MAX_STAMP_S,
    Pose,
    about,
    numbered_lines,
)

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
    tables = toml_of(path, MAX_TOML_BYTES)
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


SCAN = "line"


def read_rover(path: str | Path, text_format: str | Path, *, strict: bool = False) -> Stream:
    """A text log (plain, .gz or .xz) with one scan a line, as ``text_format`` describes it.

    ``text_format`` is a TOML file (docs/logs.md). Empty lines and those that begin
    with ``#`` are left out. Ranges of 0 are error codes, those at the maximum no return. Without
    odometry the frames have that of a robot at rest, and ``metadata.odometry`` says so.

    Repairs and ``strict`` are those of ``read_carmen``. Raises ``LogFormatError`` with file, line,
    the value and what was expected.
    """
    log_format = read_format(text_format)
    path = Path(path)
    repairs = Repairs(path, strict)
    odometry = _Odometry(log_format.odometry)
    mount = np.array(log_format.mount)
    scans = []
    for number, words in _rows(path, log_format, repairs):
        with about(path, line=number):
            robot = odometry.pose(words)
            scans.append(_scan(number, words, log_format, robot, mount))
    if not scans:
        raise LogFormatError(path, "no scan found: no line but empty ones and comments")
    wheels = log_format.odometry is not None
    log = ScanLog(
        path=path,
        message=SCAN,
        scans=scans,
        mount=mount,
        mounted=log_format.mounted,
        wheels=wheels,
        digits=FINE_DIGITS,
    )
    return stream_of(log, repairs, "rover")


def _rows(path: Path, log_format: RoverFormat, repairs: Repairs) -> Iterator[tuple[int, list[str]]]:
    for number, line in numbered_lines(path, repairs):
        if line.strip() and not line.lstrip().startswith("#"):
            blank = log_format.separator.isspace()
            yield number, line.split() if blank else line.split(log_format.separator)


class _Odometry:
    """The pose of each line."""

    def __init__(self, how: Ticks | Poses | None) -> None:
        self._how = how
        self._before: tuple[float, float] | None = None
        self._pose: Float = np.zeros(3)

    def pose(self, words: list[str]) -> Pose | None:
        """m, m, rad; None where the log has none."""
        how = self._how
        if how is None:
            return None
        if isinstance(how, Poses):
            x = _number(words, how.x, LARGEST, "x") * how.m
            y = _number(words, how.y, LARGEST, "y") * how.m
            theta = _number(words, how.theta, LARGEST, "theta") * how.rad
        else:
            x, y, theta = self._driven(how, words)
        if max(abs(x), abs(y), abs(theta)) > MAX_COORDINATE:
            raise ValueError(
                f"a pose must lie within {MAX_COORDINATE:g} m and rad, got {x:g}, {y:g}, {theta:g}"
            )
        return x, y, theta

    def _driven(self, how: Ticks, words: list[str]) -> Pose:
        left = _number(words, how.left, LARGEST, "left")
        now = left, _number(words, how.right, LARGEST, "right")
        before = self._before or now
        left, right = (
            _since(a, b, how.counter) * how.m_per_tick for a, b in zip(before, now, strict=True)
        )
        self._before = now
        twist = [0.5 * (left + right), 0.0, (right - left) / how.track_m]
        self._pose = se2.compose(self._pose, se2.exp(twist))
        x, y, theta = self._pose.tolist()
        return x, y, theta


def _since(before: float, now: float, counter: int) -> float:
    """Ticks from one count to the next; a counter goes on from 0, forwards or back."""
    ticks = now - before
    return ticks - counter * round(ticks / counter) if counter else ticks


def _scan(
    number: int, words: list[str], log_format: RoverFormat, robot: Pose | None, mount: Float
) -> LaserMessage:
    ranges = _ranges(words, log_format)
    start, step = log_format.start_rad, log_format.step_rad
    if step < 0.0:
        ranges.reverse()
        start, step = start + (len(ranges) - 1) * step, -step
    if len(ranges) * step > 1.05 * math.tau:
        raise ValueError(f"{len(ranges)} beams {math.degrees(step):g} degrees apart: over one turn")
    laser = None
    if robot is not None:
        x, y, theta = se2.compose(robot, mount).tolist()
        laser = (x, y, theta)
    _number(words, log_format.time, MAX_STAMP_S / log_format.s, "time")
    return LaserMessage(
        line=number,
        stamp_ns=_ns(words[log_format.time], log_format.s),
        ranges=ranges,
        beams=Beams(start_angle=start, increment=step, range_max=log_format.range_max_m),
        laser_pose=laser,
        robot_pose=robot,
    )


def _ns(word: str, unit_s: float) -> int:
    """Exact for whole numbers: ``float`` would lose the last digits of Unix times."""
    scale = round(unit_s * NS_PER_S)
    try:
        return int(word) * scale
    except ValueError:
        return round(float(word) * scale)


def _ranges(words: list[str], log_format: RoverFormat) -> list[float]:
    first, n = log_format.first, log_format.beams
    last = first + n if n else len(words)
    if not first < last <= len(words):
        wanted = f"{n} ranges from" if n else "ranges from"
        raise ValueError(f"{len(words)} columns; expected {wanted} column {first + 1}")
    values = [
        _number(words, column, LARGEST, "range") * log_format.m for column in range(first, last)
    ]
    for k, value in enumerate(values):
        if not 0.0 <= value <= MAX_RANGE_M:
            raise ValueError(f"range in column {first + k + 1} must be 0 to {MAX_RANGE_M:g} m, "
                             f"got {value:g} m")  # fmt: skip
    return values


def _number(words: list[str], column: int, limit: float, field: str) -> float:
    if column >= len(words):
        raise ValueError(f"{field}: {len(words)} columns; expected a number in column {column + 1}")
    word = words[column].strip()
    try:
        value = float(word)
    except ValueError:
        value = math.nan
    if not abs(value) <= limit:
        raise ValueError(
            f"{field}: expected a number in column {column + 1}, within +-{limit:g}, "
            f"got {word[:40]!r}"
        )
    return value

# SPDX-License-Identifier: Apache-2.0
"""Text logs of small robots, a line a scan, read by a TOML description of their columns.

docs/logs.md has its keys; ``read_format`` refuses others. Columns count from 1.
"""

import csv
import math
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any, Literal

import msgspec
import numpy as np
from msgspec import Meta

from slam import se2
from slam.bounded import toml_of
from slam.errors import InvalidValueError, LogFormatError
from slam.frames import NS_PER_S, Float, Stream
from slam.logs.repairs import FINE_DIGITS, Repairs
from slam.logs.scan_log import ScanLog, stream_of
from slam.logs.scan_poses import Beams, LaserMessage
from slam.logs.text import MAX_COORDINATE, MAX_RANGE_M, MAX_STAMP_S, Pose, about, numbered_lines
from slam.shaped import Table, shaped

MAX_TOML_BYTES = 1 << 16
SI = {
    "s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "m": 1.0, "cm": 1e-2, "mm": 1e-3,
    "rad": 1.0, "deg": math.pi / 180.0,
}  # fmt: skip
LARGEST = 1e12  # of any number
Column = Annotated[int, Meta(ge=1, le=100_000)]
Metres = Literal["m", "cm", "mm"]
Size = Annotated[float, Meta(ge=1e-3, le=1e4)]  # of a part of the robot, in its unit
Place = Annotated[float, Meta(ge=-3e4, le=3e4)]


class Time(Table, frozen=True):
    """Where the time of a scan stands."""

    column: Column
    unit: Literal["s", "ms", "us", "ns"] = "s"


class Ticks(Table, frozen=True):
    """Columns of encoder counts, ticks of a wheel's turn, where counts start again (0: never)."""

    left: Column
    right: Column
    ticks_per_turn: Annotated[float, Meta(ge=1e-3, le=LARGEST)]
    wheel_radius: Size
    track: Size
    unit: Metres = "m"
    counter: Annotated[int, Meta(ge=0, le=1 << 62)] = 0


class Poses(Table, frozen=True):
    """Columns of poses by odometry."""

    x: Column
    y: Column
    theta: Column
    unit: Metres = "m"
    angle: Literal["rad", "deg"] = "rad"


class Ranges(Table, frozen=True):
    """Columns of the ranges, ``beams`` 0 for the line's end, and the scanner's geometry."""

    first: Column
    start_deg: Annotated[float, Meta(ge=-720.0, le=720.0)]
    step_deg: Annotated[float, Meta(ge=-90.0, le=90.0)]
    range_max: Annotated[float, Meta(gt=0.0, le=1e7)]
    beams: Annotated[int, Meta(ge=0, le=20_000)] = 0
    unit: Metres = "m"


class Laser(Table, frozen=True):
    """Where the scanner is on the robot."""

    x: Place = 0.0
    y: Place = 0.0
    yaw_deg: Annotated[float, Meta(ge=-360.0, le=360.0)] = 0.0
    unit: Metres = "m"

    @property
    def mount(self) -> Float:
        """(3,) m, m, rad."""
        m = SI[self.unit]
        return np.array([self.x * m, self.y * m, math.radians(self.yaw_deg)])


class RoverFormat(Table, frozen=True):
    """A log that somebody described."""

    time: Time
    scan: Ranges
    odometry: Any = None  # Ticks or Poses
    laser: Laser | None = None
    separator: Annotated[str, Meta(pattern=r"^[^\w.+-]$")] = " "


def read_format(path: str | Path) -> RoverFormat:
    """The description at ``path``.

    Raises ``LogFormatError`` that names the file, the key, its value and what was expected; keys
    that are not known are refused.
    """
    path = Path(path)
    try:
        made: RoverFormat = shaped("", toml_of(path, MAX_TOML_BYTES), RoverFormat)
        if made.odometry is not None:
            kind = Ticks if "left" in made.odometry else Poses
            odometry = shaped("odometry", made.odometry, kind)
            made = msgspec.structs.replace(made, odometry=odometry)
        if made.scan.step_deg == 0.0:
            raise InvalidValueError("scan.step_deg must not be 0")
    except InvalidValueError as error:
        raise LogFormatError(path, str(error)) from None
    return made


SCAN = "line"
NAMES = "lines of column names"
NOTHING = ("", "na", "n/a", "nan", "none", "null", "-inf")  # cells that say no range


def read_rover(path: str | Path, text_format: str | Path, *, strict: bool = False) -> Stream:
    """A text log (plain, .gz or .xz) with one scan a line, as ``text_format`` describes it.

    ``text_format`` is a TOML file (docs/logs.md). Empty lines and those that begin
    with ``#`` are left out, and so are first lines of names: those without a number where the time
    and the odometry are. Ranges of 0, nan and empty cells are error codes; inf and those at the
    maximum are no return. Without odometry the frames have that of a robot at rest, and
    ``metadata.odometry`` says so.

    Repairs and ``strict`` are those of ``read_carmen``. Raises ``LogFormatError`` with file, line,
    the value and what was expected.
    """
    how = read_format(text_format)
    path = Path(path)
    repairs = Repairs(path, strict)
    odometry = _Odometry(how.odometry)
    mount = (how.laser or Laser()).mount
    scans: list[LaserMessage] = []
    named = 0
    for number, words in _rows(path, how.separator, repairs):
        if not scans and _is_names(words, how):
            named += 1
            continue
        with about(path, line=number):
            scans.append(_scan(number, words, how, odometry.pose(words), mount))
    if not scans:
        raise LogFormatError(path, "no scan found: no line but empty ones and comments")
    log = ScanLog(
        path=path,
        message=SCAN,
        scans=scans,
        mount=mount,
        mounted=f"[laser] of {Path(text_format).name}" if how.laser else "",
        wheels=how.odometry is not None,
        digits=FINE_DIGITS,
        ignored=Counter({NAMES: named} if named else {}),
    )
    return stream_of(log, repairs, "rover")


def _is_names(words: list[str], how: RoverFormat) -> bool:
    """Whether it is a line of column names, as tables have: nothing but its ranges is a number."""
    columns = [how.time.column]
    if isinstance(how.odometry, Poses):
        columns += [how.odometry.x, how.odometry.y, how.odometry.theta]
    elif how.odometry is not None:
        columns += [how.odometry.left, how.odometry.right]
    found = [words[column - 1].strip() for column in columns if column <= len(words)]
    return len(found) == len(columns) and all(word and not _is_number(word) for word in found)


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def _rows(path: Path, separator: str, repairs: Repairs) -> Iterator[tuple[int, list[str]]]:
    for number, line in numbered_lines(path, repairs):
        if line.strip() and not line.lstrip().startswith("#"):
            if separator.isspace():
                yield number, line.split()
            else:
                yield number, next(csv.reader([line], delimiter=separator))


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
            x = _number(words, how.x, "x") * SI[how.unit]
            y = _number(words, how.y, "y") * SI[how.unit]
            theta = _number(words, how.theta, "theta") * SI[how.angle]
        else:
            x, y, theta = self._driven(how, words)
        if max(abs(x), abs(y), abs(theta)) > MAX_COORDINATE:
            raise ValueError(
                f"a pose must lie within {MAX_COORDINATE:g} m and rad, got {x:g}, {y:g}, {theta:g}"
            )
        return x, y, theta

    def _driven(self, how: Ticks, words: list[str]) -> Pose:
        left = _number(words, how.left, "left")
        now = left, _number(words, how.right, "right")
        before = self._before or now
        m = SI[how.unit]
        m_per_tick = math.tau * (how.wheel_radius * m) / how.ticks_per_turn
        left, right = (
            _since(a, b, how.counter) * m_per_tick for a, b in zip(before, now, strict=True)
        )
        self._before = now
        twist = [0.5 * (left + right), 0.0, (right - left) / (how.track * m)]
        self._pose = se2.compose(self._pose, se2.exp(twist))
        x, y, theta = self._pose.tolist()
        return x, y, theta


def _since(before: float, now: float, counter: int) -> float:
    """Ticks from one count to the next; a counter goes on from 0, forwards or back."""
    ticks = now - before
    return ticks - counter * round(ticks / counter) if counter else ticks


def _scan(
    number: int, words: list[str], how: RoverFormat, robot: Pose | None, mount: Float
) -> LaserMessage:
    ranges = _ranges(words, how.scan)
    start, step = math.radians(how.scan.start_deg), math.radians(how.scan.step_deg)
    if step < 0.0:
        ranges.reverse()
        start, step = start + (len(ranges) - 1) * step, -step
    if len(ranges) * step > 1.05 * math.tau:
        raise ValueError(f"{len(ranges)} beams {math.degrees(step):g} degrees apart: over one turn")
    laser = None
    if robot is not None:
        x, y, theta = se2.compose(robot, mount).tolist()
        laser = (x, y, theta)
    unit = how.time.unit
    _number(words, how.time.column, "time", MAX_STAMP_S / SI[unit])
    range_max = min(how.scan.range_max * SI[how.scan.unit], MAX_RANGE_M)
    return LaserMessage(
        line=number,
        stamp_ns=_ns(words[how.time.column - 1], SI[unit]),
        ranges=ranges,
        beams=Beams(start_angle=start, increment=step, range_max=range_max),
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


def _ranges(words: list[str], how: Ranges) -> list[float]:
    last = how.first - 1 + how.beams if how.beams else len(words)
    if not how.first <= last <= len(words):
        wanted = f"{how.beams} ranges from" if how.beams else "ranges from"
        raise ValueError(f"{len(words)} columns; expected {wanted} column {how.first}")
    columns = range(how.first, last + 1)
    values = [_range(words, column, how) for column in columns]
    for column, value in zip(columns, values, strict=True):
        if not 0.0 <= value <= MAX_RANGE_M:
            raise ValueError(
                f"range in column {column} must be 0 to {MAX_RANGE_M:g} m, got {value:g} m"
            )
    return values


def _range(words: list[str], column: int, how: Ranges) -> float:
    """m; 0 for a cell that says none, the maximum for inf: no return."""
    word = words[column - 1].strip().lower()
    if word in NOTHING:
        return 0.0
    if word.lstrip("+") in ("inf", "infinity"):
        return min(how.range_max * SI[how.unit], MAX_RANGE_M)
    return _number(words, column, "range") * SI[how.unit]


def _number(words: list[str], column: int, field: str, limit: float = LARGEST) -> float:
    if column > len(words):
        raise ValueError(f"{field}: {len(words)} columns; expected a number in column {column}")
    word = words[column - 1].strip()
    try:
        value = float(word)
    except ValueError:
        value = math.nan
    if not abs(value) <= limit:
        raise ValueError(
            f"{field}: expected a number in column {column}, within +-{limit:g}, got {word[:40]!r}"
        )
    return value

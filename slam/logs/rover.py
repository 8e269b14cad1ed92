# SPDX-License-Identifier: Apache-2.0
"""Text logs of small robots, a line a scan, read by the description of their columns."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from slam import se2
from slam.errors import LogFormatError
from slam.frames import NS_PER_S, Float, Stream
from slam.logs.repairs import Repairs
from slam.logs.rover_format import LARGEST, Poses, RoverFormat, Ticks, read_format
from slam.logs.scan_log import ScanLog, stream_of
from slam.logs.scan_poses import Beams, LaserMessage
from slam.logs.stamps import FINE_DIGITS
from slam.logs.text import (
    MAX_COORDINATE,
    MAX_RANGE_M,
    MAX_STAMP_S,
    Pose,
    about,
    numbered_lines,
)

SCAN = "line"


def read_rover(path: str | Path, text_format: str | Path, *, strict: bool = False) -> Stream:
    """A text log (plain, .gz or .xz) with one scan a line, as ``text_format`` describes it.

    ``text_format`` is a TOML file, see ``slam.logs.rover_format``. Empty lines and those that begin
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

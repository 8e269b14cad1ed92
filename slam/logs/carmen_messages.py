# SPDX-License-Identifier: Apache-2.0
"""The messages of a CARMEN log, one line each, words split by blanks.

Formats as CARMEN's logger writes them (http://carmen.sourceforge.net/logger_playback.html and the
logger's source), lengths in metres, angles in radians, ``t`` in seconds::

    FLASER n r_1 .. r_n  laser x y theta  robot x y theta  t host t_logger
    ROBOTLASER1 type start fov step max accuracy [remission_mode]  n r_1 .. r_n  m i_1 .. i_m
                laser x y theta  robot x y theta  tv rv forward side [turn_axis]  t host t_logger
    RAWLASER1 type start fov step max accuracy [remission_mode]  n r_1 .. r_n  m i_1 .. i_m
                t host t_logger
    ODOM x y theta tv rv accel  t host t_logger
    TRUEPOS true x y theta  odom x y theta  t host t_logger
    PARAM name value ...

Logs of particle filters (GMapping's own, ``.gfs``) write two of them shorter, beside lines about
the filter::

    ODOM x y theta  t
    LASER_READING n r_1 .. r_n  x y theta  t

Ranges count counter-clockwise. ``remission_mode`` came with later versions; ``turn_axis`` is
written but not documented. All parsers raise ``ValueError`` with what was expected.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from decimal import Decimal

from slam.frames import MOST_MOUNT_M, NS_PER_S

MAX_BEAMS = 20_000
MAX_RANGE_M = 1e4
MAX_COORDINATE = 1e6
MAX_REMISSION = 1e30  # single precision holds it
MAX_STAMP_S = 9e9  # what 64-bit nanoseconds hold: year 2255
NAME = re.compile(r"[A-Za-z][\w-]*")
KNOWN_NAMES = tuple(
    [name]
    for name in (
        *("PARAM", "ODOM", "FLASER", "ROBOTLASER1", "RAWLASER1", "RLASER", "TRUEPOS", "SYNC"),
        "LASER_READING",
    )
)
ODOM_WORDS, SHORT_ODOM_WORDS = 10, 5
_GEOMETRY = ("start angle", "field of view", "angular step", "maximum range")

Pose = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Beams:
    """What ROBOTLASER1 and RAWLASER1 say of their scanner: rad, rad, m."""

    start_angle: float
    increment: float
    range_max: float


@dataclass(frozen=True, slots=True)
class LaserMessage:
    """One scan; ``beams`` is None for FLASER, the poses are None for RAWLASER1."""

    line: int
    stamp_ns: int
    ranges: list[float]
    intensities: list[float]
    beams: Beams | None
    laser_pose: Pose | None
    robot_pose: Pose | None


@dataclass(frozen=True, slots=True)
class PoseMessage:
    """ODOM, or the true pose of TRUEPOS."""

    line: int
    stamp_ns: int
    pose: Pose


def parse_flaser(line: int, words: list[str]) -> LaserMessage:
    """``FLASER``, the old format without the scanner's geometry."""
    n = _count(words, 1)
    expected = 2 + n + 6 + 3
    _expect(len(words) == expected, f"FLASER of {n} beams has {expected} words, got {len(words)}")
    return LaserMessage(
        line=line,
        stamp_ns=stamp_ns(words[-3]),
        ranges=_ranges(words[2 : 2 + n]),
        intensities=[],
        beams=None,
        laser_pose=pose_of(words[2 + n : 5 + n], "laser"),
        robot_pose=pose_of(words[5 + n : 8 + n], "robot"),
    )


def parse_robotlaser(line: int, words: list[str]) -> LaserMessage:
    """``ROBOTLASER1``: scan, geometry, pose of laser and of robot."""
    return _parse_laser(line, words, after=(14, 13))


def parse_rawlaser(line: int, words: list[str]) -> LaserMessage:
    """``RAWLASER1``: scan and geometry, no pose."""
    return _parse_laser(line, words, after=(3,))


def parse_laser_reading(line: int, words: list[str]) -> LaserMessage:
    """``LASER_READING``: a scan and the pose by the wheels, in a particle filter's own log."""
    n = _count(words, 1)
    expected = 2 + n + 4
    _expect(
        len(words) == expected, f"LASER_READING of {n} beams has {expected} words, got {len(words)}"
    )
    pose = pose_of(words[2 + n : 5 + n], "robot")
    return LaserMessage(
        line=line,
        stamp_ns=stamp_ns(words[-1]),
        ranges=_ranges(words[2 : 2 + n]),
        intensities=[],
        beams=None,
        laser_pose=pose,
        robot_pose=pose,
    )


def parse_odom(line: int, words: list[str], *, short: bool = False) -> PoseMessage:
    """``ODOM``: pose of the robot by its wheels; ``short``: as particle filters write it."""
    expected = SHORT_ODOM_WORDS if short else ODOM_WORDS
    _expect(len(words) == expected, f"ODOM has {expected} words, got {len(words)}")
    stamp = words[-1] if short else words[-3]
    return PoseMessage(line=line, stamp_ns=stamp_ns(stamp), pose=pose_of(words[1:4], "robot"))


def parse_truepos(line: int, words: list[str]) -> PoseMessage:
    """``TRUEPOS``: pose of the robot by the simulator."""
    _expect(len(words) == 10, f"TRUEPOS has 10 words, got {len(words)}")
    return PoseMessage(line=line, stamp_ns=stamp_ns(words[-3]), pose=pose_of(words[1:4], "robot"))


def parse_param(words: list[str]) -> float:
    """Value of a numeric ``PARAM``."""
    _expect(len(words) >= 3, "PARAM has a name and a value")
    limit = MOST_MOUNT_M if words[1].endswith("_offset") else MAX_COORDINATE
    return number(words[2], f"PARAM {words[1]}", limit)


def number(word: str, field: str, limit: float = MAX_COORDINATE) -> float:
    """A finite number within +-limit; ``field`` is what it is for whoever reads the error."""
    try:
        value = float(word)
    except ValueError:
        value = math.nan
    if not abs(value) <= limit:  # false for NaN too
        raise ValueError(f"{field}: expected a number within +-{limit:g}, got {word[:40]!r}")
    return value


def _parse_laser(line: int, words: list[str], after: tuple[int, ...]) -> LaserMessage:
    """``after``: how many words may follow the remissions, with and without turn_axis."""
    for at in (8, 7):  # of the number of beams, with and without remission_mode
        layout = _layout(words, at, after)
        if layout is not None:
            break
    else:
        raise ValueError(f"{words[0]} of {len(words)} words does not fit its own counts")
    n, n_remissions = layout
    tail = words[at + 2 + n + n_remissions :]
    poses = len(tail) > 3
    return LaserMessage(
        line=line,
        stamp_ns=stamp_ns(words[-3]),
        ranges=_ranges(words[at + 1 : at + 1 + n]),
        intensities=_remissions(words[at + 2 + n : at + 2 + n + n_remissions]),
        beams=_beams(words, n),
        laser_pose=pose_of(tail[:3], "laser") if poses else None,
        robot_pose=pose_of(tail[3:6], "robot") if poses else None,
    )


def _layout(words: list[str], at: int, after: tuple[int, ...]) -> tuple[int, int] | None:
    """Numbers of beams and of remissions, if the line's length agrees with them."""
    try:
        n = _count(words, at)
        n_remissions = int(words[at + 1 + n])
    except (ValueError, IndexError):
        return None
    rest = len(words) - (at + 2 + n + n_remissions)
    return (n, n_remissions) if n_remissions in (0, n) and rest in after else None


def _beams(words: list[str], n: int) -> Beams:
    start, fov, step, range_max = map(number, words[2:6], _GEOMETRY)
    _expect(range_max > 0.0, f"expected a maximum range > 0 m, got {words[5]}")
    _expect(fov > 0.0 or step > 0.0, f"expected a field of view > 0 rad, got {words[3]}")
    increment = step if step > 0.0 else fov / max(n - 1, 1)
    _expect(n * increment <= 2.0 * math.tau, f"{n} beams {increment:g} rad apart: over two turns")
    return Beams(start_angle=start, increment=increment, range_max=min(range_max, MAX_RANGE_M))


def _count(words: list[str], at: int) -> int:
    _expect(len(words) > at, f"{words[0]} ends before its number of beams")
    try:
        n = int(words[at])
    except ValueError:
        n = 0
    if not 1 <= n <= MAX_BEAMS:
        raise ValueError(
            f"number of beams: expected 1 to {MAX_BEAMS} beams, got {words[at][:40]!r}"
        )
    return n


def _ranges(words: list[str]) -> list[float]:
    return [_range(k, word) for k, word in enumerate(words)]


def _range(k: int, word: str) -> float:
    try:
        value = float(word)
    except ValueError:
        value = math.nan
    if not 0.0 <= value <= MAX_RANGE_M:  # false for NaN too
        raise ValueError(f"range {k} must be 0 to {MAX_RANGE_M:g} m, got {word[:40]!r}")
    return value


def _remissions(words: list[str]) -> list[float]:
    return [number(word, f"remission {k}", MAX_REMISSION) for k, word in enumerate(words)]


def pose_of(words: list[str], whose: str) -> Pose:
    """x, y, theta of the robot or of its laser."""
    x, y, theta = (
        number(word, f"{name} of the {whose}")
        for word, name in zip(words, ("x", "y", "theta"), strict=True)
    )
    return x, y, theta


def stamp_ns(word: str) -> int:
    """Exact nanoseconds (``float`` would lose the last digits of Unix times); may be negative."""
    number(word, "time", MAX_STAMP_S)
    try:
        return round(Decimal(word) * NS_PER_S)
    except ArithmeticError as error:  # an exponent of twenty digits
        raise ValueError(f"time: expected a number, got {word[:40]!r}") from error


def _expect(condition: bool, message: str) -> None:
    if not condition:
        raise ValueError(message)

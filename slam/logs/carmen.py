# SPDX-License-Identifier: Apache-2.0
"""Logs of CARMEN, the Carnegie Mellon navigation toolkit: most 2D laser logs before 2014.

One message a line, words split by blanks, as CARMEN's logger writes them
(http://carmen.sourceforge.net/logger_playback.html and the logger's source), lengths in metres,
angles in radians, ``t`` in seconds::

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
written but not documented.
"""

import gzip
import lzma
import math
import re
from collections import Counter
from collections.abc import Iterator
from itertools import islice
from pathlib import Path

import numpy as np

from slam import se2
from slam.errors import InvalidValueError, LogFormatError
from slam.files import replacing
from slam.frames import MOST_MOUNT_M, NS_PER_S, Float, Frame, Scan, Stream
from slam.logs.repairs import SHORT_ODOM, Repairs, digits_of
from slam.logs.scan_log import ScanLog, stream_of
from slam.logs.scan_poses import Beams, LaserMessage, PoseMessage
from slam.logs.text import (
    MAX_BEAMS,
    MAX_COORDINATE,
    MAX_RANGE_M,
    about,
    number,
    numbered_lines,
    pose_of,
    range_of,
    stamp_ns,
    words_of,
)

LASERS = ("ROBOTLASER1", "FLASER", "RAWLASER1", "LASER_READING")  # the first that a log has is read
MAX_REMISSION = 1e30  # single precision holds it
_SHORT = {"FLASER": (6, 3), "LASER_READING": (3, 1)}  # words of poses, and from the time on
_AFTER = {"ROBOTLASER1": (14, 13), "RAWLASER1": (3,)}  # the remissions: words that may follow
_GEOMETRY = ("start angle", "field of view", "angular step", "maximum range")
_POSE_WORDS, _SHORT_ODOM_WORDS = 10, 5
_RANGE_MAX_PARAM, _OFFSET_PARAM = "robot_front_laser_max", "robot_frontlaser_offset"
_NAME = re.compile(r"[A-Za-z][\w-]*")
_KNOWN_NAMES = {*LASERS, "PARAM", "ODOM", "RLASER", "TRUEPOS", "SYNC"}
_LINES_TO_LOOK_AT = 1000
_HOST, _SICK_LMS = "mobilia", 1  # of what is written here; a laser_type of CARMEN


def is_carmen(path: Path) -> bool:
    """True when one of the first thousand lines begins with the name of a CARMEN message."""
    lines = islice(numbered_lines(path, Repairs(path)), _LINES_TO_LOOK_AT)
    return any(_KNOWN_NAMES.intersection(line.split(maxsplit=1)[:1]) for _, line in lines)


def read_carmen(path: str | Path, *, strict: bool = False) -> Stream:
    """A CARMEN text log (plain, .gz or .xz) as frames: its lines of ``LASERS``.

    Odometry is the robot pose in the scan's own line; for RAWLASER1 it is interpolated between
    ODOM lines (scans outside them are dropped and counted). Logs that went through a mapper
    (gfs2log) have ODOM lines that restart from the corrected pose after every scan; there
    ``Frame.truth`` is the corrected pose and the wheel odometry is chained from
    inverse(pose of scan k) * (last ODOM before scan k + 1), exact but for the printed digits.
    In logs whose laser pose is no fixed mount of the robot pose, the laser pose is the corrected
    one. TRUEPOS lines, where there are any, are the truth.

    A particle filter's own log (LASER_READING) has the wheels' pose in the line of the scan, and
    ODOM lines of five words. Where a log of CARMEN has such ODOM lines, all of them must be short:
    they are counted as a repair.

    What is usual in public logs is repaired: a last line without an end is left out; stamps that
    step back by less than 1 s are sorted, equal ones spread by the odometry between them
    (``put_in_order``); a clock that is set back goes on from where it was (``continued``); times
    below 0 that lost their sign in 32 bits get it back (``unwrapped``). One warning says so,
    ``metadata.extra`` counts each, and ``strict`` refuses all.

    Beams of one scan have no times of their own (offsets zero). Ranges at or above the scanner's
    maximum are inf, ranges of 0 are NaN (REP 117). The log is read whole: a damaged line anywhere
    raises ``LogFormatError`` with file, line, field and value.
    """
    path = Path(path)
    repairs = Repairs(path, strict)
    log = _Lines(path)
    for at, words in words_of(path, repairs):
        if not _NAME.fullmatch(words[0]):
            raise LogFormatError(path, f"expected a message name, got {words[0][:40]!r}", at)
        with about(path, line=at):
            log.take(at, words)
    return stream_of(log.whole(repairs), repairs, "carmen")


class _Lines:
    """The messages in the order of the file."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._scans: dict[str, list[LaserMessage]] = {name: [] for name in LASERS}
        self._odom: list[PoseMessage] = []
        self._truth: list[PoseMessage] = []
        self._params: dict[str, float] = {}
        self._ignored: Counter[str] = Counter()
        self._digits = 1
        self._short_odom: bool | None = None  # whether ODOM lines are, as the first of them says

    def take(self, line: int, words: list[str]) -> None:
        """One message; raises ``ValueError`` with what was expected."""
        name = words[0]
        if name in _SHORT:
            self._scans[name].append(_short_scan(line, words, *_SHORT[name]))
            self._timed(words[-_SHORT[name][1]])
        elif name in _AFTER:
            self._scans[name].append(_whole_scan(line, words, _AFTER[name]))
            self._timed(words[-3])
        elif name == "ODOM":
            short = self._odom_is_short(words)
            self._odom.append(_pose(line, words, short=short))
            self._timed(words[-1 if short else -3])
        elif name == "TRUEPOS":
            self._truth.append(_pose(line, words))
        elif name == "PARAM" and words[1:2] and words[1] in (_RANGE_MAX_PARAM, _OFFSET_PARAM):
            _expect(len(words) >= 3, "PARAM has a name and a value")
            limit = MOST_MOUNT_M if words[1] == _OFFSET_PARAM else MAX_COORDINATE
            self._params[words[1]] = number(words[2], f"PARAM {words[1]}", limit)
        else:
            self._ignored[name] += 1

    def _timed(self, word: str) -> None:
        self._digits = max(self._digits, digits_of(word))

    def _odom_is_short(self, words: list[str]) -> bool:
        """Whether ODOM lines are: as the first one says, which is damaged if it alone is short."""
        if self._short_odom is None:
            self._short_odom = len(words) == _SHORT_ODOM_WORDS
        elif self._short_odom and len(self._odom) == 1 and len(words) == _POSE_WORDS:
            why = f"ODOM has {_POSE_WORDS} words, got {_SHORT_ODOM_WORDS}"
            raise LogFormatError(self._path, why, self._odom[0].line)
        return self._short_odom

    def whole(self, repairs: Repairs) -> ScanLog:
        """The scans of the first of ``LASERS`` that there is, with all that belongs to them."""
        name = next((kind for kind in LASERS if self._scans[kind]), None)
        if name is None:
            raise LogFormatError(self._path, f"no scan found (none of {', '.join(LASERS)})")
        if self._short_odom and name != "LASER_READING":
            why = f"ODOM lines have {_SHORT_ODOM_WORDS} words (x y theta t), not {_POSE_WORDS}"
            repairs.note(SHORT_ODOM, why, self._odom[0].line, len(self._odom))
        self._ignored.update({k: len(v) for k, v in self._scans.items() if v and k != name})
        return ScanLog(
            path=self._path,
            message=name,
            scans=self._scans[name],
            odom=self._odom,
            truth=self._truth,
            ignored=self._ignored,
            digits=self._digits,
            mount=np.array([self._params.get(_OFFSET_PARAM, 0.0), 0.0, 0.0]),
            mounted=f"PARAM {_OFFSET_PARAM}" if _OFFSET_PARAM in self._params else "",
            range_max=self._params.get(_RANGE_MAX_PARAM, 0.0),
        )


def _short_scan(line: int, words: list[str], of_poses: int, of_time: int) -> LaserMessage:
    """A scan without geometry: its first pose is the laser's, its last the robot's."""
    name, n = words[0], _count(words, 1)
    expected = 2 + n + of_poses + of_time
    _expect(len(words) == expected, f"{name} of {n} beams has {expected} words, got {len(words)}")
    poses = words[2 + n : 2 + n + of_poses]
    laser = pose_of(poses[:3], "laser" if of_poses > 3 else "robot")
    return LaserMessage(
        line=line,
        stamp_ns=stamp_ns(words[-of_time]),
        ranges=[range_of(word, k) for k, word in enumerate(words[2 : 2 + n])],
        laser_pose=laser,
        robot_pose=pose_of(poses[-3:], "robot"),
    )


def _whole_scan(line: int, words: list[str], after: tuple[int, ...]) -> LaserMessage:
    """With geometry; ``after``: how many words may follow the remissions, by turn_axis."""
    for at in (8, 7):  # of the number of beams, with and without remission_mode
        layout = _layout(words, at, after)
        if layout is not None:
            break
    else:
        raise ValueError(f"{words[0]} of {len(words)} words does not fit its own counts")
    n, n_remissions = layout
    remissions, tail = words[at + 2 + n :][:n_remissions], words[at + 2 + n + n_remissions :]
    poses = len(tail) > 3
    return LaserMessage(
        line=line,
        stamp_ns=stamp_ns(words[-3]),
        ranges=[range_of(word, k) for k, word in enumerate(words[at + 1 : at + 1 + n])],
        intensities=[
            number(word, f"remission {k}", MAX_REMISSION) for k, word in enumerate(remissions)
        ],
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
    why = f"number of beams: expected 1 to {MAX_BEAMS} beams, got {words[at][:40]!r}"
    _expect(1 <= n <= MAX_BEAMS, why)
    return n


def _pose(line: int, words: list[str], *, short: bool = False) -> PoseMessage:
    """ODOM, by the wheels, or TRUEPOS, by the simulator; ``short`` as particle filters write it."""
    expected = _SHORT_ODOM_WORDS if short else _POSE_WORDS
    _expect(len(words) == expected, f"{words[0]} has {expected} words, got {len(words)}")
    at = stamp_ns(words[-1 if short else -3])
    return PoseMessage(line=line, stamp_ns=at, pose=pose_of(words[1:4], "robot"))


def _expect(condition: bool, message: str) -> None:
    if not condition:
        raise ValueError(message)


def write_carmen(path: str | Path, stream: Stream) -> None:
    """ODOM, ROBOTLASER1 and, where there is truth, TRUEPOS per frame; .gz and .xz by suffix.

    ``read_carmen`` gives the same frames back, up to what the format has no word for: beam times,
    labels, odometry covariance and twist, the shortest range. No return (inf) is written as the
    scanner's maximum range and an error code (NaN) as 0, as CARMEN's drivers do.
    Raises ``InvalidValueError`` for a frame without a scan, ``OutputError`` when the file cannot be
    written; in both cases nothing is left behind.
    """
    path = Path(path)
    lines = (line.encode("ascii") for line in _written(stream))
    with replacing(path) as temporary:
        if path.suffix == ".xz":
            with lzma.open(temporary, "wb") as xz_file:
                xz_file.writelines(lines)
            return
        with temporary.open("wb") as file:
            if path.suffix == ".gz":  # no time and no name: the same stream, the same bytes
                with gzip.GzipFile("", "wb", 6, file, mtime=0) as gz_file:
                    gz_file.writelines(lines)
            else:
                file.writelines(lines)


def _written(stream: Stream) -> Iterator[str]:
    yield "# CARMEN Logfile\n# file format is one message per line\n"
    yield "# message_name [message contents] ipc_timestamp ipc_hostname logger_timestamp\n"
    start_ns: int | None = None
    for k, frame in enumerate(stream):
        if frame.scan is None:
            raise InvalidValueError(f"frame {k} has no scan: CARMEN logs hold only scans")
        start_ns = frame.stamp_ns if start_ns is None else start_ns
        end = f"{_seconds(frame.stamp_ns)} {_HOST} {_seconds(frame.stamp_ns - start_ns)}\n"
        pose = _words(frame.odometry.T_odom_robot)
        yield f"ODOM {pose} 0 0 0 {end}"
        if frame.truth is not None:
            yield f"TRUEPOS {_words(frame.truth)} {pose} {end}"
        yield f"{_robotlaser(frame, frame.scan)} {end}"


def _robotlaser(frame: Frame, scan: Scan) -> str:
    spec = scan.spec
    fov = (spec.n_beams - 1) * spec.angle_increment
    ranges = np.where(np.isnan(scan.ranges), np.float32(0.0), scan.ranges)
    written = [str(r) if math.isfinite(r) else repr(spec.range_max) for r in ranges]
    intensities = () if scan.intensities is None else np.nan_to_num(scan.intensities)
    T_odom_robot = frame.odometry.T_odom_robot
    words = [
        f"ROBOTLASER1 {_SICK_LMS} {spec.angle_min!r} {fov!r} {spec.angle_increment!r}",
        f"{spec.range_max!r} 0.01 0",
        f"{spec.n_beams} {' '.join(written)}",
        " ".join([str(len(intensities)), *map(str, intensities)]),
        _words(se2.compose(T_odom_robot, spec.T_robot_laser)),
        _words(T_odom_robot),
        "0 0 0 0 0",
    ]
    return " ".join(words)


def _words(pose: Float) -> str:
    return " ".join(map(repr, pose.tolist()))


def _seconds(stamp_ns: int) -> str:
    sign = "-" if stamp_ns < 0 else ""
    whole, nanoseconds = divmod(abs(stamp_ns), NS_PER_S)
    return f"{sign}{whole}.{nanoseconds:09d}"

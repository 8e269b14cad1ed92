# SPDX-License-Identifier: Apache-2.0
"""Logs of CARMEN, the Carnegie Mellon navigation toolkit: most 2D laser logs before 2014."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slam.constant_velocity import standing
from slam.errors import LogFormatError
from slam.frames import Float, Frame, LaserSpec, Odometry, Scan, Stream, StreamMetadata
from slam.logs import carmen_messages as messages
from slam.logs.border import about
from slam.logs.carmen_clock import Clock, rough_steps
from slam.logs.carmen_messages import LaserMessage, PoseMessage
from slam.logs.carmen_poses import ScanPoses, at_rest, scan_poses
from slam.logs.repairs import NO_ODOMETRY, SHORT_ODOM, Repairs
from slam.logs.saturation import saturated_from
from slam.logs.stamps import Ordered, digits_of, put_in_order
from slam.logs.text import numbered_lines

_STAMPED = ("FLASER", "ROBOTLASER1", "RAWLASER1", "LASER_READING", "ODOM")
LASERS = ("ROBOTLASER1", "FLASER", "RAWLASER1", "LASER_READING")  # the first that a log has is read
DEFAULT_RANGE_MAX_M = 80.0  # CARMEN's own guess for FLASER
_RANGE_MAX_PARAM = "robot_front_laser_max"
_OFFSET_PARAM = "robot_frontlaser_offset"


@dataclass
class Log:
    """The messages in the order of the file."""

    path: Path
    scans: dict[str, list[LaserMessage]] = field(default_factory=lambda: {k: [] for k in LASERS})
    odom: list[PoseMessage] = field(default_factory=list)
    truth: list[PoseMessage] = field(default_factory=list)
    params: dict[str, float] = field(default_factory=dict)
    ignored: Counter[str] = field(default_factory=Counter)
    digits: int = 1  # significant ones, of the stamp that has most
    short_odom: bool | None = None  # whether ODOM lines have no speeds; as the first of them says
    wheels: bool = True  # False: a log without odometry is none that is damaged
    mount: Float | None = None  # of the laser on the robot; None: as far ahead as a PARAM says


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
    repairs = Repairs(Path(path), strict)
    log = _read(Path(path), repairs)
    name = next((kind for kind in LASERS if log.scans[kind]), None)
    if name is None:
        raise LogFormatError(path, f"no scan found (none of {', '.join(LASERS)})")
    if log.short_odom and name != "LASER_READING":
        why = "ODOM lines have 5 words (x y theta t), not 10"
        repairs.note(SHORT_ODOM, why, log.odom[0].line, len(log.odom))
    for other in LASERS:
        if other != name and log.scans[other]:
            log.ignored[other] += len(log.scans[other])
    return stream_of(log, name, repairs, "carmen")


def stream_of(log: Log, name: str, repairs: Repairs, source: str) -> Stream:
    """The scans of one kind of message with their poses, on one clock, as frames."""
    scans = log.scans[name]
    _check_one_scanner(log.path, scans)
    clock = Clock(scans, (log.odom, log.truth), repairs, log.digits)
    scans, odom = clock(scans), clock(log.odom)
    mount = log.mount
    if mount is None:
        mount = np.array([log.params.get(_OFFSET_PARAM, 0.0), 0.0, 0.0])
    wheels = log.wheels or any(scan.robot_pose is not None for scan in scans) or bool(odom)
    if wheels:
        poses = scan_poses(log.path, scans, odom, clock(log.truth), mount)
    else:
        poses = at_rest(scans, mount)
        repairs.note(NO_ODOMETRY, "the log has no odometry", None, len(scans))
    ordered = put_in_order(
        log.path,
        [s.stamp_ns for s in scans],
        [s.line for s in scans],
        repairs=repairs,
        steps_s=rough_steps(scans, odom),
        digits=log.digits,
    )
    ranges, range_max, range_max_source = _ranges(log, scans)
    with about(log.path, line=scans[0].line):
        spec = _spec(scans[0], range_max, poses.T_robot_laser)
    frames = _frames(log.path, scans, ordered, ranges, spec, poses)
    if not wheels:
        frames = [_without_wheels(frame, before) for before, frame in pairwise([None, *frames])]
    if not frames:
        raise LogFormatError(log.path, "no scan lies within the time of the ODOM lines")
    repairs.warn()
    extra: dict[str, Any] = {
        "file": log.path.name,
        "message": name,
        "odometry": poses.odometry_source,
        **repairs.facts(),
        "scans_without_odometry": len(scans) - len(frames),
        "range_max_m": range_max,
        "range_max_source": range_max_source,
        "ranges_at_max": int(np.isposinf(ranges).sum()),
        "ranges_zero": int(np.isnan(ranges).sum()),
        "ignored": dict(sorted(log.ignored.items())),
    }
    metadata = StreamMetadata(
        source=source, laser=spec, truth=poses.truth_source, odometry=wheels, extra=extra
    )
    return Stream(metadata=metadata, frames=lambda: frames, length=len(frames))


def _without_wheels(frame: Frame | None, before: Frame | None) -> Frame:
    """The odometry of one that may have moved anywhere since."""
    assert frame is not None
    since = None if before is None else before.stamp_ns
    return replace(frame, odometry=standing(frame.stamp_ns, since))


def _read(path: Path, repairs: Repairs) -> Log:
    log = Log(path)
    for number, line in numbered_lines(path, repairs):
        words = line.split()
        if not words or words[0].startswith("#"):
            continue
        if not messages.NAME.fullmatch(words[0]):
            raise LogFormatError(path, f"expected a message name, got {words[0][:40]!r}", number)
        try:
            _take(log, number, words)
            if words[0] in _STAMPED:
                log.digits = max(log.digits, digits_of(words[_stamp_at(log, words[0])]))
        except ValueError as error:
            raise LogFormatError(path, str(error), number) from error
    return log


def _stamp_at(log: Log, name: str) -> int:
    """Where the time is in the line of a message."""
    bare = name == "LASER_READING" or (name == "ODOM" and log.short_odom)
    return -1 if bare else -3


def _take(log: Log, number: int, words: list[str]) -> None:
    match words[0]:
        case "FLASER":
            log.scans["FLASER"].append(messages.parse_flaser(number, words))
        case "ROBOTLASER1":
            log.scans["ROBOTLASER1"].append(messages.parse_robotlaser(number, words))
        case "RAWLASER1":
            log.scans["RAWLASER1"].append(messages.parse_rawlaser(number, words))
        case "LASER_READING":
            log.scans["LASER_READING"].append(messages.parse_laser_reading(number, words))
        case "ODOM":
            log.odom.append(messages.parse_odom(number, words, short=_odom_is_short(log, words)))
        case "TRUEPOS":
            log.truth.append(messages.parse_truepos(number, words))
        case "PARAM" if len(words) > 1 and words[1] in (_RANGE_MAX_PARAM, _OFFSET_PARAM):
            log.params[words[1]] = messages.parse_param(words)
        case ignored:
            log.ignored[ignored] += 1


def _odom_is_short(log: Log, words: list[str]) -> bool:
    """Whether ODOM lines are: as the first one says, which is damaged if it alone is short."""
    if log.short_odom is None:
        log.short_odom = len(words) == messages.SHORT_ODOM_WORDS
    elif log.short_odom and len(log.odom) == 1 and len(words) == messages.ODOM_WORDS:
        why = f"ODOM has {messages.ODOM_WORDS} words, got {messages.SHORT_ODOM_WORDS}"
        raise LogFormatError(log.path, why, log.odom[0].line)
    return log.short_odom


def _check_one_scanner(path: Path, scans: list[LaserMessage]) -> None:
    first = scans[0]
    for scan in scans:
        if len(scan.ranges) != len(first.ranges):
            raise LogFormatError(
                path,
                f"the number of beams changes from {len(first.ranges)} to {len(scan.ranges)}",
                scan.line,
            )
        if scan.beams != first.beams:
            raise LogFormatError(
                path, f"the scanner changes from {first.beams} to {scan.beams}", scan.line
            )


def _ranges(log: Log, scans: list[LaserMessage]) -> tuple[Float, float, str]:
    """(k, n) ranges with inf and NaN put in, the range limit in m and where it came from."""
    ranges = np.array([scan.ranges for scan in scans])
    first = scans[0]
    if first.beams is not None:
        limit, source = first.beams.range_max, "scan message"
    elif log.params.get(_RANGE_MAX_PARAM, 0.0) > 0.0:
        limit, source = log.params[_RANGE_MAX_PARAM], "PARAM"
    else:
        limit, source = DEFAULT_RANGE_MAX_M, "default"
    code = saturated_from(ranges)
    if code is not None and (source == "default" or 0.95 * limit < code < limit):
        limit, source = code, "readings that say no return"
    ranges[ranges >= limit] = math.inf
    ranges[ranges == 0.0] = math.nan
    return ranges, limit, source


def _spec(first: LaserMessage, range_max: float, T_robot_laser: Float) -> LaserSpec:
    n = len(first.ranges)
    if first.beams is not None:
        start, increment = first.beams.start_angle, first.beams.increment
    else:
        start, increment = _flaser_angles(n)
    return LaserSpec(
        n_beams=n,
        angle_min=start,
        angle_increment=increment,
        range_max=range_max,
        T_robot_laser=T_robot_laser,
    )


def _flaser_angles(n: int) -> tuple[float, float]:
    """First angle and step of an old FLASER, as CARMEN guesses them from the number of beams."""
    degrees = {180: 1.0, 181: 1.0, 360: 0.5, 361: 0.5, 400: 0.25, 401: 0.25}
    start = -50.0 if n in (400, 401) else -90.0
    return math.radians(start), math.radians(degrees.get(n, 180.0 / max(n - 1, 1)))


def _frames(
    path: Path,
    scans: list[LaserMessage],
    ordered: Ordered,
    ranges: Float,
    spec: LaserSpec,
    poses: ScanPoses,
) -> list[Frame]:
    frames = []
    for k, stamp_ns in zip(ordered.order, ordered.stamps_ns, strict=True):
        T_odom_robot = poses.odometry[k]
        if T_odom_robot is None:
            continue
        with about(path, line=scans[k].line):
            scan = _scan(scans[k], stamp_ns, ranges[k], spec)
            odometry = Odometry(stamp_ns=stamp_ns, T_odom_robot=T_odom_robot)
            frames.append(
                Frame(stamp_ns=stamp_ns, odometry=odometry, scan=scan, truth=poses.truth[k])
            )
    return frames


def _scan(message: LaserMessage, stamp_ns: int, ranges: Float, spec: LaserSpec) -> Scan:
    intensities: NDArray[np.float32] | None = None
    if message.intensities:
        intensities = np.array(message.intensities, dtype=np.float32)
    return Scan(
        stamp_ns=stamp_ns, ranges=ranges.astype(np.float32), spec=spec, intensities=intensities
    )

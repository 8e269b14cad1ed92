# SPDX-License-Identifier: Apache-2.0
"""Plain ``L``/``O`` logs in centimetres: what CARMEN's forerunners wrote, and courses still use.

One message a line, lengths in cm, angles in rad, ``t`` in s from the start::

    O x y theta t
    L x y theta  laser x y theta  r_1 .. r_n  t

``L`` is a scan with the poses of the robot and of its laser by odometry; ranges count
counter-clockwise over the half circle ahead.
"""

from contextlib import suppress
from itertools import islice
from pathlib import Path

from slam.errors import LogFormatError
from slam.frames import Stream
from slam.logs.repairs import Repairs, digits_of
from slam.logs.scan_log import ScanLog, stream_of
from slam.logs.scan_poses import LaserMessage, PoseMessage
from slam.logs.text import (
    MAX_BEAMS,
    MAX_RANGE_M,
    Pose,
    about,
    number,
    numbered_lines,
    pose_of,
    stamp_ns,
    words_of,
)

_CM = 0.01
_POSES = 8  # words of an L line that are no ranges
_LINES_TO_LOOK_AT = 100
SCAN, ODOM = "L", "O"


def is_centimetre(path: Path) -> bool:
    """Whether one of the first lines is an ``L`` or ``O`` followed by numbers."""
    for _, line in islice(numbered_lines(path, Repairs(path)), _LINES_TO_LOOK_AT):
        words = line.split()
        with suppress(ValueError):
            if words[:1] in ([SCAN], [ODOM]) and len([number(w, "") for w in words[1:5]]) == 4:
                return True
    return False


def read_centimetre(path: str | Path, *, strict: bool = False) -> Stream:
    """A log of ``L`` and ``O`` lines (plain, .gz or .xz) as frames, in metres.

    Odometry is the robot's pose in the scan's own line, the mount of the laser that between its two
    poses. Repairs, ``strict`` and errors are those of ``read_carmen``.
    """
    path = Path(path)
    repairs = Repairs(path, strict)
    scans: list[LaserMessage] = []
    odom: list[PoseMessage] = []
    digits = 1
    for at, words in words_of(path, repairs):
        with about(path, line=at):
            if words[0] == SCAN:
                scans.append(_scan(at, words))
            elif words[0] == ODOM:
                odom.append(_odom(at, words))
            else:
                raise ValueError(f"expected {SCAN} or {ODOM}, got {words[0][:40]!r}")
        digits = max(digits, digits_of(words[-1]))
    if not scans:
        raise LogFormatError(path, f"no scan found (no {SCAN} line)")
    log = ScanLog(path=path, message=SCAN, scans=scans, odom=odom, digits=digits)
    return stream_of(log, repairs, "carmen-centimetres")


def _scan(line: int, words: list[str]) -> LaserMessage:
    n = len(words) - _POSES
    if not 1 <= n <= MAX_BEAMS:
        raise ValueError(
            f"L of {len(words)} words; expected L, six words of poses, 1 to {MAX_BEAMS} ranges "
            "and a time"
        )
    ranges = [number(word, f"range {k}") * _CM for k, word in enumerate(words[7:-1])]
    for k, value in enumerate(ranges):
        if not 0.0 <= value <= MAX_RANGE_M:
            most = f"{MAX_RANGE_M / _CM:g} cm"
            raise ValueError(f"range {k}: ranges must be 0 to {most}, got {words[7 + k]}")
    return LaserMessage(
        line=line,
        stamp_ns=stamp_ns(words[-1]),
        ranges=ranges,
        laser_pose=_pose(words[4:7], "laser"),
        robot_pose=_pose(words[1:4], "robot"),
    )


def _odom(line: int, words: list[str]) -> PoseMessage:
    if len(words) != 5:
        raise ValueError(f"O has 5 words, got {len(words)}")
    at = stamp_ns(words[-1])
    return PoseMessage(line=line, stamp_ns=at, pose=_pose(words[1:4], "robot"))


def _pose(words: list[str], whose: str) -> Pose:
    x, y, theta = pose_of(words, whose)
    return x * _CM, y * _CM, theta

# SPDX-License-Identifier: Apache-2.0
"""Plain ``L``/``O`` logs in centimetres: what CARMEN's forerunners wrote, and courses still use.

One message a line, lengths in cm, angles in rad, ``t`` in s from the start::

    O x y theta t
    L x y theta  laser x y theta  r_1 .. r_n  t

``L`` is a scan with the poses of the robot and of its laser by odometry; ranges count
counter-clockwise over the half circle ahead.
"""

from __future__ import annotations

from itertools import islice
from pathlib import Path

from slam.errors import LogFormatError
from slam.frames import Stream
from slam.logs import carmen_messages as messages
from slam.logs.carmen import Log, stream_of
from slam.logs.carmen_messages import LaserMessage, Pose, PoseMessage
from slam.logs.repairs import Repairs
from slam.logs.stamps import digits_of
from slam.logs.text import numbered_lines

_CM = 0.01
_POSES = 8  # words of an L line that are no ranges
_LINES_TO_LOOK_AT = 100
SCAN, ODOM = "L", "O"


def is_centimetre(path: Path) -> bool:
    """Whether one of the first lines is an ``L`` or ``O`` followed by numbers."""
    for _, line in islice(numbered_lines(path, Repairs(path)), _LINES_TO_LOOK_AT):
        words = line.split()
        known = words[:1] in ([SCAN], [ODOM]) and len(words) >= 5
        if known and all(map(_is_number, words[1:5])):
            return True
    return False


def read_centimetre(path: str | Path, *, strict: bool = False) -> Stream:
    """A log of ``L`` and ``O`` lines (plain, .gz or .xz) as frames, in metres.

    Odometry is the robot's pose in the scan's own line, the mount of the laser that between its two
    poses. Repairs, ``strict`` and errors are those of ``read_carmen``.
    """
    repairs = Repairs(Path(path), strict)
    log = Log(Path(path), scans={SCAN: []})
    for number, line in numbered_lines(log.path, repairs):
        words = line.split()
        if not words or words[0].startswith("#"):
            continue
        try:
            if words[0] == SCAN:
                log.scans[SCAN].append(_scan(number, words))
            elif words[0] == ODOM:
                log.odom.append(_odom(number, words))
            else:
                raise ValueError(f"expected {SCAN} or {ODOM}, got {words[0][:40]!r}")
        except ValueError as error:
            raise LogFormatError(log.path, str(error), number) from error
        log.digits = max(log.digits, digits_of(words[-1]))
    if not log.scans[SCAN]:
        raise LogFormatError(path, f"no scan found (no {SCAN} line)")
    return stream_of(log, SCAN, repairs, "carmen-centimetres")


def _scan(line: int, words: list[str]) -> LaserMessage:
    n = len(words) - _POSES
    if not 1 <= n <= messages.MAX_BEAMS:
        raise ValueError(
            f"L of {len(words)} words; expected L, six words of poses, 1 to {messages.MAX_BEAMS} "
            "ranges and a time"
        )
    ranges = [messages.number(word, f"range {k}") * _CM for k, word in enumerate(words[7:-1])]
    for k, value in enumerate(ranges):
        if not 0.0 <= value <= messages.MAX_RANGE_M:
            raise ValueError(
                f"range {k}: ranges must be 0 to {messages.MAX_RANGE_M / _CM:g} cm, "
                f"got {words[7 + k]}"
            )
    return LaserMessage(
        line=line,
        stamp_ns=messages.stamp_ns(words[-1]),
        ranges=ranges,
        intensities=[],
        beams=None,
        laser_pose=_pose(words[4:7], "laser"),
        robot_pose=_pose(words[1:4], "robot"),
    )


def _odom(line: int, words: list[str]) -> PoseMessage:
    if len(words) != 5:
        raise ValueError(f"O has 5 words, got {len(words)}")
    stamp_ns = messages.stamp_ns(words[-1])
    return PoseMessage(line=line, stamp_ns=stamp_ns, pose=_pose(words[1:4], "robot"))


def _pose(words: list[str], whose: str) -> Pose:
    x, y, theta = messages.pose_of(words, whose)
    return x * _CM, y * _CM, theta


def _is_number(word: str) -> bool:
    try:
        messages.number(word, "")
    except ValueError:
        return False
    return True

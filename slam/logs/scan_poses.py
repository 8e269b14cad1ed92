# SPDX-License-Identifier: Apache-2.0
"""Messages of scans and of poses: one clock for all of them, and where each scan was taken."""

import bisect
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np

from slam import se2
from slam.errors import LogFormatError
from slam.frames import Float
from slam.logs.repairs import STAMPS_SPREAD, Repairs, continued, put_in_order, unwrapped
from slam.logs.text import Pose

MOUNT_TOLERANCE = 5e-3  # m, rad: six printed digits of a coordinate in the hundreds
ODOM_S = 0.16  # between two ODOM lines, as in the public logs of a B21 (Intel, FHW, CSAIL)
SPEED, TURN = 0.5, 0.5  # m/s, rad/s: of an indoor robot that moves, where nothing else is known
LEAST_S = 0.1  # between scans that were kept although the robot stood
MESSAGE_S = 0.05  # between any two lines of a log of scans at the full rate


@dataclass(frozen=True, slots=True)
class Beams:
    """What a message says of its scanner: rad, rad, m."""

    start_angle: float
    increment: float
    range_max: float


@dataclass(frozen=True, slots=True, kw_only=True)
class LaserMessage:
    """One scan, with what its message says of the scanner and of the poses; None for nothing."""

    line: int
    stamp_ns: int
    ranges: list[float]
    intensities: Sequence[float] = ()
    beams: Beams | None = None
    laser_pose: Pose | None = None
    robot_pose: Pose | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class PoseMessage:
    """A pose of the robot, by its wheels or as it truly was."""

    line: int
    stamp_ns: int
    pose: Pose


@dataclass(frozen=True, kw_only=True)
class ScanPoses:
    """Per scan in the order of the file: odometry, truth or None, and where they came from."""

    odometry: list[Float | None]
    odometry_source: str
    T_robot_laser: Float
    truth: list[Float | None]
    truth_source: str = ""
    wheels: bool = True
    mount_in_scans: bool = False


def scan_poses(
    path: Path,
    scans: list[LaserMessage],
    odom: list[PoseMessage],
    true_poses: list[PoseMessage],
    mount: Float,
) -> ScanPoses:
    """Poses per scan; ``mount`` (3,) m, m, rad of the laser on the robot, unless the scans say.

    Raises ``LogFormatError`` when there is no odometry at all.
    """
    truth: list[Float | None] = [None] * len(scans)
    truth_source = ""
    if true_poses:
        truth, truth_source = _interpolated(path, true_poses, scans), "TRUEPOS of the log"
    robot = [scan.robot_pose for scan in scans if scan.robot_pose is not None]
    laser = [scan.laser_pose for scan in scans if scan.laser_pose is not None]
    corrected: list[Float] = []  # by a mapper
    fixed: Float | None = None
    if not robot:
        if not odom:
            raise LogFormatError(path, "its scans have no pose and the log has no ODOM lines")
        odometry = _interpolated(path, odom, scans)
        source = "interpolated between ODOM lines"
    elif (last_before := _chain(scans, odom)) is not None:
        odometry = list(_recover_odometry(robot, last_before))
        source = "recovered from ODOM lines chained on corrected poses"
        corrected = [np.array(p) for p in robot]
    else:
        odometry, source = [np.array(p) for p in robot], "robot pose of the scan"
        fixed = _fixed_mount(robot, laser)
        if fixed is None:
            corrected = [se2.compose(p, se2.inverse(mount)) for p in laser]
        elif np.abs(fixed).max() > 1e-9:
            mount = fixed
    if corrected and not truth_source:
        truth, truth_source = list(corrected), "corrected poses of the log"
    return ScanPoses(
        odometry=odometry,
        odometry_source=source,
        T_robot_laser=mount,
        truth=truth,
        truth_source=truth_source,
        mount_in_scans=fixed is not None,
    )


def at_rest(scans: list[LaserMessage], mount: Float) -> ScanPoses:
    """Of a log without odometry."""
    return ScanPoses(
        odometry=[np.zeros(3) for _ in scans],
        odometry_source="none: constant velocity",
        T_robot_laser=mount,
        truth=[None] * len(scans),
        wheels=False,
    )


def _chain(scans: list[LaserMessage], odom: list[PoseMessage]) -> list[Pose | None] | None:
    """The last ODOM pose before each scan if ODOM restarts from the scans' poses, else None.

    It does when, for nine of ten scans, the first ODOM after the scan repeats its pose although the
    last one before it (since the previous scan) did not: a standing robot proves nothing.
    """
    before: list[Pose | None] = []
    informative = repeats = at = 0
    previous_line = 0
    for scan in scans:
        while at < len(odom) and odom[at].line < scan.line:
            at += 1
        found = at > 0 and odom[at - 1].line > previous_line
        last = odom[at - 1].pose if found else None
        before.append(last)
        previous_line = scan.line
        if scan.robot_pose is None or at == len(odom) or last is None:
            continue
        if not _same(last, scan.robot_pose):
            informative += 1
            repeats += _same(odom[at].pose, scan.robot_pose)
    return before if repeats > 0 and repeats >= 0.9 * informative else None


def _recover_odometry(robot: list[Pose], last_before: list[Pose | None]) -> list[Float]:
    """Chained from the first corrected pose; a scan without ODOM since the last stands still."""
    T_odom_robot = np.array(robot[0])
    out = [T_odom_robot]
    for k in range(1, len(robot)):
        last = last_before[k]
        if last is not None:
            T_odom_robot = se2.compose(T_odom_robot, se2.between(robot[k - 1], last))
        out.append(T_odom_robot)
    return out


def _same(a: Pose, b: Pose) -> bool:
    return max(abs(a[0] - b[0]), abs(a[1] - b[1]), abs(se2.wrap(a[2] - b[2]))) < 1e-6


def _fixed_mount(robot: list[Pose], laser: list[Pose]) -> Float | None:
    """The laser's pose on the robot, or None when it moves (so it is a corrected pose)."""
    mounts = np.array([se2.between(r, s) for r, s in zip(robot, laser, strict=True)])
    first: Float = mounts[0]
    difference = mounts - first
    difference[:, 2] = se2.wrap_array(difference[:, 2])
    return first if np.abs(difference).max() <= MOUNT_TOLERANCE else None


def _interpolated(
    path: Path, track: list[PoseMessage], scans: list[LaserMessage]
) -> list[Float | None]:
    """Poses of ``track`` at the scans' stamps, None outside its time."""
    ordered = put_in_order(path, [p.stamp_ns for p in track], [p.line for p in track])
    stamps = np.array([track[k].stamp_ns for k in ordered.order], dtype=np.int64)
    poses = [track[k].pose for k in ordered.order]
    out: list[Float | None] = []
    for scan in scans:
        right = int(np.searchsorted(stamps, scan.stamp_ns, side="left"))
        if right < len(stamps) and stamps[right] == scan.stamp_ns:
            out.append(np.array(poses[right]))
        elif 0 < right < len(stamps):
            left_ns, right_ns = int(stamps[right - 1]), int(stamps[right])
            fraction = (scan.stamp_ns - left_ns) / (right_ns - left_ns)
            out.append(se2.interpolate(poses[right - 1], poses[right], fraction))
        else:
            out.append(None)
    return out


Message = LaserMessage | PoseMessage


def on_one_clock(
    scans: list[LaserMessage],
    others: tuple[list[PoseMessage], list[PoseMessage]],
    repairs: Repairs,
    digits: int,
) -> tuple[list[LaserMessage], list[PoseMessage], list[PoseMessage]]:
    """The messages with their stamps put right; ``digits`` that these were printed with.

    Steps back of 1 s or more show best in the sequence of all messages: scans that a mapper kept
    lie seconds apart.
    """
    odom, truth = others
    both: list[Message] = [*scans, *odom, *truth]
    both.sort(key=lambda m: m.line)
    kept = both[:1] + [m for before, m in pairwise(both) if not _echo(before, m)]
    lines = [m.line for m in kept]
    stamps = unwrapped([m.stamp_ns for m in kept], lines, repairs)
    stamps = continued(stamps, lines, repairs, digits)
    equal = sum(a.stamp_ns == b.stamp_ns for a, b in pairwise(scans))
    if equal and scans[0].robot_pose is None:  # odometry is interpolated to the scans' times
        steps = [MESSAGE_S] * (len(kept) - 1)
        ordered = put_in_order(repairs.path, stamps, lines, steps_s=steps, digits=digits)
        repairs.note(STAMPS_SPREAD, f"{equal} scans have the time of another", None, equal)
        kept = [kept[k] for k in ordered.order]
        stamps = ordered.stamps_ns
    now = {m.line: at for m, at in zip(kept, stamps, strict=True) if m.stamp_ns != at}
    if not now:
        return scans, odom, truth
    return (
        [replace(m, stamp_ns=now.get(m.line, m.stamp_ns)) for m in scans],
        [replace(m, stamp_ns=now.get(m.line, m.stamp_ns)) for m in odom],
        [replace(m, stamp_ns=now.get(m.line, m.stamp_ns)) for m in truth],
    )


def _echo(before: Message, message: Message) -> bool:
    """A mapper's corrected pose once more, right after its scan: its time is none of a clock."""
    return (
        isinstance(before, LaserMessage)
        and isinstance(message, PoseMessage)
        and message.pose == before.robot_pose
    )


def rough_steps(scans: Sequence[LaserMessage], odom: Sequence[PoseMessage]) -> list[float] | None:
    """About how long each scan was before the next, s; None where nothing says.

    Wheels report at a steady rate, so ODOM lines count time. Without them, the way and the turn
    between two scans do.
    """
    lines = [message.line for message in odom]
    if len(lines) >= len(scans):
        at = [bisect.bisect(lines, scan.line) for scan in scans]
        return [max((b - a) * ODOM_S, LEAST_S) for a, b in pairwise(at)]
    poses = [scan.robot_pose for scan in scans if scan.robot_pose is not None]
    if len(poses) < len(scans):
        return None
    return [
        max(
            math.hypot(b[0] - a[0], b[1] - a[1]) / SPEED,
            abs(se2.wrap(b[2] - a[2])) / TURN,
            LEAST_S,
        )
        for a, b in pairwise(poses)
    ]

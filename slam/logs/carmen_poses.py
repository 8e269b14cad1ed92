# SPDX-License-Identifier: Apache-2.0
"""Odometry, truth and laser mount of each scan of a CARMEN log, from whichever lines carry them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from slam import se2
from slam.errors import LogFormatError
from slam.frames import Float
from slam.logs.carmen_messages import LaserMessage, Pose, PoseMessage
from slam.logs.stamps import put_in_order

MOUNT_TOLERANCE = 5e-3  # m, rad: six printed digits of a coordinate in the hundreds


@dataclass(frozen=True, kw_only=True)
class ScanPoses:
    """Per scan in the order of the file: odometry, truth or None, and where they came from."""

    odometry: list[Float | None]
    truth: list[Float | None]
    T_robot_laser: Float
    odometry_source: str
    truth_source: str


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
        truth = _interpolated(path, true_poses, scans)
        truth_source = "TRUEPOS of the log"
    robot = [scan.robot_pose for scan in scans if scan.robot_pose is not None]
    laser = [scan.laser_pose for scan in scans if scan.laser_pose is not None]
    if not robot:
        if not odom:
            raise LogFormatError(path, "its scans have no pose and the log has no ODOM lines")
        odometry = _interpolated(path, odom, scans)
        return ScanPoses(
            odometry=odometry,
            truth=truth,
            T_robot_laser=mount,
            odometry_source="interpolated between ODOM lines",
            truth_source=truth_source,
        )
    last_before = _chain(scans, odom)
    if last_before is not None:
        return ScanPoses(
            odometry=list(_recover_odometry(robot, last_before)),
            truth=truth if truth_source else [np.array(p) for p in robot],
            T_robot_laser=mount,
            odometry_source="recovered from ODOM lines chained on corrected poses",
            truth_source=truth_source or "corrected poses of the log",
        )
    fixed = _fixed_mount(robot, laser)
    if fixed is None and not truth_source:
        truth = [se2.compose(p, se2.inverse(mount)) for p in laser]
        truth_source = "corrected poses of the log"
    if fixed is not None and np.abs(fixed).max() > 1e-9:
        mount = fixed
    return ScanPoses(
        odometry=[np.array(p) for p in robot],
        truth=truth,
        T_robot_laser=mount,
        odometry_source="robot pose of the scan",
        truth_source=truth_source,
    )


def at_rest(scans: list[LaserMessage], mount: Float) -> ScanPoses:
    """Of a log without odometry."""
    return ScanPoses(
        odometry=[np.zeros(3) for _ in scans],
        truth=[None] * len(scans),
        T_robot_laser=mount,
        odometry_source="none: constant velocity",
        truth_source="",
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

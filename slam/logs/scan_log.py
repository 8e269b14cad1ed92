# SPDX-License-Identifier: Apache-2.0
"""What text logs and rawlogs come to, whatever their format: scans and poses, made into frames."""

import math
from collections import Counter
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from slam.constant_velocity import standing
from slam.errors import LogFormatError
from slam.frames import Float, Frame, LaserSpec, Odometry, Scan, Stream, StreamMetadata
from slam.logs.repairs import LEFT_OUT, NO_ODOMETRY, STANDS_STILL, Ordered, Repairs, put_in_order
from slam.logs.scan_poses import (
    LaserMessage,
    PoseMessage,
    ScanPoses,
    at_rest,
    on_one_clock,
    rough_steps,
    scan_poses,
)
from slam.logs.standing import Standing
from slam.logs.text import about

DEFAULT_RANGE_MAX_M = 80.0  # CARMEN's own guess for FLASER


@dataclass(frozen=True, kw_only=True)
class ScanLog:
    """The messages of one log, in the order of the file.

    message    of which kind the scans are
    ignored    what else there was, how often
    digits     significant ones, of the stamp that has most
    wheels     False: a log without odometry is none that is damaged
    mount      (3,) m, m, rad of the laser on the robot, unless the scans say
    mounted    where ``mount`` comes from, in words; "" where it is assumed
    range_max  m, where the log says it outside its scans; else 0
    """

    path: Path
    message: str
    scans: list[LaserMessage]
    odom: list[PoseMessage] = field(default_factory=list)
    truth: list[PoseMessage] = field(default_factory=list)
    ignored: Counter[str] = field(default_factory=Counter)
    digits: int
    wheels: bool = True
    mount: Float = field(default_factory=lambda: np.zeros(3))
    mounted: str = ""
    range_max: float = 0.0


def stream_of(log: ScanLog, repairs: Repairs, source: str) -> Stream:
    """The scans with their poses, on one clock, as frames."""
    _check_one_scanner(log.path, log.scans)
    scans, odom, truth = on_one_clock(log.scans, (log.odom, log.truth), repairs, log.digits)
    wheels = log.wheels or any(scan.robot_pose is not None for scan in scans) or bool(odom)
    if wheels:
        poses = scan_poses(log.path, scans, odom, truth, log.mount)
        if _stands_still(scans, poses):
            wheels, poses = False, replace(poses, wheels=False)
            why = "the odometry stands still while scans move"
            repairs.note(STANDS_STILL, why, None, len(scans))
    else:
        poses = at_rest(scans, log.mount)
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
    if not frames:
        raise LogFormatError(log.path, "no scan lies within the time of the ODOM lines")
    if len(frames) < len(scans):
        left = len(scans) - len(frames)
        repairs.note(LEFT_OUT, f"{left} scans outside the time of the ODOM lines", None, left)
    repairs.warn()
    extra: dict[str, Any] = {
        "file": log.path.name,
        "message": log.message,
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
        source=source,
        laser=spec,
        truth=poses.truth_source,
        mounting="the poses in its scans" if poses.mount_in_scans else log.mounted,
        odometry=wheels,
        extra=extra,
    )
    return Stream(metadata=metadata, frames=lambda: frames, length=len(frames))


def _stands_still(scans: list[LaserMessage], poses: ScanPoses) -> bool:
    standing = Standing()
    for pose in poses.odometry:
        if pose is not None:
            standing.pose(pose.tolist())
    for scan in scans if standing.still else ():
        standing.scan(np.array(scan.ranges))
    return standing.stands


def _check_one_scanner(path: Path, scans: list[LaserMessage]) -> None:
    first = scans[0]
    for scan in scans:
        if len(scan.ranges) != len(first.ranges):
            now = f"the number of beams changes from {len(first.ranges)} to {len(scan.ranges)}"
            raise LogFormatError(path, now, scan.line)
        if scan.beams != first.beams:
            now = f"the scanner changes from {first.beams} to {scan.beams}"
            raise LogFormatError(path, now, scan.line)


def _ranges(log: ScanLog, scans: list[LaserMessage]) -> tuple[Float, float, str]:
    """(k, n) ranges with inf and NaN put in, the range limit in m and where it came from."""
    ranges = np.array([scan.ranges for scan in scans])
    first = scans[0]
    if first.beams is not None:
        limit, source = first.beams.range_max, "scan message"
    elif log.range_max > 0.0:
        limit, source = log.range_max, "PARAM"
    else:
        limit, source = DEFAULT_RANGE_MAX_M, "default"
    code = _saturated_from(ranges)
    if code is not None and (source == "default" or 0.95 * limit < code < limit):
        limit, source = code, "readings that say no return"
    ranges[ranges >= limit] = math.inf
    ranges[ranges == 0.0] = math.nan
    return ranges, limit, source


def _saturated_from(ranges: Float) -> float | None:
    """The smallest range (m) that stands for "no return" in (k, n) ``ranges``, or None.

    Scanners write such a beam as one of a few fixed values at the end of their scale (SICK LMS
    81.83 to 81.91 m or 8.183 to 8.191 m, SICK PLS 51.05 and 51.10 m). They show as a cluster of
    equal readings above a gap: the top 0.5 % of the scale holds at least ten readings of at most
    ten values, on at least a tenth of the beams (the far wall of a robot at rest is on a few
    neighbours), against almost none in the 4.5 % of the scale below.
    """
    top = float(ranges.max())
    high = ranges >= 0.995 * top
    n_high = int(high.sum())
    below = int(((ranges >= 0.95 * top) & ~high).sum())
    if (
        n_high < 10
        or not 0.0005 * ranges.size <= n_high <= 0.9 * ranges.size
        or below > 0.01 * n_high
        or high.any(axis=0).sum() < 0.1 * ranges.shape[1]
        or len(np.unique(ranges[high])) > 10
    ):
        return None
    return float(ranges[high].min())


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
    """In the order of time; without wheels, the odometry of one that may have moved."""
    frames: list[Frame] = []
    for k, stamp_ns in zip(ordered.order, ordered.stamps_ns, strict=True):
        T_odom_robot = poses.odometry[k]
        if T_odom_robot is None:
            continue
        with about(path, line=scans[k].line):
            if poses.wheels:
                odometry = Odometry(stamp_ns=stamp_ns, T_odom_robot=T_odom_robot)
            else:
                odometry = standing(stamp_ns, frames[-1].stamp_ns if frames else None)
            intensities = np.array(scans[k].intensities, dtype=np.float32)
            scan = Scan(
                stamp_ns=stamp_ns,
                ranges=ranges[k].astype(np.float32),
                spec=spec,
                intensities=intensities if len(intensities) else None,
            )
            frames.append(
                Frame(stamp_ns=stamp_ns, odometry=odometry, scan=scan, truth=poses.truth[k])
            )
    return frames

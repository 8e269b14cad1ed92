# SPDX-License-Identifier: Apache-2.0
"""Rawlogs of MRPT: observations one by one, or pairs of actions and sensory frames."""

import gzip
import math
import re
import zlib
from collections import Counter
from pathlib import Path

import numpy as np

from slam import se2
from slam.errors import LogFormatError, MissingPathError
from slam.frames import Float, Stream
from slam.logs.rawlog_objects import MoveObject, Object, Objects, OdometryObject, ScanObject, Torn
from slam.logs.repairs import FINE_DIGITS, TORN_LINE, Repairs
from slam.logs.scan_log import ScanLog, stream_of
from slam.logs.scan_poses import Beams, LaserMessage, PoseMessage
from slam.logs.text import MAX_COORDINATE, MAX_RANGE_M, Pose
from slam.logs.unpacking import MAX_RAWLOG_BYTES

SCAN = "CObservation2DRangeScan"
MOST_TILT_RAD = math.radians(15.0)  # of a scanner that sees a plane of the room
MOST_MOUNT_CHANGE = 0.1  # m, rad: carmen2rawlog's mounts differ by the digits of its log
_STEP = 1 << 20
_GZIP = b"\x1f\x8b"
_BEGINS = re.compile(
    rb"(?:[\x80-\xff]|.\0\0\0)(?:mrpt::\w{1,20}::)?C(?:Sensory|Action|Observation|Rawlog)",
    re.DOTALL,
)


def is_rawlog(path: Path) -> bool:
    """Whether a file, packed or not, begins as a rawlog, or is called one."""
    if not path.is_file():
        return False
    if path.name.endswith((".rawlog", ".rawlog.gz")):
        return True
    try:
        with path.open("rb") as file:
            head = file.read(256)
        if head.startswith(_GZIP):
            head = zlib.decompressobj(31).decompress(head, 64)
    except (OSError, zlib.error):
        return False
    return _BEGINS.match(head) is not None


def read_rawlog(path: str | Path, *, strict: bool = False) -> Stream:
    """A rawlog (plain or gzip) as frames: the planar scans of the label that has most of them.

    Odometry is chained from the actions where there are any; else it is the odometry observation of
    the same time right before each scan (as carmen2rawlog writes them), or interpolated between
    odometry observations. Scanners that hang upside down or count clockwise are turned round;
    those tilted by more than 15 degrees are left out and counted, with all other observations, in
    ``metadata.extra``. Without any odometry the frames have that of a robot at rest, and
    ``metadata.odometry`` says so. Beams marked invalid are NaN, or inf at the scanner's maximum.

    Repairs and ``strict`` are those of ``read_carmen``; an object cut off at the end counts as a
    torn last line. Raises ``LogFormatError`` for anything else, with the number of the object after
    the file's name.
    """
    path = Path(path)
    repairs = Repairs(path, strict)
    objects = Objects(_unpacked(path, repairs))
    found: list[Object] = []
    try:
        for item in objects:
            found.append(item)
    except Torn as error:
        repairs.note(TORN_LINE, str(error), objects.number)
    except ValueError as error:
        raise LogFormatError(path, str(error), objects.number) from error
    label = _label(path, found, objects.skipped)
    return stream_of(_Builder(path, found, label).log(objects.skipped), repairs, "rawlog")


def _unpacked(path: Path, repairs: Repairs) -> bytes:
    """The bytes, up to ``MAX_RAWLOG_BYTES``; a gzip file that was cut gives what is there."""
    out = bytearray()
    try:
        if not path.exists():
            raise MissingPathError(path, "no such file")
        if not path.is_file():
            raise LogFormatError(path, "is no file")
        with path.open("rb") as raw:
            packed = raw.read(2) == _GZIP
            raw.seek(0)
            with gzip.GzipFile(fileobj=raw) if packed else raw as file:
                while part := file.read1(_STEP):
                    out += part
                    if len(out) > MAX_RAWLOG_BYTES:
                        raise LogFormatError(
                            path, f"unpacks to more than {MAX_RAWLOG_BYTES} bytes; keep the laser "
                            "and the odometry only (rawlog-edit --keep-label)"
                        )  # fmt: skip
    except EOFError as error:
        repairs.note(TORN_LINE, f"truncated file: {error}")
    except (zlib.error, gzip.BadGzipFile) as error:
        raise LogFormatError(path, f"corrupt file: {error}") from error
    except OSError as error:
        raise LogFormatError(path, f"cannot be read: {error.strerror or error}") from error
    if not out:
        raise LogFormatError(path, "is empty")
    return bytes(out)


def _label(path: Path, found: list[Object], skipped: Counter[str]) -> str:
    """Whose scans are read. Those of others, and tilted ones, are counted."""
    labels = Counter(o.label for o in found if isinstance(o, ScanObject) and _is_planar(o))
    if not labels:
        there = ", ".join(sorted(skipped)) or "nothing else"
        raise LogFormatError(path, f"no planar scan found (no level {SCAN}; there is {there})")
    label = labels.most_common(1)[0][0]
    for item in found:
        if isinstance(item, ScanObject) and (item.label != label or not _is_planar(item)):
            skipped[f"{SCAN} {item.label}".strip()] += 1
    return label


def _is_planar(scan: ScanObject) -> bool:
    return abs(float(scan.pose[2, 2])) >= math.cos(MOST_TILT_RAD)


class _Builder:
    """Objects as the messages that ``stream_of`` takes."""

    def __init__(self, path: Path, found: list[Object], label: str) -> None:
        self._path, self._found = path, found
        self._scans = [
            o for o in found if isinstance(o, ScanObject) and o.label == label and _is_planar(o)
        ]
        self._mount = self._mounted()

    def log(self, ignored: Counter[str]) -> ScanLog:
        """All of it, but what is ``ignored``."""
        poses = self._poses()
        odom: list[PoseMessage] = []
        if poses is None:
            for o in self._found:
                if isinstance(o, OdometryObject):
                    pose = self._checked(o.number, o.pose)
                    odom.append(PoseMessage(line=o.number, stamp_ns=o.stamp_ns, pose=pose))
        # whether valid beams are marked invalid, as the first carmen2rawlog did
        turned = not any(
            (scan.valid & (scan.ranges > 0.0) & (scan.ranges < scan.range_max)).any()
            for scan in self._scans
        )
        return ScanLog(
            path=self._path,
            message=SCAN,
            scans=[self._scan(s, poses[s.number] if poses else None, turned) for s in self._scans],
            odom=odom,
            ignored=ignored,
            digits=FINE_DIGITS,
            wheels=False,
            mount=self._mount,
            mounted="its observations",
        )

    def _mounted(self) -> Float:
        """(3,) of the laser on the robot: the middle one, as all should be the same."""
        mounts = np.array([_planar(scan.pose) for scan in self._scans])
        middle: Float = np.median(mounts, axis=0)
        off = np.abs(mounts - middle)
        off[:, 2] = np.abs(se2.wrap_array(mounts[:, 2] - middle[2]))
        worst = int(off.max(axis=1).argmax())
        if off[worst].max() > MOST_MOUNT_CHANGE or not np.isfinite(mounts).all():
            raise LogFormatError(
                self._path, f"the scanner moves on the robot: {mounts[worst].tolist()} instead of "
                f"{middle.tolist()} (m, m, rad)", self._scans[worst].number
            )  # fmt: skip
        return middle

    def _checked(self, number: int, pose: Pose) -> Pose:
        if not all(abs(value) <= MAX_COORDINATE for value in pose):  # false for NaN too
            raise LogFormatError(
                self._path, f"a pose must lie within {MAX_COORDINATE:g} m, got {pose}", number
            )
        return pose

    def _poses(self) -> dict[int, Pose] | None:
        """The robot's pose at each scan, by the scan's number; None: it must be interpolated."""
        moves = any(isinstance(o, MoveObject) for o in self._found)
        out: dict[int, Pose] = {}
        T_odom_robot: Float = np.zeros(3)
        before: Object | None = None
        for item in self._found:
            if isinstance(item, MoveObject):
                T_odom_robot = se2.compose(T_odom_robot, item.step)
            elif isinstance(item, ScanObject):
                if moves:
                    x, y, theta = T_odom_robot.tolist()
                    out[item.number] = self._checked(item.number, (x, y, theta))
                elif isinstance(before, OdometryObject) and before.stamp_ns == item.stamp_ns:
                    out[item.number] = self._checked(item.number, before.pose)
            before = item
        return out if all(scan.number in out for scan in self._scans) else None

    def _scan(self, scan: ScanObject, robot: Pose | None, turned: bool) -> LaserMessage:
        if not (scan.range_max > 0.0 and 0.0 < scan.aperture <= 2.0 * math.tau):
            raise LogFormatError(
                self._path, f"a field of view of {scan.aperture} rad up to {scan.range_max} m",
                scan.number,
            )  # fmt: skip
        known = np.isfinite(scan.ranges) & (scan.ranges > 0.0)
        known &= (scan.valid ^ turned) | (scan.ranges >= scan.range_max)
        ranges = np.where(known, np.minimum(scan.ranges, MAX_RANGE_M), 0.0)
        if scan.counter_clockwise != (scan.pose[2, 2] > 0.0):
            ranges = ranges[::-1]
        n = len(ranges)
        laser = None
        if robot is not None:
            x, y, theta = se2.compose(robot, self._mount).tolist()
            laser = (x, y, theta)
        return LaserMessage(
            line=scan.number,
            stamp_ns=scan.stamp_ns,
            ranges=ranges.tolist(),
            beams=Beams(
                start_angle=-scan.aperture / 2.0,
                increment=scan.aperture / max(n - 1, 1),
                range_max=min(scan.range_max, MAX_RANGE_M),
            ),
            laser_pose=laser,
            robot_pose=robot,
        )


def _planar(pose: Float) -> list[float]:
    """x, y, yaw of a (3, 4) pose."""
    return [float(pose[0, 3]), float(pose[1, 3]), math.atan2(pose[1, 0], pose[0, 0])]

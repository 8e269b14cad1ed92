# SPDX-License-Identifier: Apache-2.0
"""MRPT's SLAM programs (version 2.5), which read a file and end: ``icp-slam`` and ``rbpf-slam``.

The file is a rawlog: pairs of an action (odometry) and a sensory frame (one planar scan) in MRPT's
serialisation, little endian: of each object the length of its class name with the top bit set, the
name, a version of the layout, the members, and the byte 0x88. The layouts are those that MRPT 2.5
writes, but for ``CSensoryFrame`` (2), which it reads too. It is not compressed: zlib, with which
MRPT opens it, reads such files as they are.
"""

import math
import shutil
import struct
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import ClassVar

import numpy as np

from slam import se2
from slam.errors import MissingDependencyError, SlamFailedError
from slam.estimate import Estimate
from slam.frames import Float, LaserSpec
from slam.frontend.odometry_prior import Prediction
from slam.guests import wire
from slam.guests.guest import Guest, check_beams, ranges_of
from slam.guests.pipe import Limits
from slam.trajectory import Trajectory

EPOCH_100NS = 116_444_736_000_000_000  # MRPT's time is 100 ns since 1601: here 1970-01-01
LABEL = b"LASER"
_ODOMETRY, _GAUSSIAN = 0, 0  # CActionRobotMovement2D: emOdometry, mmGaussian


@dataclass(frozen=True, kw_only=True)
class MotionModel:
    """MRPT's Gaussian error of an odometry step: its standard deviations grow with the motion."""

    m_per_m: float
    m_per_rad: float
    rad_per_m: float
    rad_per_rad: float
    least_m: float
    least_rad: float


def _object(name: str, version: int, members: bytes) -> bytes:
    return bytes((0x80 | len(name),)) + name.encode() + bytes((version,)) + members + b"\x88"


def _pose3d(pose: Float) -> bytes:
    """A planar pose in space: position and rotation matrix."""
    x, y, theta = pose.tolist()
    c, s = math.cos(theta), math.sin(theta)
    numbers = (x, y, 0.0, c, -s, 0.0, s, c, 0.0, 0.0, 0.0, 1.0)
    return _object("mrpt::poses::CPose3D", 3, struct.pack("<12d", *numbers))


def action(stamp_ns: int, increment: Float, model: MotionModel) -> bytes:
    """A step (3,) m, m, rad by odometry, in the robot frame before it."""
    gaussian = (
        model.m_per_m, model.m_per_rad, model.rad_per_m, model.rad_per_rad,
        model.least_m, model.least_rad,
    )  # fmt: skip
    members = b"".join((
        struct.pack("<I", _ODOMETRY),
        _object("mrpt::poses::CPose2D", 1, struct.pack("<3d", *increment.tolist())),
        struct.pack("<I6f", _GAUSSIAN, *gaussian),
        struct.pack("<I6f", 0, *(0.0,) * 6),  # the other model, not used
        struct.pack("<??", False, False),  # no velocities, no encoder ticks
        struct.pack("<q", EPOCH_100NS + stamp_ns // 100),
    ))  # fmt: skip
    moved = _object("mrpt::obs::CActionRobotMovement2D", 7, members)
    return _object("mrpt::obs::CActionCollection", 0, struct.pack("<I", 1) + moved)


def sensed(stamp_ns: int, ranges: Float, spec: LaserSpec) -> bytes:
    """A frame of one scan (n_beams,) m; a range that is not finite is no valid one."""
    valid = np.isfinite(ranges)
    aperture = (spec.n_beams - 1) * spec.angle_increment
    middle = np.array([0.0, 0.0, spec.angle_min + aperture / 2.0])
    members = b"".join((
        struct.pack("<f?f", aperture, True, spec.range_max),  # counter-clockwise
        _pose3d(se2.compose(spec.T_robot_laser, middle)),
        struct.pack("<I", spec.n_beams),
        np.where(valid, ranges, 0.0).astype("<f4").tobytes(),
        valid.astype("u1").tobytes(),
        struct.pack("<f", spec.range_sigma_m or 0.01),
        struct.pack("<q", EPOCH_100NS + stamp_ns // 100),
        struct.pack("<f", spec.angle_increment / 2.0),  # of the beam itself
        struct.pack("<I", len(LABEL)) + LABEL,
        struct.pack("<d?", 0.0, False),  # no pitch during the sweep, no intensities
    ))  # fmt: skip
    scan = _object("mrpt::obs::CObservation2DRangeScan", 7, members)
    return _object("mrpt::obs::CSensoryFrame", 2, struct.pack("<I", 1) + scan)


MOST_BEAMS = 100_000
SCAN_LIMIT_S = 2.0  # s a scan that a program may take, in the mean; rbpf-slam takes 0.1


class MrptSlam(Guest):
    """A program of MRPT over all frames at once.

    ``update`` keeps the frame and reports odometry's pose. ``estimates_at_end`` writes the frames
    so far as a rawlog, runs the program, and returns what it logged: its pose after each scan,
    which it found from that scan and those before it. So its error is an online error like any
    other's. A closed loop and an environment need poses before the end: they refuse it. Each run
    begins at the first frame. Raises ``MissingDependencyError`` where the program is not installed.
    """

    command: ClassVar[str]
    config: ClassVar[str]  # its config file, here; ``{folder}`` in it is where its logs go
    motion: ClassVar[MotionModel]
    columns: ClassVar[tuple[int, int]]  # of its logs of the path and of times, in MRPT 2.5
    pose_columns: ClassVar[tuple[int, int, int]]  # x, y (m) and yaw (rad) in that of the path
    ms_column: ClassVar[int]  # in that of times

    def __init__(self) -> None:
        found = shutil.which(self.command)
        if found is None:
            raise MissingDependencyError(
                f"the program '{self.command}' is not there: apt-get install mrpt-apps "
                "(Debian, Ubuntu)"
            )
        self._program = found
        super().__init__()

    def reset(self) -> None:
        """Forget everything; the next frame is the origin of the map."""
        super().reset()
        self._frames: list[tuple[Float, Float]] = []
        self._found: list[tuple[Estimate, float]] = []
        self._growth_bytes: int | None = None

    def begin(self, spec: LaserSpec) -> None:
        """Note the scanner; the rawlog has one."""
        check_beams(self, spec, MOST_BEAMS)
        self._spec = spec

    def locate(self, points_robot: Float, prediction: Prediction) -> tuple[Float, dict[str, float]]:
        """Keep the scan; the pose is odometry's until ``estimates_at_end``."""
        ranges = ranges_of(points_robot, self._spec, math.inf)
        self._frames.append((prediction.increment, ranges))
        return prediction.T_map_robot, {}

    def estimates_at_end(self) -> list[tuple[Estimate, float]]:
        """Of each frame so far: the program's estimate, and the processor time it took, s.

        Raises ``SlamFailedError`` where the program fails.
        """
        if len(self._found) != len(self._frames):
            with TemporaryDirectory(prefix="mobilia-") as folder:
                self._found = self._run(Path(folder).resolve())
        return self._found

    def trajectory(self) -> Trajectory:
        """The program's poses, as ``estimates_at_end`` has them: it moves none later."""
        return self._path.trajectory(
            np.array([e.T_map_robot for e, _ in self.estimates_at_end()]).reshape(-1, 3)
        )

    def memory_growth_bytes(self) -> int | None:
        """How far the program's memory grew over the scans, of its last run."""
        return self._growth_bytes

    def _run(self, folder: Path) -> list[tuple[Estimate, float]]:
        stamps = self._path.trajectory().stamps_ns.tolist()
        with (folder / "frames.rawlog").open("wb") as file:
            for stamp_ns, (increment, ranges) in zip(stamps, self._frames, strict=True):
                file.write(action(stamp_ns, increment, self.motion))
                file.write(sensed(stamp_ns, ranges, self._spec))
        config = Path(__file__).with_name(self.config).read_text(encoding="utf-8")
        (folder / "config.ini").write_text(config.format(folder=f"{folder}/log"), encoding="utf-8")
        words = [self._program, f"{folder}/config.ini", f"{folder}/frames.rawlog"]
        processor_s = wire.run(words, Limits.first_s + len(stamps) * SCAN_LIMIT_S)
        rows = self._log(folder / "log" / "log_estimated_path.txt", self.columns[0])
        path = rows[:, self.pose_columns]
        if not np.isfinite(path).all():
            raise SlamFailedError(f"{type(self).__name__} logged a pose that is not finite", "nan")
        rows = self._log(folder / "log" / "log_times.txt", self.columns[1])
        wall_ms = rows[:, self.ms_column]
        memory = self._log(folder / "log" / "log_MemoryUsage.txt", 2)[:, 1]
        if not np.isfinite([wall_ms, memory]).all():
            raise SlamFailedError(f"{type(self).__name__} logged a time or memory that is not "
                                  "finite", "bad")  # fmt: skip
        wall_ms = np.maximum(wall_ms, 1e-6)
        self._growth_bytes = int(memory.max() - memory[0])
        shares = (processor_s * wall_ms / wall_ms.sum()).tolist()
        return [
            (self._estimate(stamp_ns, se2.between(path[0], pose)), share)
            for stamp_ns, pose, share in zip(stamps, path, shares, strict=True)
        ]

    def _log(self, path: Path, columns: int) -> Float:
        """(frames, columns) numbers of a log, a row each frame."""
        try:
            rows: Float = np.loadtxt(path, comments="%", ndmin=2)
        except OSError as error:
            raise SlamFailedError(f"{type(self).__name__} wrote no {path.name}", "bad") from error
        except ValueError as error:
            raise SlamFailedError(f"{type(self).__name__}: {path.name}: {error}", "bad") from error
        if len(rows) != len(self._frames):
            raise SlamFailedError(
                f"{type(self).__name__} logged {len(rows)} rows of {path.name} for "
                f"{len(self._frames)} scans",
                "bad",
            )
        if rows.shape[1] != columns:
            raise SlamFailedError(
                f"{type(self).__name__} logged {rows.shape[1]} columns of {path.name}, not "
                f"{columns}: another version of MRPT?",
                "bad",
            )
        return rows

    def _estimate(self, stamp_ns: int, T_map_robot: Float) -> Estimate:
        return Estimate(stamp_ns=stamp_ns, T_map_robot=T_map_robot, covariance=np.zeros((3, 3)))


class IcpSlam(MrptSlam):
    """MRPT's icp-slam, a guest over files: ICP to a map of points, run when the last scan is in.

    The config is that of MRPT's own demo, but for what the training seeds asked for (20 s of
    office, arena and station, still and at motion 0.5): every scan is matched, by every point, with
    pairs up to 0.15 m apart, and goes into the map each 0.5 m or 20 degrees.
    """

    command = "icp-slam"
    config = "mrpt_icp.ini"
    columns = (4, 2)
    pose_columns = (1, 2, 3)  # step, x, y, yaw
    ms_column = 0  # ms, size of the map
    # not used: it takes odometry's step as the start of its ICP, however sure
    motion = MotionModel(
        m_per_m=0.05, m_per_rad=0.05, rad_per_m=0.05, rad_per_rad=0.05, least_m=0.005,
        least_rad=0.005,
    )  # fmt: skip


class RbpfSlam(MrptSlam):
    """MRPT's rbpf-slam, a guest over files: particles with grids, run when the last scan is in.

    Each particle draws its poses by odometry and by the likelihood of the whole scan in its own map
    ("optimal sampling", Blanco et al. 2010). What mattered on the training seeds (those of
    icp-slam): a scan into the map each 1 m or 30 degrees, not each 0.2 m, which let the heading
    drift after odometry's, nor each 2 m, which left it lost among movers; the likelihood without
    smoothing (``powFactor``); an odometry that is doubted more than it deserves. 30 particles were
    no better than 15. ICP to points as the proposal was best in still rooms, at 3 cm, and flew off
    by tens of metres among movers: it does not weigh odometry.
    """

    command = "rbpf-slam"
    config = "mrpt_rbpf.ini"
    columns = (8, 4)
    pose_columns = (1, 2, 4)  # step, x, y, z, yaw, pitch, roll, time: the mean of the particles
    ms_column = 1  # step, ms, size of the map, whether the scan went into it
    # about three times a Pioneer's own errors
    motion = MotionModel(
        m_per_m=0.05, m_per_rad=0.05, rad_per_m=0.08, rad_per_rad=0.08, least_m=0.01,
        least_rad=0.01,
    )  # fmt: skip

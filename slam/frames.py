# SPDX-License-Identifier: Apache-2.0
"""The types that flow: a producer makes ``Frame``s, every SLAM takes them one at a time.

Plain frozen dataclasses over read-only NumPy arrays, validated at birth. Units are metres, radians
and seconds. Time stamps are integer nanoseconds from birth, so that a frame seen live and the same
frame read back from a recording are equal. Frames follow REP 103 (x forward, y left, angles
counter-clockwise) and REP 105 (map, odom, robot = base_link, laser); ``T_a_b`` maps b to a.
"""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from enum import IntEnum
from typing import Any

import numpy as np

from slam.arrays import Bools, Bytes, Float32, Int32, Ints
from slam.arrays import Float as Float
from slam.checked import (
    ByContent,
    covariance,
    finite,
    frozen,
    is_number,
    is_whole,
    pose,
    possible,
    set_fields,
    stamp,
)
from slam.errors import InvalidValueError
from slam.laser_scan import LaserScanNames

NS_PER_S = 1_000_000_000
EPOCH = "epoch_ns"  # of ``StreamMetadata.extra``
MOST_TWIST = 1e3  # m/s and rad/s: faster, de-skewing would tear a scan apart
MOST_BEAMS = 1_000_000  # of a scan; a thousand times those of common scanners
LEAST_INCREMENT = 1e-5  # rad; the finest scanners have 4e-4
MOST_RANGE_M = float(np.finfo(np.float32).max)  # ranges are such numbers
MOST_SWEEP_S = 100.0  # from a scan's first beam to its last
MOST_FEATURE_M = 1e9  # from the robot: their squares must not overflow
MOST_MOUNT_M = 30.0  # from the robot's origin to its laser
MOST_SIGMA_M = 10.0  # of a range; a scanner that is off by more measures nothing


def to_ns(seconds: float) -> int:
    """Seconds as the nearest whole nanosecond."""
    return round(seconds * NS_PER_S)


def to_s(nanoseconds: int) -> float:
    """Nanoseconds as seconds; exact only to about 1e-7 s for Unix times."""
    return nanoseconds / NS_PER_S


@dataclass(frozen=True, kw_only=True, eq=False)
class LaserSpec(ByContent):
    """Geometry and timing of a planar scanner; one object shared by all its scans.

    A robot may have several: each scan of a stream is as its own says (``mount``).

    n_beams            number of beams, counted counter-clockwise (right to left), up to 10^6
    angle_min          rad, direction of beam 0 in the laser frame, within two turns
    angle_increment    rad between neighbouring beams, at least 1e-5
    range_min/max      m; a return outside is no valid measurement
    beam_time_offsets  (n_beams,) s after the scan's stamp at which each beam was measured, whole
                       nanoseconds, up to 100 s. The LMS-221 interlaces: in a 0.5 degree scan
                       neighbours are one mirror turn (13.3 ms) apart. All zero where a log does
                       not say.
    T_robot_laser      (3,) pose of the laser on the robot (m, m, rad), within 30 m of its origin
    range_sigma_m      m, standard deviation of a range at 5 m, rounding included; 0 where nobody
                       states it: logs and bags do not
    angles             (n_beams,) rad, beam directions in the laser frame, by the above
    sweep_duration     s from the stamp to the last beam, by the above

    Raises ``InvalidValueError`` for anything else.
    """

    n_beams: int
    angle_min: float
    angle_increment: float
    range_min: float = 0.0
    range_max: float = 80.0
    beam_time_offsets: Float = field(default_factory=lambda: np.zeros(0))
    T_robot_laser: Float = field(default_factory=lambda: np.zeros(3))
    range_sigma_m: float = 0.0
    angles: Float = field(init=False, repr=False)
    sweep_duration: float = field(init=False, repr=False)

    def __post_init__(self) -> None:
        self._check_angles()
        if not 0.0 <= self.range_sigma_m <= MOST_SIGMA_M:
            raise InvalidValueError(
                f"LaserSpec.range_sigma_m must be 0 (not stated) to {MOST_SIGMA_M:g} m, "
                f"got {self.range_sigma_m}"
            )
        if not 0.0 <= self.range_min < self.range_max <= MOST_RANGE_M:
            raise InvalidValueError(
                f"LaserSpec needs 0 <= range_min < range_max <= {MOST_RANGE_M:.3g}, "
                f"got {self.range_min} and {self.range_max} m"
            )
        mounted = pose("LaserSpec", "T_robot_laser", self.T_robot_laser)
        if max(map(abs, mounted.tolist())) > MOST_MOUNT_M:
            raise InvalidValueError(
                f"LaserSpec.T_robot_laser must lie within {MOST_MOUNT_M:g} m and rad, "
                f"got {mounted.tolist()}"
            )
        angles = self.angle_min + np.arange(self.n_beams) * self.angle_increment
        angles.setflags(write=False)
        offsets = self._offsets()
        set_fields(self, beam_time_offsets=offsets, sweep_duration=float(offsets.max()))
        set_fields(self, T_robot_laser=mounted, angles=angles)

    @property
    def mount(self) -> tuple[float, ...]:
        """``T_robot_laser`` as numbers: it tells the scanners of a robot apart."""
        return tuple(self.T_robot_laser.tolist())

    def _check_angles(self) -> None:
        if not is_whole(self.n_beams) or not 1 <= self.n_beams <= MOST_BEAMS:
            raise InvalidValueError(
                f"LaserSpec.n_beams must be a whole number >= 1 and <= {MOST_BEAMS}, "
                f"got {self.n_beams!r}"
            )
        for name in ("angle_min", "angle_increment", "range_min", "range_max", "range_sigma_m"):
            value = getattr(self, name)
            if not is_number(value, (float, int, np.number)):
                raise InvalidValueError(f"LaserSpec.{name} must be a number, got {value!r}")
        if not (math.isfinite(self.angle_min) and math.isfinite(self.angle_increment)):
            raise InvalidValueError("LaserSpec.angle_min and angle_increment must be finite")
        if abs(self.angle_min) > 2.0 * math.tau:
            raise InvalidValueError(
                f"LaserSpec.angle_min must lie within two turns (in radians, not degrees?), "
                f"got {self.angle_min} rad"
            )
        if self.angle_increment < LEAST_INCREMENT:
            raise InvalidValueError(
                f"LaserSpec.angle_increment must be > 0 rad, at least {LEAST_INCREMENT:g}, "
                f"got {self.angle_increment}"
            )
        if (self.n_beams - 1) * self.angle_increment > 1.05 * math.tau:
            raise InvalidValueError(
                f"LaserSpec.angle_increment must keep {self.n_beams} beams within one turn (in "
                f"radians, not degrees?), got {self.angle_increment} rad"
            )

    def _offsets(self) -> Float:
        raw = np.asarray(self.beam_time_offsets, dtype=np.float64)
        offsets = frozen(
            "LaserSpec",
            "beam_time_offsets",
            np.zeros(self.n_beams) if raw.size == 0 else np.round(raw * NS_PER_S) / NS_PER_S,
            (self.n_beams,),
        )
        finite("LaserSpec", "beam_time_offsets", offsets)
        if offsets.min() < 0.0 or offsets.max() > MOST_SWEEP_S:
            raise InvalidValueError(
                f"LaserSpec.beam_time_offsets must be >= 0 s (the stamp is the earliest beam's) "
                f"and <= {MOST_SWEEP_S:g} s, got {offsets.min()} to {offsets.max()}"
            )
        return offsets


@dataclass(frozen=True, kw_only=True, eq=False)
class Scan(LaserScanNames, ByContent):
    """One laser scan. It has the names of sensor_msgs/LaserScan, too (``slam.laser_scan``).

    stamp_ns     time of the earliest beam, ns
    ranges       (n_beams,) float32 m; REP 117: +inf no return, NaN an error code, never -inf. 0
                 is no measurement, whatever range_min: drivers write it for one that failed
    intensities  optional (n_beams,) float32
    """

    stamp_ns: int
    ranges: Float32
    spec: LaserSpec
    intensities: Float32 | None = None

    def __post_init__(self) -> None:
        stamp_ns, n = stamp("Scan", self.stamp_ns), self.spec.n_beams
        ranges = frozen("Scan", "ranges", self.ranges, (n,), np.float32)
        for bad in np.flatnonzero(ranges < 0.0).tolist():
            raise InvalidValueError(
                f"Scan.ranges[{bad}] must be >= 0 m, inf (no return) or NaN (error), "
                f"got {ranges[bad]}"
            )
        set_fields(self, stamp_ns=stamp_ns, ranges=ranges)
        if self.intensities is not None:
            given = frozen("Scan", "intensities", self.intensities, (n,), np.float32)
            set_fields(self, intensities=given)

    @property
    def valid(self) -> Bools:
        """(n_beams,) True where the range is finite, not 0, and within the scanner's limits."""
        r = self.ranges
        return np.isfinite(r) & (r > 0.0) & (r >= self.spec.range_min) & (r <= self.spec.range_max)


@dataclass(frozen=True, kw_only=True, eq=False)
class Features(ByContent):
    """Point features with uncertainty: landmarks, tree trunks, extracted corners.

    stamp_ns      ns
    points_robot  (k, 2) m, within 10^9 m
    covariances   (k, 2, 2) m^2, in the robot frame
    ids           optional (k,) int64, true identities: for evaluation only, no SLAM may read them
    """

    stamp_ns: int
    points_robot: Float
    covariances: Float
    ids: Ints | None = None

    def __post_init__(self) -> None:
        stamp_ns = stamp("Features", self.stamp_ns)
        points = frozen("Features", "points_robot", self.points_robot, (None, 2))
        finite("Features", "points_robot", points)
        if (farthest := np.abs(points).max(initial=0.0)) > MOST_FEATURE_M:
            raise InvalidValueError(
                f"Features.points_robot must lie within {MOST_FEATURE_M:g} m, got {farthest:g}"
            )
        k = len(points)
        covariances = frozen("Features", "covariances", self.covariances, (k, 2, 2))
        finite("Features", "covariances", covariances)
        transposed = covariances.transpose(0, 2, 1)
        if np.any(np.diagonal(covariances, axis1=1, axis2=2) < 0.0) or not np.allclose(
            covariances, transposed, rtol=1e-6, atol=1e-9
        ):
            raise InvalidValueError("Features.covariances must be symmetric with variances >= 0")
        for index, ((xx, xy), (_, yy)) in enumerate(covariances.tolist()):
            if not possible(xx, xy, yy):
                raise InvalidValueError(
                    f"Features.covariances[{index}] must be positive semidefinite (no correlation "
                    f"beyond 1), got {covariances[index].tolist()}"
                )
        set_fields(self, stamp_ns=stamp_ns, points_robot=points, covariances=covariances)
        if self.ids is not None:
            set_fields(self, ids=frozen("Features", "ids", self.ids, (k,), np.int64))


@dataclass(frozen=True, kw_only=True, eq=False)
class Odometry(ByContent):
    """Where the wheels say the robot is, at the frame's stamp.

    stamp_ns              ns
    T_odom_robot          (3,) m, m, rad
    increment_covariance  optional (3, 3): of the motion since the previous frame, in the previous
                          robot frame. A bag's accumulated covariance is converted by its reader.
    twist                 optional (3,) vx m/s, vy m/s, omega rad/s: mean body velocity over the
                          sweep of the frame's scan, for de-skewing
    """

    stamp_ns: int
    T_odom_robot: Float
    increment_covariance: Float | None = None
    twist: Float | None = None

    def __post_init__(self) -> None:
        T_odom_robot = pose("Odometry", "T_odom_robot", self.T_odom_robot)
        set_fields(self, stamp_ns=stamp("Odometry", self.stamp_ns), T_odom_robot=T_odom_robot)
        if (spread := self.increment_covariance) is not None:
            known = covariance("Odometry", "increment_covariance", spread)
            set_fields(self, increment_covariance=known)
        if self.twist is not None:
            set_fields(self, twist=pose("Odometry", "twist", self.twist))
            fastest = max(map(abs, self.twist.tolist()))
            if fastest > MOST_TWIST:
                raise InvalidValueError(
                    f"Odometry.twist must lie within {MOST_TWIST:g} m/s and rad/s, got {fastest:g}"
                )


class BeamClass(IntEnum):
    """What a beam hit, by how the thing behaves, not by what it is called."""

    NONE = 0
    STATIC = 1
    SEMI_STATIC = 2
    MOVING = 3


@dataclass(frozen=True, kw_only=True, eq=False)
class BeamLabels(ByContent):
    """Truth per beam; for evaluation only.

    body          (n,) int32 body id in the simulated model, -1 where nothing was hit
    kind          (n,) uint8, a ``BeamClass``: SEMI_STATIC can move but rests now, MOVING moves now
    displacement  (n,) float32 m that body moved since the robot last saw it
    incidence     (n,) float32 rad between beam and surface normal, NaN where nothing was hit
    mixed         (n,) bool, the range blends two surfaces
    """

    body: Int32
    kind: Bytes
    displacement: Float32
    incidence: Float32
    mixed: Bools

    def __post_init__(self) -> None:
        n = len(self.body)
        dtypes = (np.int32, np.uint8, np.float32, np.float32, np.bool_)
        for name, dtype in zip(self.__dataclass_fields__, dtypes, strict=True):
            value = frozen("BeamLabels", name, getattr(self, name), (n,), dtype)
            set_fields(self, **{name: value})


@dataclass(frozen=True, kw_only=True, eq=False)
class Frame(ByContent):
    """Everything a robot knows at one moment, and (apart) what only the simulator knows.

    stamp_ns  ns; the scan's or the features' stamp, to which odometry and truth are interpolated
    odometry  ``Odometry``
    scan      ``Scan`` and / or
    features  ``Features``
    truth     optional (3,) T_world_robot, for evaluation only
    labels    optional ``BeamLabels``, for evaluation only
    """

    stamp_ns: int
    odometry: Odometry
    scan: Scan | None = None
    features: Features | None = None
    truth: Float | None = None
    labels: BeamLabels | None = None

    def __post_init__(self) -> None:
        set_fields(self, stamp_ns=stamp("Frame", self.stamp_ns))
        sensed = self.scan if self.scan is not None else self.features
        if self.odometry.stamp_ns != self.stamp_ns or (
            sensed is not None and sensed.stamp_ns != self.stamp_ns
        ):
            raise InvalidValueError(
                "Frame.stamp_ns must be that of its odometry and of its scan (or features), "
                f"got {self.stamp_ns} ns beside {self.odometry.stamp_ns} ns"
                + ("" if sensed is None else f" and {sensed.stamp_ns} ns")
            )
        if self.truth is not None:
            set_fields(self, truth=pose("Frame", "truth", self.truth))
        if self.labels is not None and (
            self.scan is None or len(self.labels.body) != self.scan.spec.n_beams
        ):
            raise InvalidValueError("Frame.labels must have one entry per beam of Frame.scan")

    @property
    def stamp(self) -> float:
        """Seconds."""
        return to_s(self.stamp_ns)

    def without_truth(self) -> "Frame":
        """The same frame as a robot would get it: no truth, no labels, no feature identities."""
        features = self.features
        if features is not None and features.ids is not None:
            features = replace(features, ids=None)
        return replace(self, features=features, truth=None, labels=None)


@dataclass(frozen=True, kw_only=True)
class StreamMetadata:
    """Where frames come from.

    source  "simulation", "carmen", "rosbag2", ...; ``scene`` and ``seed`` for simulations
    laser   the scanner, None for feature streams; ``robot`` its name or preset
    truth   what ``Frame.truth`` is: "simulator", "corrected poses of the log", "" for none
    mounting  where ``laser.T_robot_laser`` comes from, in words; "" where it is assumed
    odometry  False where nobody measured it: ``Frame.odometry`` stands still, and ``Replay`` gives
            each SLAM that of a constant velocity
    others  of the robot's further scanners, whose scans are among the frames
    extra   JSON-serialisable facts (path, counts of repaired lines, ...); ``EPOCH`` among them is
            what the stamps of the recording are more than those of the frames, ns
    """

    source: str
    scene: str | None = None
    seed: int | None = None
    laser: LaserSpec | None = None
    robot: str | None = None
    truth: str = ""
    mounting: str = ""
    odometry: bool = True
    others: tuple["StreamMetadata", ...] = ()
    extra: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class Stream:
    """An iterable of ``Frame`` with ``metadata``; iterating again replays it from the start.

    ``frames`` is called at each iteration and returns a fresh iterator; ``length`` is the number of
    frames where known beforehand.
    """

    metadata: StreamMetadata
    frames: Callable[[], Iterable[Frame]]
    length: int | None = None

    def __iter__(self) -> Iterator[Frame]:
        return iter(self.frames())

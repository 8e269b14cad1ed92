# SPDX-License-Identifier: Apache-2.0
"""A bag's scanner and odometry: geometry, beam times, mounting, poses at the times of its scans."""

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slam import se2
from slam.checked import possible
from slam.errors import InvalidValueError
from slam.frames import NS_PER_S, Float, LaserSpec, Scan
from slam.logs.ros_numbers import round_angle, round_number, round_period


def stamp_of(message: Any, log_ns: int) -> int:
    """Of the header; drivers that leave it empty get the time of the log."""
    stamp = message.header.stamp
    return int(stamp.sec) * NS_PER_S + int(stamp.nanosec) or log_ns


@dataclass(slots=True)
class Stamped:
    """A pose at a time, with what an odometry message also says."""

    stamp_ns: int
    pose: Float
    twist: Float | None = None
    covariance: Float | None = None


class PoseTrack:
    """The last poses of a topic; forgets what lies before the last time that was asked for."""

    def __init__(self) -> None:
        self._poses: deque[Stamped] = deque()

    def add(self, now: Stamped) -> None:
        """Append; a pose that is not later than the one before is left out."""
        if not self._poses or now.stamp_ns > self._poses[-1].stamp_ns:
            self._poses.append(now)

    def reaches(self, stamp_ns: int) -> bool:
        """Whether ``at`` knows that time, as far as the end is concerned."""
        return bool(self._poses) and self._poses[-1].stamp_ns >= stamp_ns

    def at(self, stamp_ns: int) -> Stamped | None:
        """The pose at that time: as recorded, or on the arc between its neighbours."""
        poses = self._poses
        while len(poses) > 1 and poses[1].stamp_ns <= stamp_ns:
            poses.popleft()
        if not poses or poses[0].stamp_ns > stamp_ns:
            return None
        before = poses[0]
        if before.stamp_ns == stamp_ns:
            return before
        if len(poses) == 1:
            return None
        after = poses[1]
        part = (stamp_ns - before.stamp_ns) / (after.stamp_ns - before.stamp_ns)
        return Stamped(
            stamp_ns=stamp_ns,
            pose=se2.interpolate(before.pose, after.pose, part),
            twist=_between(before.twist, after.twist, part),
            covariance=_between(before.covariance, after.covariance, part),
        )


def _between(before: Float | None, after: Float | None, part: float) -> Float | None:
    if before is None or after is None:
        return None
    return before + part * (after - before)


def increment_covariance(before: Stamped | None, now: Stamped) -> Float | None:
    """(3, 3) of the motion between two poses, from covariances that accumulate along the way.

    nav_msgs/Odometry states P, the covariance of the pose in the odom frame. With the Jacobians F
    and G of composing a pose with a motion, P_now = F P_before F' + G Q G' defines Q, the
    covariance of the motion in the frame of the robot before it. Many drivers publish one constant
    instead of an accumulated covariance: where P does not change, nothing is known (None).
    Rounding can leave variances below zero: they are set to zero, and so are covariances that are
    then too large, and those with the heading where not all three can be.
    """
    if before is None or before.covariance is None or now.covariance is None:
        return None
    P, P_now = before.covariance, now.covariance
    if not (np.isfinite(P).all() and np.isfinite(P_now).all()) or np.array_equal(P, P_now):
        return None
    theta = float(before.pose[2])
    dx, dy = (now.pose[:2] - before.pose[:2]).tolist()
    carry = [[1.0, 0.0, -dy], [0.0, 1.0, dx], [0.0, 0.0, 1.0]]
    c, s = math.cos(theta), math.sin(theta)
    turn = [[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]
    left = P_now - _sandwich(carry, P)
    return _possible(_sandwich(turn, 0.5 * (left + left.T)))


def _sandwich(A: list[list[float]], P: Float) -> Float:
    """A P A' by hand: NumPy's matmul changes its last bit with the CPU."""
    rows, inner = range(3), P.tolist()
    AP = [[sum(A[i][k] * inner[k][j] for k in rows) for j in rows] for i in rows]
    return np.array([[sum(AP[i][k] * A[j][k] for k in rows) for j in rows] for i in rows])


def _possible(Q: Float) -> Float:
    out = 0.5 * (Q + Q.T)
    for i in range(3):
        out[i, i] = max(out[i, i], 0.0)
    for i in range(3):
        for j in range(i):
            limit = math.sqrt(float(out[i, i])) * math.sqrt(float(out[j, j]))
            out[i, j] = out[j, i] = min(max(out[i, j], -limit), limit)
    (xx, xy, xt), (_, yy, yt), (_, _, tt) = out.tolist()
    if not possible(xx, xy, yy, xt, yt, tt):  # three correlations that cannot be at once
        out[:2, 2] = out[2, :2] = 0.0
    return out


FARTHEST_M = 1e4
MAX_BEAMS = 100_000
MOST_SHAPES = 1000  # headers of a scanner that are kept


class Laser:
    """Turns sensor_msgs/LaserScan messages into scans.

    first    the first whole scan
    turns    its messages of single mirror turns, where there are any: they say when each beam was
    mount    ``T_robot_laser`` and whether the scanner hangs upside down
    saturates  a range of range_max is none

    Beams that count clockwise are put in counter-clockwise order; ``turned`` says so. A range
    below zero (too close, REP 117) becomes NaN. Raises ``InvalidValueError`` for a geometry that
    cannot be.
    """

    def __init__(
        self,
        first: Any,
        turns: Sequence[Any],
        mount: tuple[Float, bool],
        *,
        saturates: bool = False,
    ) -> None:
        self._mount, self._saturates = mount, saturates
        step = round_angle(first.angle_increment)
        clockwise, hangs = "clockwise" if step < 0.0 else "", "upside down" if mount[1] else ""
        self.turned = ", ".join(filter(None, (clockwise, hangs)))
        times = _turn_times(first, turns) if turns else None
        self._known = {shape_of(first): self._read(first, times)}
        self.spec = self._known[shape_of(first)].spec

    def _read(self, message: Any, times: Float | None = None) -> "_Geometry":
        """What a scan's header says; ``times``: (n,) s of its beams, unless that says it, too."""
        n = len(message.ranges)
        if not 0 < n <= MAX_BEAMS:
            raise InvalidValueError(f"a scan of {n} beams")
        T_robot_laser, hanging = self._mount
        start, step = round_angle(message.angle_min), round_angle(message.angle_increment)
        times = _line_times(message) if times is None else times
        backwards = (step < 0.0) != hanging
        earliest_ns = round(float(times.min()) * NS_PER_S)
        if hanging:
            start, step = -start, -step
        if backwards:
            start, step, times = start + (n - 1) * step, -step, times[::-1]
        range_max = round_number(message.range_max)
        spec = LaserSpec(
            n_beams=n,
            angle_min=start,
            angle_increment=step,
            range_min=max(round_number(message.range_min), 0.0),
            range_max=min(range_max, FARTHEST_M),
            beam_time_offsets=times - times.min(),
            T_robot_laser=T_robot_laser,
        )
        return _Geometry(spec, backwards, earliest_ns)

    def scan(self, message: Any, stamp_ns: int) -> Scan:
        """Each by its own header; ``InvalidValueError`` for what no scanner can be."""
        shape = shape_of(message)
        if shape not in self._known:
            if len(self._known) >= MOST_SHAPES:
                self._known.clear()
            self._known[shape] = self._read(message)
        geometry = self._known[shape]
        ranges = message.ranges
        if (ranges < 0.0).any():
            ranges = np.where(ranges < 0.0, np.float32(np.nan), ranges)
        if self._saturates:
            ranges = np.where(ranges == message.range_max, np.float32(np.inf), ranges)
        intensities: NDArray[np.float32] | None = message.intensities
        if intensities is not None and len(intensities) != len(ranges):
            intensities = None
        if geometry.backwards:
            ranges = ranges[::-1]
            intensities = None if intensities is None else intensities[::-1]
        return Scan(
            stamp_ns=stamp_ns + geometry.earliest_ns,
            ranges=ranges,
            spec=geometry.spec,
            intensities=intensities,
        )


@dataclass(frozen=True, slots=True)
class _Geometry:
    """Of the scans of one header; ``backwards``: their beams are turned round."""

    spec: LaserSpec
    backwards: bool
    earliest_ns: int


def shape_of(message: Any) -> tuple[int, float, float, float]:
    """What the header of a scan says of the scanner."""
    return (
        len(message.ranges),
        message.angle_min,
        message.angle_increment,
        message.range_max,
    )


def _line_times(message: Any) -> Float:
    """(n,) s of beams measured one after another."""
    step = float(message.time_increment)
    if not math.isfinite(step) or abs(step) > 1.0:
        raise InvalidValueError(f"time_increment of {step} s")
    period = _mirror_period(message)
    count: Float = np.arange(len(message.ranges), dtype=np.float64)
    if period > 0.0:
        return count * abs(_degrees(message.angle_increment)) / 360.0 * period
    return count * step


def _turn_times(whole: Any, turns: Sequence[Any]) -> Float:
    """(n,) s after the stamp of the whole scan, from the messages of its turns.

    A scanner whose beam times follow from its mirror (time_increment is the share of scan_time
    that angle_increment is of a whole turn) has them exactly: (turn + angle / 360 degrees) turns.
    """
    n = len(whole.ranges)
    times = np.full(n, np.nan)
    start_ns, start_deg = _stamp_ns(whole), _degrees(whole.angle_min)
    step_deg = _degrees(whole.angle_increment)
    for message in turns:
        period = _mirror_period(message)
        first = round((_degrees(message.angle_min) - start_deg) / step_deg)
        stride = round(_degrees(message.angle_increment) / step_deg)
        beams = first + stride * np.arange(len(message.ranges))
        if stride < 1 or first < 0 or beams[-1] >= n:
            raise InvalidValueError("a mirror turn has beams that its whole scan has not")
        after_s = (_stamp_ns(message) - start_ns) / NS_PER_S
        if period > 0.0:
            angles = start_deg + beams * step_deg
            turn = round(after_s / period - first * abs(step_deg) / 360.0)
            times[beams] = (turn + np.abs(angles - start_deg) / 360.0) * period
        else:
            times[beams] = after_s + np.arange(len(beams)) * float(message.time_increment)
    if np.isnan(times).any():
        return _line_times(whole)
    return times


def _mirror_period(message: Any) -> float:
    """s of a turn, where the message's three time and angle fields agree on it; else 0."""
    period = round_period(message.scan_time)
    share = abs(float(message.angle_increment)) / math.tau
    if period <= 0.0 or not math.isclose(
        float(message.time_increment), period * share, rel_tol=1e-5
    ):
        return 0.0
    return period


def _degrees(angle: float) -> float:
    """Degrees, round where the angle is."""
    return round(math.degrees(round_angle(angle)), 9)


def _stamp_ns(message: Any) -> int:
    return int(message.header.stamp.sec) * NS_PER_S + int(message.header.stamp.nanosec)

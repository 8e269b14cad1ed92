# SPDX-License-Identifier: Apache-2.0
"""A scanner from its messages: geometry, beam times of an interlaced scan, where it is mounted."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slam.errors import InvalidValueError
from slam.frames import NS_PER_S, Float, LaserSpec, Scan
from slam.logs.ros_numbers import round_angle, round_number, round_period, yaw_of

FARTHEST_M = 1e4
MAX_BEAMS = 100_000
Matrix = list[list[float]]


class Laser:
    """Turns sensor_msgs/LaserScan messages into scans.

    first    the first whole scan
    turns    its messages of single mirror turns, where there are any: they say when each beam was
    mount    ``T_robot_laser`` and whether the scanner hangs upside down

    Beams that count clockwise are put in counter-clockwise order; ``turned`` says so. A range
    below zero (too close, REP 117) becomes NaN. Raises ``InvalidValueError`` for a geometry that
    cannot be.
    """

    def __init__(self, first: Any, turns: Sequence[Any], mount: tuple[Float, bool]) -> None:
        n = len(first.ranges)
        if not 0 < n <= MAX_BEAMS:
            raise InvalidValueError(f"a scan of {n} beams")
        self._shape = _shape(first)
        T_robot_laser, hanging = mount
        start, step = round_angle(first.angle_min), round_angle(first.angle_increment)
        times = _turn_times(first, turns) if turns else _line_times(first)
        self._backwards = (step < 0.0) != hanging
        clockwise, hangs = "clockwise" if step < 0.0 else "", "upside down" if hanging else ""
        self.turned = ", ".join(filter(None, (clockwise, hangs)))
        self._earliest_ns = round(float(times.min()) * NS_PER_S)
        if hanging:
            start, step = -start, -step
        if self._backwards:
            start, step, times = start + (n - 1) * step, -step, times[::-1]
        range_max = round_number(first.range_max)
        self.spec = LaserSpec(
            n_beams=n,
            angle_min=start,
            angle_increment=step,
            range_min=max(round_number(first.range_min), 0.0),
            range_max=min(range_max, FARTHEST_M),
            beam_time_offsets=times - times.min(),
            T_robot_laser=T_robot_laser,
        )

    def scan(self, message: Any, stamp_ns: int) -> Scan:
        """``InvalidValueError`` when the scanner is another one than at first."""
        if _shape(message) != self._shape:
            raise InvalidValueError(
                f"the scanner changes from {self._shape} to {_shape(message)} "
                "(beams, angle_min, angle_increment, range_max)"
            )
        ranges = message.ranges
        if (ranges < 0.0).any():
            ranges = np.where(ranges < 0.0, np.float32(np.nan), ranges)
        intensities: NDArray[np.float32] | None = message.intensities
        if intensities is not None and len(intensities) != len(ranges):
            intensities = None
        if self._backwards:
            ranges = ranges[::-1]
            intensities = None if intensities is None else intensities[::-1]
        return Scan(
            stamp_ns=stamp_ns + self._earliest_ns,
            ranges=ranges,
            spec=self.spec,
            intensities=intensities,
        )


def _shape(message: Any) -> tuple[int, float, float, float]:
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


def mounting(
    transforms: Mapping[tuple[str, str], Any], robot: str, laser: str
) -> tuple[Float, bool] | None:
    """``T_robot_laser`` and whether the laser hangs upside down; None without a way to it.

    transforms  (parent, child) -> geometry_msgs/Transform
    """
    chain = _chain(transforms, robot, laser)
    if chain is None:
        return None
    chain = [link for link in chain if not _is_identity(link)] or chain[:1]
    if len(chain) == 1:
        t, q = chain[0].translation, chain[0].rotation
        if q.x == 0.0 and q.y == 0.0:
            return np.array([t.x, t.y, yaw_of(q.x, q.y, q.z, q.w)]), False
    turn: Matrix = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
    at = [0.0, 0.0, 0.0]
    for link in chain:
        t = (link.translation.x, link.translation.y, link.translation.z)
        at = [at[i] + sum(turn[i][k] * t[k] for k in range(3)) for i in range(3)]
        step = _matrix(link.rotation)
        turn = [
            [sum(turn[i][k] * step[k][j] for k in range(3)) for j in range(3)] for i in range(3)
        ]
    yaw = math.atan2(turn[1][0], turn[0][0])
    return np.array([at[0], at[1], yaw]), turn[2][2] < 0.0


def _is_identity(link: Any) -> bool:
    t, q = link.translation, link.rotation
    return (t.x, t.y, t.z, q.x, q.y, q.z, q.w) == (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)


def _chain(transforms: Mapping[tuple[str, str], Any], robot: str, laser: str) -> list[Any] | None:
    """The transforms from robot down to laser, by breadth-first search."""
    ways: dict[str, list[Any]] = {robot: []}
    rim = [robot]
    while rim:
        here = rim.pop(0)
        for (parent, child), transform in transforms.items():
            if parent == here and child not in ways:
                ways[child] = [*ways[here], transform]
                rim.append(child)
    return ways.get(laser) if laser != robot else None


def _matrix(q: Any) -> Matrix:
    x, y, z, w = q.x, q.y, q.z, q.w
    norm = x * x + y * y + z * z + w * w
    if not (math.isfinite(norm) and norm > 1e-12):
        raise InvalidValueError("a transform with a quaternion of length zero")
    s = 2.0 / norm
    return [
        [1.0 - s * (y * y + z * z), s * (x * y - z * w), s * (x * z + y * w)],
        [s * (x * y + z * w), 1.0 - s * (x * x + z * z), s * (y * z - x * w)],
        [s * (x * z - y * w), s * (y * z + x * w), 1.0 - s * (x * x + y * y)],
    ]

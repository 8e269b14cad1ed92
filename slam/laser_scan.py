# SPDX-License-Identifier: Apache-2.0
"""A ``Scan`` under the names of sensor_msgs/LaserScan (ROS), and the turns of its mirror."""

import math
from typing import TYPE_CHECKING

import numpy as np

from slam.errors import InvalidValueError

if TYPE_CHECKING:
    from slam.frames import LaserSpec


class LaserScanNames:
    """Of a ``Scan``, to be read only; ``ranges`` and ``intensities`` are fields of its own.

    ``ranges[i]`` lies in the direction ``angle_min + i * angle_increment``, also of an interlaced
    scan. Beams run counter-clockwise, also where the mirror turns the other way.
    """

    spec: "LaserSpec"

    @property
    def angle_min(self) -> float:
        """rad, direction of the first beam in the frame of the laser."""
        return self.spec.angle_min

    @property
    def angle_max(self) -> float:
        """rad, direction of the last beam."""
        return float(self.spec.angles[-1])

    @property
    def angle_increment(self) -> float:
        """rad from beam to beam, > 0."""
        return self.spec.angle_increment

    @property
    def range_min(self) -> float:
        """m; a return that is nearer is no valid measurement."""
        return self.spec.range_min

    @property
    def range_max(self) -> float:
        """m; a return from beyond is none either."""
        return self.spec.range_max

    @property
    def scan_time(self) -> float:
        """s of all mirror turns of a scan; 0 where the beams have no times."""
        turns = turns_of(self.spec)
        return turns * turn_time_s(self.spec, turns)

    @property
    def time_increment(self) -> float:
        """s from beam to beam; 0 where the beams have no times.

        Raises ``InvalidValueError`` where one number cannot tell: the scan is interlaced, or its
        mirror turns clockwise.
        """
        if turns_of(self.spec) > 1 or is_clockwise(self.spec):
            raise InvalidValueError(
                "Scan.time_increment: these beams were not measured one after the other, "
                "counter-clockwise; Scan.spec.beam_time_offsets has the time of each"
            )
        return time_increment(self.scan_time, self.angle_increment)


def time_increment(scan_time: float, angle_increment: float) -> float:
    """s from beam to beam, either way round, as ROS's driver of the SICK states it."""
    return scan_time / math.tau * abs(angle_increment)


def turns_of(spec: "LaserSpec") -> int:
    """Mirror turns of a scan: the beams of each turn are every n-th, evenly spaced in time.

    Raises ``InvalidValueError`` for beam times that no number of turns explains.
    """
    offsets_ns = np.round(spec.beam_time_offsets * 1e9)
    if is_clockwise(spec):
        offsets_ns = offsets_ns[::-1]
    for turns in range(1, min(9, spec.n_beams + 1)):
        steps = offsets_ns[turns:] - offsets_ns[:-turns]
        if steps.size == 0 or (steps.min() >= 0.0 and steps.max() - steps.min() <= 2.0):
            return turns
    raise InvalidValueError("LaserSpec.beam_time_offsets are not those of a turning mirror")


def is_clockwise(spec: "LaserSpec") -> bool:
    """Whether the leftmost beam is measured first: such a scan is written clockwise."""
    return bool(spec.beam_time_offsets[0] > spec.beam_time_offsets[-1])


def turn_time_s(spec: "LaserSpec", turns: int) -> float:
    """Seconds of one turn of the mirror; 0 where the beams have no times."""
    if spec.n_beams <= turns:
        return 0.0
    last = ((spec.n_beams - 1) // turns) * turns
    offsets = spec.beam_time_offsets[::-1] if is_clockwise(spec) else spec.beam_time_offsets
    sweep = float(offsets[last])
    if sweep <= 0.0:
        return 0.0
    turn = sweep * math.tau / (last * spec.angle_increment)
    for digits in range(9):  # offsets are whole nanoseconds: the roundest rate that they can mean
        rate = round(1.0 / turn, digits)
        if rate > 0.0 and abs(1.0 / rate - turn) <= turn * 1e-9 / sweep:
            return 1.0 / rate
    return turn

# SPDX-License-Identifier: Apache-2.0
"""The Slamtec RPLIDAR A1 (A1M8): all round at 1 degree, 5.5 turns a second, clockwise.

DS is Slamtec's data sheet of the A1M8 (2013-2016, 16 pages); IP the interface protocol of A1 and
A2; ROS the driver rplidar_ros, which puts heading 0 of the device at the rear of its frame.

Its statistical error is not stated, only a distance resolution: "< 1 % of the distance". The model
takes the error that follows from that and nothing more: a value that is known to one part in
hundred is off by 1 % / sqrt(12) of itself, one sigma. Not stated either: a systematic error, the
spot, reflectivities. So there are no mixed pixels: no size of the spot was found. It measures by
triangulation besides, where two surfaces under one spot do not mix as echoes do. Panes and mirrors
are simulated, as for every scanner, by their optics.
"""

import math

from sim.sensors.lidar.registry import register
from sim.sensors.lidar.scanner import Band, Scanner
from sim.sensors.lidar.sheet import NOT_STATED, Stated

FINE_M = 0.0005  # resolution below 1.5 m, DS p7
COARSE = 0.01  # of the distance, everywhere, DS p7
ROUNDED = 1.0 / math.sqrt(12.0)  # deviation of what is known to within 1

SHEET = (
    Stated("field_of_view_deg", 360.0, "0-360°", "DS p7: angular range"),
    Stated("n_beams", 360, "360 samples per scan", "DS p7: scan rate, comment"),
    Stated("step_deg", 1.0, "1° at 5.5 Hz", "DS p7: angular resolution"),
    Stated("direction", "clockwise", "heading rises clockwise", "IP fig. 4-6; ROS"),
    Stated("rate_hz", 5.5, "5.5 Hz typical, 1 to 10", "DS p7: scan rate"),
    Stated("beam_to_beam_us", 1e6 / 1980, "0.5 ms", "DS p7: sample duration", within=0.02),
    Stated("range_min_m", 0.15, "0.15 m", "DS p7: distance range, white objects"),
    Stated("range_max_m", 12.0, "12 m", "DS p7: distance range, white objects"),
    Stated("noise_m", FINE_M * ROUNDED, "resolution < 0.5 mm, < 1.5 m; σ not stated", "DS p7",
           at_m=1.0),
    Stated("noise_m", COARSE * ROUNDED * 6.0, "resolution < 1 % of the distance; σ not stated",
           "DS p7", at_m=6.0),
    Stated("systematic_m", None, NOT_STATED, ""),
    Stated("unit_m", 0.00025, "distance_q2 / 4 mm", "IP fig. 4-5"),
    Stated("too_near", "NaN", "distance 0: the measurement is invalid", "IP fig. 4-5"),
    Stated("no_return", "inf", "distance 0 becomes inf", "ROS"),
    Stated("spot", None, NOT_STATED, ""),
)  # fmt: skip


@register("rplidar_a1")
def rplidar_a1() -> Scanner:
    """Slamtec RPLIDAR A1: 360 degrees, 1 degree, 5.5 Hz, 12 m."""
    return Scanner(
        name="rplidar_a1",
        first_deg=-179.0,
        step_deg=1.0,
        n_beams=360,
        rate_hz=5.5,
        clockwise=True,
        range_min_m=0.15,
        range_max_m=12.0,
        unit_m=0.00025,
        noise=(
            Band(up_to_m=1.5, error_m=FINE_M * ROUNDED),
            Band(up_to_m=12.0, error_m=0.0, share=COARSE * ROUNDED),
        ),
        glass=True,
        bounce=True,
    )

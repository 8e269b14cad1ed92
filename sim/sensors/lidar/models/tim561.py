# SPDX-License-Identifier: Apache-2.0
"""The SICK TiM561: 270 degrees at 1/3 degree, 15 scans a second, 10 m.

OI is SICK's operating instructions TiM55x/TiM56x, 8015886/YDR0/2014-08-27; TI the technical
information TiM55x/56x/57x, 8015883/YZK8/2016-07-07; OI3 the operating instructions TiM3xx,
8024851/2021-07-21; SDP the table of devices of SICK's driver (SICKAG/sick_scan_xd, README.md), part
no. 1071419.

The size of the spot is not in OI or TI. OI3 p16 states it for the TiM of 1/3 degree: 7 mm at the
cover, 8.6 mrad high, and 5.8 mrad wider because a value is made of several pulses (HDDM). Those of
the TiM4xx (8026151/2020-11-15, p14) and TiM8xxP (8024355/2019-09-30, p15) state the same. That the
TiM561 has the same optics is inferred. The value sent is of the first echo (TI p25). A pulse lasts
5 ns at the most (OI p4), 0.75 m there and back. Echoes that overlap mix as in the receiver of the
LMS-221 (inferred).

Not stated in the pages read: the least range, reflectivities needed for a return, the direction of
the mirror (starting angle and step count upwards, hence counter-clockwise). Panes and mirrors are
simulated, as for every scanner, by their optics (inferred).
"""

from sim.sensors.lidar.registry import register
from sim.sensors.lidar.scanner import Band, Scanner, disc
from sim.sensors.lidar.sheet import NOT_STATED, Stated

# Radius 3.5 mm at the cover, half angles 7.2 mrad sideways and 4.3 mrad upwards, OI3 p16.
SPOT = disc(aperture=0.0035, divergence=0.0072, aspect=4.3 / 7.2)
PULSE_M = 0.75  # m, of 5 ns there and back, OI p4

SHEET = (
    Stated("field_of_view_deg", 270.0, "-45° to +225°", "TI p25: starting angle"),
    Stated("n_beams", 811, "270° at 1080 a turn", "TI p25: 16.2 kHz from spot to spot"),
    Stated("step_deg", 1.0 / 3.0, "0.33° (1/3 of 1°)", "TI p25; SDP"),
    Stated("rate_hz", 15.0, "15 Hz", "TI p22, p25; SDP"),
    Stated("beam_to_beam_us", 1e6 / 16_200, "16.2 kHz from spot to spot", "TI p25"),
    Stated("range_min_m", None, NOT_STATED, ""),
    Stated("range_max_m", 10.0, "10 m", "SDP: max. range"),
    Stated("noise_m", 0.020, "20 mm, one sigma, typically", "OI p4: statistical", at_m=5.0),
    Stated("systematic_m", 0.060, "± 60 mm, typically", "OI p4: systematic", at_m=5.0),
    Stated("unit_m", None, NOT_STATED + "; 1 mm as LMDscandata of that family", "inferred"),
    Stated(
        "spot_width_m",
        0.0646,
        "7 mm + 14.4 mrad (8.6 + 5.8)",
        "OI3 p16: light spot width",
        at_m=4.0,
    ),
    Stated("spot_height_m", 0.0414, "7 mm + 8.6 mrad", "OI3 p16: light spot height", at_m=4.0),
)


@register("tim561")
def tim561() -> Scanner:
    """SICK TiM561: 270 degrees, 1/3 degree, 15 Hz, 10 m."""
    return Scanner(
        name="tim561",
        first_deg=-135.0,
        step_deg=1.0 / 3.0,
        n_beams=811,
        rate_hz=15.0,
        range_max_m=10.0,
        unit_m=0.001,
        noise=(Band(up_to_m=10.0, error_m=0.020),),
        systematic=(Band(up_to_m=10.0, error_m=0.060),),
        spot=SPOT,
        mixed_pixels=True,
        pulse_m=PULSE_M,
        glass=True,
        bounce=True,
    )

# SPDX-License-Identifier: Apache-2.0
"""The Hokuyo UTM-30LX: 270 degrees at 0.25 degrees, 40 scans a second, counter-clockwise.

SPEC is Hokuyo's specification of the UTM-30LX, as Cacic's documentation quotes it (Gastd/cacic,
docs/source/laser.rst); EW that of the UTM-30LX-EW, the same head with Ethernet, by its field notes
(gist ricklentz/76db8e35). SCIP is Hokuyo's protocol SCIP 2.0, C-42-03320B.

Not stated there: the spot, reflectivities needed for a return, what is sent at edges. None of these
is simulated, so there are no mixed pixels either: no published divergence was found (that of the
UST-20LX is of another head). Panes and mirrors are, as for every scanner, by their optics
(inferred).
"""

from sim.sensors.lidar.registry import register
from sim.sensors.lidar.scanner import Band, Scanner
from sim.sensors.lidar.sheet import NOT_STATED, Stated

SHEET = (
    Stated("field_of_view_deg", 270.0, "270°", "SPEC: scan angle; SCIP p5 table 2: 270.25°"),
    Stated("n_beams", 1081, "1081: steps 0 to 1080", "SCIP p5 table 2"),
    Stated("step_deg", 0.25, "0.25° (360°/1440)", "SPEC; SCIP p5 table 2"),
    Stated("direction", "counter-clockwise", "anti-clockwise seen from above", "SCIP p5"),
    Stated("rate_hz", 40.0, "25 ms a scan", "SPEC: scan speed"),
    Stated("beam_to_beam_us", 25_000.0 / 1440, "25 ms / 1440", "SPEC and SCIP p5 table 2"),
    Stated("range_min_m", 0.1, "0.1 m", "SPEC: detection range"),
    Stated("range_max_m", 30.0, "30 m", "SPEC: detection range"),
    Stated("noise_m", 0.010, "σ < 10 mm, 0.1 to 10 m", "SPEC", at_m=5.0),
    Stated("noise_m", 0.030, "σ < 30 mm, 10 to 30 m", "SPEC", at_m=20.0),
    Stated("systematic_m", 0.030, "± 30 mm, 0.1 to 10 m", "EW: accuracy", at_m=5.0),
    Stated("systematic_m", 0.050, "± 50 mm, 10 to 30 m", "EW: accuracy", at_m=20.0),
    Stated("unit_m", 0.001, "distances are whole millimetres", "SCIP p21: DMIN, DMAX in mm"),
    Stated("too_near", "NaN", "error code 4: out of range at the near end", "SCIP p12 table 4"),
    Stated("no_return", "inf", "error code 1: no object in the range", "SCIP p12 table 4"),
    Stated("spot", None, NOT_STATED, ""),
)


@register("utm30lx")
def utm30lx() -> Scanner:
    """Hokuyo UTM-30LX: 270 degrees, 0.25 degrees, 40 Hz, 30 m."""
    return Scanner(
        name="utm30lx",
        first_deg=-135.0,
        step_deg=0.25,
        n_beams=1081,
        rate_hz=40.0,
        range_min_m=0.1,
        range_max_m=30.0,
        unit_m=0.001,
        noise=(Band(up_to_m=10.0, error_m=0.010), Band(up_to_m=30.0, error_m=0.030)),
        systematic=(Band(up_to_m=10.0, error_m=0.030), Band(up_to_m=30.0, error_m=0.050)),
        glass=True,
        bounce=True,
    )

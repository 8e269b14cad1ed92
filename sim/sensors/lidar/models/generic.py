# SPDX-License-Identifier: Apache-2.0
"""A scanner of no make: ``scanner(fov_deg=270, beams=541, rate_hz=20, sigma_m=0.01)``."""

from sim.sensors.lidar.registry import register
from sim.sensors.lidar.scanner import MAX_BEAMS, Band, Scanner
from slam.errors import InvalidValueError
from slam.shaped import Number, shaped, whole


@register("scanner")
def scanner(  # noqa: PLR0913 (settings of a model)
    *,
    fov_deg: float,
    beams: int,
    rate_hz: float,
    sigma_m: float,
    range_min_m: float = 0.0,
    range_max_m: float = 30.0,
    unit_m: float = 0.0,
) -> Scanner:
    """Any scanner: its field of view, beams, rate and noise, as its arguments say.

    fov_deg      field of view, more than 0 and at most 360
    beams        number of beams, at least 2
    rate_hz      scans per second
    sigma_m      statistical error, one sigma; 0: none
    range_min_m  least range
    range_max_m  largest range
    unit_m       step of the range code; 0: not rounded

    A mirror turns evenly, counter-clockwise, once a scan. At 360 degrees the first and the last
    beam are a step apart, else they are the two ends of the field of view.

    Raises ``InvalidValueError`` that names the setting, its value and what was expected.
    """
    whole("scanner: beams", beams, 2, MAX_BEAMS)
    shaped("scanner: fov_deg", fov_deg, Number)
    shaped("scanner: sigma_m", sigma_m, Number)
    if not 0.0 < fov_deg <= 360.0:
        raise InvalidValueError(f"scanner: fov_deg must be > 0 and at most 360, got {fov_deg}")
    step_deg = fov_deg / (beams if fov_deg == 360.0 else beams - 1)
    return Scanner(
        name="scanner",
        first_deg=-0.5 * fov_deg if fov_deg < 360.0 else -180.0,
        step_deg=step_deg,
        n_beams=beams,
        rate_hz=rate_hz,
        range_min_m=range_min_m,
        range_max_m=range_max_m,
        unit_m=unit_m,
        noise=(Band(up_to_m=range_max_m, error_m=sigma_m),) if sigma_m else (),
    )

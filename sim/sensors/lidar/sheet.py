# SPDX-License-Identifier: Apache-2.0
"""What a scanner's data sheet states, row by row: ``SHEET`` of a model's file.

``mobilia sensor-card --scanner NAME`` measures the simulated scanner against these rows.
"""

import sys
from dataclasses import dataclass

from sim.sensors.lidar import registry

NOT_STATED = "not stated"
QUANTITIES = {
    "field_of_view_deg": "field of view",
    "n_beams": "beams in a scan",
    "step_deg": "angle from beam to beam",
    "direction": "direction of the mirror",
    "rate_hz": "scans per second",
    "beam_to_beam_us": "time from beam to beam",
    "range_min_m": "least range",
    "range_max_m": "largest range",
    "noise_m": "statistical error, one sigma",
    "systematic_m": "systematic error, bound",
    "unit_m": "step of the range code",
    "too_near": "sent when too near",
    "no_return": "sent without a return",
    "spot": "spot of a beam",
    "spot_width_m": "width of the spot",
    "spot_height_m": "height of the spot",
}


@dataclass(frozen=True)
class Stated:
    """One row of a data sheet.

    what    one of ``QUANTITIES``
    value   as a number, or a word; None where the sheet states none
    text    the sheet's own words
    source  document, page, table
    at_m    range at which it holds, m
    within  by which share the simulated scanner may differ; None: by what is usual of the quantity
    """

    what: str
    value: float | str | None
    text: str
    source: str
    at_m: float | None = None
    within: float | None = None


def sheet_of(name: str) -> tuple[Stated, ...]:
    """The rows in the file of a registered model; none where it has no ``SHEET``."""
    module = sys.modules[registry.model_of(name).__module__]
    rows: tuple[Stated, ...] = getattr(module, "SHEET", ())
    return rows

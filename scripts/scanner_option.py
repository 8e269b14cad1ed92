# SPDX-License-Identifier: Apache-2.0
"""``--scanner``, the same on every verb that simulates."""

from __future__ import annotations

from typing import Annotated

import typer

LMS221_HZ = 37.5  # the rate for which the usual numbers of scans are chosen

Scanner = Annotated[
    str,
    typer.Option(
        help="Which scanner, and which of its errors: utm30lx, tim561:noise, "
        "'scanner(fov_deg=270, beams=541, rate_hz=20, sigma_m=0.01)'; full, noise (statistical "
        "only) and ideal are the LMS-221's."
    ),
]


def rate_hz(scanner: str) -> float:
    """Scans per second; the errors of ``scanner_of`` for a name that is not known."""
    from sim.sensors.lidar.registry import scanner_of  # numpy, and every model

    return 1.0 / float(scanner_of(scanner).scanner().period_s)


def every_of(scanner: str, every: int | None, of_lms221: int) -> int:
    """One scan in so many: as asked, else as often in time as one in ``of_lms221`` of the LMS."""
    return every if every is not None else max(1, round(of_lms221 * rate_hz(scanner) / LMS221_HZ))

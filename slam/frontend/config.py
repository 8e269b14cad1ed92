# SPDX-License-Identifier: Apache-2.0
"""The numbers of the front end that may be set; the others stand beside their equations."""

from dataclasses import dataclass, field

from slam.settings import Settings, number

UMBMARK = "Borenstein and Feng 1996 (UMBmark)"


@dataclass(frozen=True, kw_only=True)
class BiasConfig(Settings):
    """What odometry adds to the heading by itself."""

    per_m: float = number(0.012, "rad/m", "heading bias among robots, 1 σ, by distance", UMBMARK)
    per_rad: float = number(0.03, "rad/rad", "heading bias among robots, 1 σ, by turn", UMBMARK)


@dataclass(frozen=True, kw_only=True)
class FrontendConfig(Settings):
    """Observations as Gaussians, and what they are made from."""

    sigma_cells: float = number(
        0.8, "cells", "least Gaussian that the lattice carries", "ripple 2 exp(-π²σ²) = 0.4 %",
        low=0.3, high=4.0,
    )  # fmt: skip
    sensor_sigma_m: float = number(
        0.010, "m", "deviation of a range, if the scanner states none", "data sheet of the LMS-221",
        low=1e-6,
    )  # fmt: skip
    bias: BiasConfig = field(default=BiasConfig())


FRONTEND = FrontendConfig()

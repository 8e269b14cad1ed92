# SPDX-License-Identifier: Apache-2.0
"""The rules of a closed loop."""

from dataclasses import dataclass

from slam.settings import Settings, number, word


@dataclass(frozen=True, kw_only=True)
class LoopConfig(Settings):
    """What counts as what, and how often things are done.

    Ways are planned on the scene's static ``layout``, or on the SLAM's ``map``.
    """

    plan_on: str = word("layout", ("layout", "map"), "what ways are planned on")
    scans: int = number(4, "scans", "to one update and one command: 9.4 Hz", low=1, high=100)
    arrive_m: float = number(0.1, "m", "so near it believes to have arrived", low=1e-6, high=10.0)
    tolerance_m: float = number(0.5, "m", "so near it truly has", low=1e-6, high=10.0)
    patience_s: float = number(
        20.0, "s", "without believed progress: a goal is given up", low=1e-6, high=1e4
    )
    limit_s: float = number(90.0, "s", "after which it is in any case", low=1e-6, high=1e4)
    replan_s: float = number(
        1.0, "s", "between two plans, round what is seen standing in the way", low=1e-6, high=1e4
    )
    near_m: float = number(
        0.15, "m", "between rims of a person and the robot: a near miss", low=1e-6, high=10.0
    )

# SPDX-License-Identifier: Apache-2.0
"""The rules of a closed loop."""

from __future__ import annotations

from dataclasses import dataclass

from sim.core.checks import check_types, check_within, one_of
from slam.errors import InvalidValueError

PLANS = ("layout", "map")


@dataclass(frozen=True, kw_only=True)
class LoopConfig:
    """What counts as what, and how often things are done.

    plan_on      "layout": ways are planned on the scene's static layout; "map": on the SLAM's map
    scans        of the scanner to one update of the SLAM and one command (4: 9.4 Hz)
    arrive_m     the robot believes it has arrived when it believes to be this near
    tolerance_m  it truly has when it truly is this near
    patience_s   a goal is given up after this long without believed progress
    limit_s      and after this long in any case
    replan_s     a way is planned again this often, round what is seen standing in it
    near_m       a person whose rim comes this near the robot's, without a touch, is a near miss
    """

    plan_on: str = "layout"
    scans: int = 4
    arrive_m: float = 0.1
    tolerance_m: float = 0.5
    patience_s: float = 20.0
    limit_s: float = 90.0
    replan_s: float = 1.0
    near_m: float = 0.15

    def __post_init__(self) -> None:
        check_types(self)
        one_of("LoopConfig.plan_on", self.plan_on, PLANS)
        check_within(self, {"scans": (1, 100)})
        limits = {
            "arrive_m": 10.0, "tolerance_m": 10.0, "patience_s": 1e4, "limit_s": 1e4,
            "replan_s": 1e4, "near_m": 10.0,
        }  # fmt: skip
        for name, most in limits.items():
            if not 0.0 < getattr(self, name) <= most:
                raise InvalidValueError(
                    f"LoopConfig.{name} must lie in (0, {most:g}], got {getattr(self, name)}"
                )

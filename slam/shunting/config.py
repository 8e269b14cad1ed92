# SPDX-License-Identifier: Apache-2.0
"""The twelve knobs of the shunting SLAM, and its two presets.

Numbers that follow from a frame's own sensor (beam spacing, scan rate, odometry covariance, range)
are no knobs: they are read from the frame.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Literal, get_args

from slam.errors import InvalidValueError

Objective = Literal["sum", "log"]


@dataclass(frozen=True, kw_only=True)
class ShuntingConfig:
    """Everything a user may turn; the defaults are the preset ``robust()``.

    What a value does to the error was measured on training seeds of office, arena and arena without
    walls at 4.7 Hz; where no source is named, the default was chosen there.

    cell_m              edge of a neuron's square, m. Sets accuracy and cost: 0.05 is twice as
                        fast, 0.10 three times less accurate
    decay_per_s         A of Eq. (8), 1/s (paper: 0.8). Flat between 0.2 and 2
    lateral_sum         W, sum of a neuron's lateral weights (paper: < 0.2). Must stay below
                        ``decay_per_s``, else the empty map is unstable. 0 turns diffusion off: it
                        doubles the cost and gains nothing measurable
    lateral_reach_cells r0 of w = mu / d for 0 < d < r0 (paper), in cells. Flat
    threshold           sigma of Eq. (8): activities below it are dropped and do not spread. Flat
                        between 0.001 and 0.05; lower values keep more neurons alive
    trace_s             pace of the long-term trace, s of looking at a neuron (never less than
                        five looks); 0 turns the trace off (paper). Below 1 s things that move
                        together carry the robot along
    short_term_weight   share of the short-term activity in a neuron that has no long-term trace.
                        Flat between 0.1 and 0.3; 1 errs by 15 % more in rooms, 24 % without walls
    reward              weight of one fully overlapped observation against the odometry prior. Flat
                        between 2 and 12 in rooms; without walls 2 errs by 90 % more, 12 by 20 less
    reward_exponent     the weight falls with the matched fraction q as ``reward * q**exponent``.
                        0: never; above, half of the chairs moving without a wall in sight lead
                        astray (14 cm at 0, 18 at 1, 28 at 2), below 2 nothing gained
    objective           "sum": overlapped volumes, as the paper words it; "log": as Eq. (13) prints
    range_m             returns beyond are ignored, m. 8 errs by 70 % more in rooms
    freeze_below        nothing is written to the map while the matched fraction is below this
                        share of its usual value and the map in view is contradicted; 0: never.
                        Flat between 0 and 0.8 where nobody carries the robot off
    """

    cell_m: float = 0.03
    decay_per_s: float = 0.8
    lateral_sum: float = 0.0
    lateral_reach_cells: float = 1.5
    threshold: float = 0.01
    trace_s: float = 3.0
    short_term_weight: float = 0.3
    reward: float = 5.0
    reward_exponent: float = 0.0
    objective: Objective = "sum"
    range_m: float = 40.0
    freeze_below: float = 0.6

    def __post_init__(self) -> None:
        self._number("cell_m", 0.005, 1.0)
        self._number("decay_per_s", 1e-3, 100.0)
        self._number("lateral_sum", 0.0, math.inf)
        self._number("lateral_reach_cells", 1.0, 8.0)
        self._number("threshold", 1e-6, 0.5)
        self._number("trace_s", 0.0, 1e6)
        self._number("short_term_weight", 0.0, 1.0)
        self._number("reward", 1e-3, 1e3)
        self._number("reward_exponent", 0.0, 10.0)
        self._number("range_m", 0.5, 1000.0)
        self._number("freeze_below", 0.0, 1.0)
        if self.objective not in get_args(Objective):
            raise InvalidValueError(
                f"ShuntingConfig.objective must be 'sum' or 'log', got {self.objective!r}"
            )
        if not self.lateral_sum < self.decay_per_s:
            raise InvalidValueError(
                "ShuntingConfig.lateral_sum must be below decay_per_s (the empty map is unstable "
                f"otherwise), got {self.lateral_sum} and {self.decay_per_s}"
            )
        if self.trace_s == 0.0 and self.short_term_weight == 0.0:
            raise InvalidValueError(
                "ShuntingConfig.short_term_weight must be > 0 when trace_s is 0: nothing is left"
            )

    def _number(self, name: str, low: float, high: float) -> None:
        value = getattr(self, name)
        if isinstance(value, bool) or not isinstance(value, (int, float)) or math.isnan(value):
            raise InvalidValueError(f"ShuntingConfig.{name} must be a number, got {value!r}")
        if not low <= value <= high:
            raise InvalidValueError(
                f"ShuntingConfig.{name} must lie in [{low}, {high}], got {value}"
            )

    @classmethod
    def robust(cls, **changes: Any) -> ShuntingConfig:
        """The default: sum of overlaps, slow trace beside the short-term memory."""
        return cls(**changes)

    @classmethod
    def paper(cls, **changes: Any) -> ShuntingConfig:
        """The paper as printed: lateral diffusion, no trace, sum of logarithms, map never frozen.

        Decisions where it is ambiguous: A is per second, one sweep a scan (converging would erase
        the memory), d(x) = max(x - sigma, 0) (the printed one excites the whole empty plane), and
        logarithms of overlap + 0.1 tempered by 0.3, because beams are not independent.
        """
        printed: dict[str, Any] = {
            "lateral_sum": 0.19,
            "trace_s": 0.0,
            "short_term_weight": 1.0,
            "reward": 0.3,
            "reward_exponent": 0.0,
            "objective": "log",
            "freeze_below": 0.0,
        }
        return cls(**(printed | changes))

    @property
    def saturation(self) -> float:
        """x* of Eq. (8) for a constant full input I = 1: no activity exceeds it for long."""
        return 1.0 / (1.0 + self.decay_per_s)

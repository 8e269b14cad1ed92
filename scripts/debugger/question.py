# SPDX-License-Identifier: Apache-2.0
"""What a counterfactual is asked: a divergence, how far before and after it, how often."""

import math
from dataclasses import dataclass, field

from scripts.options import whole
from slam.errors import InvalidValueError
from slam.evaluation.lost import Rule


@dataclass(frozen=True, kw_only=True)
class Question:
    """What is asked.

    rule       what a divergence is
    at_s       look at this time instead of searching for one
    lead_s     from the checkpoint to where the divergence begins
    horizon_s  from where it is found to the end of the re-runs
    top        only so many suspects, the likeliest; 0: all
    repeats    other draws of the scanner's noise, for the original and for each cure
    who        try only these: movers, groups or patterns (``scenes.groups``); (): whoever was seen
    """

    rule: Rule = field(default_factory=Rule)
    at_s: float | None = None
    lead_s: float = 2.0
    horizon_s: float = 4.0
    top: int = 0
    repeats: int = 3
    who: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for name in ("lead_s", "horizon_s"):
            value = getattr(self, name)
            if not 0.0 < value < math.inf:
                option = name.replace("_s", "")
                raise InvalidValueError(f"--{option} must be > 0 s and finite, got {value}")
        for name in ("top", "repeats"):
            whole(f"--{name}", getattr(self, name), 0)

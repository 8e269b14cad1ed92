# SPDX-License-Identifier: Apache-2.0
"""Every number of a tracker: twelve that a user may turn, the rest by groups.

``mobilia config shunting`` prints them all. Numbers that follow from a frame's own sensor (beam
spacing, scan rate, odometry covariance, range) are none of them: they are read from the frame.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar, Self

from slam.errors import InvalidValueError
from slam.frontend.config import FrontendConfig
from slam.landmarks.hypotheses import Gates
from slam.settings import Settings, number, word
from slam.tracker.belief.config import BeliefConfig
from slam.tracker.map_config import MapConfig
from slam.tracker.matching.config import MatchingConfig
from slam.tracker.standing.config import FULL_WEIGHT, StandingConfig
from slam.tracker.tracking.config import LoopsConfig, TrackingConfig
from slam.tracker.uncertainty.config import UncertaintyConfig

SEEDS = "training seeds"


@dataclass(frozen=True, kw_only=True)
class FeaturesConfig(Settings):
    """Point features in the place of beams: "shunting-features" alone."""

    least_peak: float = number(0.1, "activity", "a peak below it is no landmark", low=1e-6)
    peak_cells: float = number(0.15, "cells", "added deviation of a peak")
    enough_pairs: int = number(2, "pairs", "with fewer, the whole map is matched", low=1, high=1000)
    least_m2: float = number(1e-6, "m²", "least variance", "numerical guard: (1 mm)²", low=1e-15)
    looks_twice: float = number(1.5, "looks", "peaks with more are associated first")
    steps: int = number(20, "frames", "frames whose median step is one look", low=1, high=100_000)
    gates: Gates = field(default=Gates())
    corner_gates: Gates = field(default=Gates(individual=0.999, joint=0.99, posterior=0.95))


@dataclass(frozen=True, kw_only=True)
class TrackerConfig(Settings):
    """Everything that can be set; the defaults are the preset ``robust()``.

    Recipes and saved maps of every tracker hold this whole tree. So it also has the numbers of one
    kind of map: those of Eq. (8) and of features. A tracker whose map has no use for them keeps
    them as they are.

    The twelve numbers at the top are the public face. What a value does to the error was measured
    on training seeds of office, arena and arena without walls at 4.7 Hz. The groups below are for
    experts: ``changed({"matching.local.points": 90})`` sets one of theirs by its path.
    """

    presets: ClassVar[tuple[str, ...]] = ("robust", "paper")
    gone: ClassVar[Mapping[str, str]] = {
        "freeze_below": "carried_per_h",
        "tracking.freeze_below": "carried_per_h",
        "tracking.quality.give_up_s": "tracking.give_up_s",
    }
    constants: ClassVar[Mapping[str, str]] = {
        "frontend": "slam.frontend.observations",
        "frontend.surfaces": "slam.frontend.surfaces",
        "frontend.view": "slam.frontend.visibility",
        "frontend.prior": "slam.frontend.odometry_prior",
        "frontend.bias": "slam.frontend.heading_bias",
        "features.corners": "slam.frontend.corners",
    }

    cell_m: float = number(
        0.03, "m", "edge of a neuron's square. 0.05: twice as fast; 0.10: error three times",
        SEEDS, low=0.005, high=1.0, alias="map.cell_m",
    )  # fmt: skip
    decay_per_s: float = number(
        0.8, "1/s", "A of Eq. (8). Flat between 0.2 and 2", "paper",
        low=1e-3, high=100.0, alias="map.decay_per_s",
    )  # fmt: skip
    lateral_sum: float = number(
        0.0, "1/s", "W, sum of a neuron's lateral weights (paper: < 0.2), below decay_per_s. "
        "0: no diffusion, which doubles the cost and gains nothing", SEEDS, alias="map.lateral_sum",
    )  # fmt: skip
    lateral_reach_cells: float = number(
        1.5, "cells", "r0 of w = mu / d for 0 < d < r0. Flat", "paper",
        low=1.0, high=8.0, alias="map.lateral_reach_cells",
    )  # fmt: skip
    threshold: float = number(
        0.01, "activity", "sigma of Eq. (8): less is dropped. Flat between 0.001 and 0.05",
        SEEDS, low=1e-6, high=0.5, alias="map.threshold",
    )  # fmt: skip
    trace_s: float = number(
        3.0, "s", "pace of the long-term trace; 0: none (paper). Below 1, things that move "
        "together carry the robot along", SEEDS, alias="map.trace_s",
    )  # fmt: skip
    short_term_weight: float = number(
        0.3, "share", "of the short-term activity where there is no trace. Flat between 0.1 and "
        "0.3; 1 errs by 15 % more in rooms, 24 % without walls", SEEDS,
        high=1.0, alias="map.short_term_weight",
    )  # fmt: skip
    reward: float = number(
        5.0, "weight", "of one overlapped observation against the prior. Rooms: flat between 2 and "
        "12; without walls 2 errs by 90 % more, 12 by 20 % less", SEEDS,
        low=1e-3, high=1e3, alias="matching.reward",
    )  # fmt: skip
    reward_exponent: float = number(
        0.0, "1", "the weight falls with the matched fraction q as reward q^exponent. 0: never; "
        "without walls, half of the chairs moving: 14 cm at 0, 18 at 1, 28 at 2", SEEDS,
        high=10.0, alias="matching.reward_exponent",
    )  # fmt: skip
    objective: str = word(
        "sum", ("sum", "log"), "overlapped volumes, as the paper words it, or Eq. (13) as it "
        "prints: their logarithms", "paper", alias="matching.objective",
    )  # fmt: skip
    range_m: float = number(
        40.0, "m", "returns beyond are ignored. 8 errs by 70 % more in rooms", SEEDS,
        low=0.5, high=1000.0, alias="frontend.range_m",
    )  # fmt: skip
    carried_per_h: float = number(
        3.0, "1/h", "how often somebody carries the robot elsewhere, odometry unknowing; 0: never, "
        "and no pose is doubted", alias="belief.carried_per_h",
    )  # fmt: skip
    frontend: FrontendConfig = field(default=FrontendConfig())
    map: MapConfig = field(default=MapConfig())
    matching: MatchingConfig = field(default=MatchingConfig())
    tracking: TrackingConfig = field(default=TrackingConfig())
    belief: BeliefConfig = field(default=BeliefConfig())
    loops: LoopsConfig = field(default=LoopsConfig())
    uncertainty: UncertaintyConfig = field(default=UncertaintyConfig())
    features: FeaturesConfig = field(default=FeaturesConfig())
    standing: StandingConfig = field(default=StandingConfig())

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.lateral_sum < self.decay_per_s:
            raise InvalidValueError(
                f"{type(self).__name__}.lateral_sum must be below decay_per_s (the empty map is "
                f"unstable otherwise), got {self.lateral_sum} and {self.decay_per_s}"
            )
        if self.trace_s == 0.0 and self.short_term_weight == 0.0:
            raise InvalidValueError(
                f"{type(self).__name__}.short_term_weight must be > 0 when trace_s is 0: "
                "nothing is left"
            )

    @classmethod
    def robust(cls, **changes: Any) -> Self:
        """The default: sum of overlaps, slow trace beside the short-term memory."""
        return cls(**changes)

    @classmethod
    def paper(cls, **changes: Any) -> Self:
        """The paper as printed: lateral diffusion, no trace, sum of logarithms, map never frozen.

        Decisions where it is ambiguous: A is per second, one sweep a scan (converging would erase
        the memory), d(x) = max(x - sigma, 0) (the printed one excites the whole empty plane), and
        logarithms of overlap + 0.1 tempered by 0.3, because beams are not independent.
        """
        printed: dict[str, Any] = {
            "decay_per_s": 0.8,
            "lateral_sum": 0.19,
            "trace_s": 0.0,
            "short_term_weight": 1.0,
            "reward": 0.3,
            "reward_exponent": 0.0,
            "objective": "log",
            "carried_per_h": 0.0,
            "standing": FULL_WEIGHT,
            "loops": LoopsConfig(corrects=0),
        }
        return cls(**(printed | changes))

    @classmethod
    def of(cls, given: Self | str | Mapping[str, Any]) -> Self:
        """A config itself, that of a preset's name, or the default with changes by path.

        Raises ``InvalidValueError`` for anything else, ``UnknownNameError`` for an unknown path.
        """
        if isinstance(given, cls):
            return given
        if isinstance(given, Mapping):
            return cls().changed(given)
        if given in cls.presets:
            return cls.preset(given)
        raise InvalidValueError(
            f"config must be a {cls.__name__}, 'robust' or 'paper', or numbers by path, "
            f"got {given!r:.80}"
        )

    @property
    def saturation(self) -> float:
        """x* of Eq. (8) for a constant full input I = 1: no activity exceeds it for long."""
        return 1.0 / (1.0 + self.decay_per_s)

# SPDX-License-Identifier: Apache-2.0
"""What moves in a stream of the plane, and what the robot has to see it with: a table of kinds."""

import math
from dataclasses import dataclass, fields, replace
from typing import Annotated, Literal, get_args

import numpy as np
from msgspec import Meta

from slam.shaped import check, one_of

Building = Literal["flat", "halfturn", "corridor", "hall", "office", "bare"]
Wheels = Literal["fifth", "biased", "stated", "good"]
LAYOUTS, ODOMETRIES = get_args(Building)[:-1], get_args(Wheels)  # in turn, by the seed
PARTS = ("layout", "chairs", "boards", "people", "odometry", "lidar", "driving")
Count = Annotated[int, Meta(ge=0, le=200)]
Share = Annotated[float, Meta(ge=0.0, le=1.0)]
Whole = Annotated[int, Meta(ge=0)]


@dataclass(frozen=True, kw_only=True)
class Kind:
    """Settings of a stream.

    chairs, boards, people   how many of each
    chair_rest_s             longest rest of a chair between two slides, s
    board_rest_s             the same of a board, s
    board_m                  shortest and longest board, m
    escort                   share of the people who walk with the robot, 0.6 to 1.6 m around it
    hug                      share of a board's ways that lead past the robot
    moved_every_s            s; so often all chairs and boards stand elsewhere once out of sight
    beams, fov_deg, rate_hz  of the scanner; its first and last beam are ``fov_deg`` apart
    sigma_m, range_max_m     noise of a range (m, 1 sigma) and its end
    dropouts                 share of the beams without a return
    layout, odometry         the ``Building`` and its ``Wheels``; "" is by the seed
    """

    chairs: Count = 0
    boards: Count = 0
    people: Count = 0
    chair_rest_s: float = 8.0
    board_rest_s: float = 4.0
    board_m: tuple[float, float] = (1.2, 2.0)
    escort: Share = 0.0
    hug: Share = 0.6
    moved_every_s: Annotated[float, Meta(ge=1.0)] = math.inf
    beams: Annotated[int, Meta(ge=2, le=4000)] = 181
    fov_deg: Annotated[float, Meta(ge=1.0, le=360.0)] = 180.0
    rate_hz: Annotated[float, Meta(ge=0.1, le=100.0)] = 10.0
    sigma_m: float = 0.01
    range_max_m: float = 30.0
    dropouts: Share = 0.0
    layout: Building | Literal[""] = ""
    odometry: Wheels | Literal[""] = ""

    def __post_init__(self) -> None:
        check(self)


KINDS = {
    "quiet": Kind(),
    "chairs8": Kind(chairs=8),
    "chairs16": Kind(chairs=16),
    "chairs24": Kind(chairs=24, chair_rest_s=0.5),
    "boards6": Kind(chairs=8, boards=6),
    "boards10": Kind(chairs=8, boards=10, board_rest_s=0.5),
    "crowd6": Kind(people=6, escort=1.0),
    "crowd10": Kind(people=10, escort=1.0),
    "crowd16": Kind(people=16, escort=1.0),
    "moved30": Kind(chairs=24, boards=6, moved_every_s=30.0),
    "moved15": Kind(chairs=24, boards=6, moved_every_s=15.0),
    "slow2hz": Kind(chairs=16, rate_hz=2.0),
    "wide270": Kind(chairs=16, beams=271, fov_deg=270.0),
    "fast37": Kind(chairs=8, boards=6, rate_hz=37.5),
    "poor": Kind(chairs=8, people=4, beams=61, sigma_m=0.03, dropouts=0.05, range_max_m=12.0),
    "alike": Kind(chairs=4, boards=8, board_rest_s=1.0, layout="halfturn"),
    "empty_corridor": Kind(layout="bare", range_max_m=8.0),
    "pass6": Kind(chairs=8, boards=6, hug=0.2),
    "pass10": Kind(chairs=8, boards=10, board_rest_s=0.5, hug=0.2),
    "crowd_corridor": Kind(people=10, escort=1.0, layout="bare", range_max_m=12.0),
    "moved30_calm": Kind(chairs=24, boards=6, board_rest_s=15.0, hug=0.0, moved_every_s=30.0),
}
"""Every kind of stream by its name."""


@dataclass(frozen=True, kw_only=True)
class StreamSpec:
    """One stream of the plane: which kind, which seed, and what is other than in the kind.

    again    another time in the same building: other chairs, boards, people, noise and way
    seconds  simulated
    changes  pairs of a field of ``Kind`` and its value

    Raises ``InvalidValueError`` for a kind or a field that is none, and for other values.
    """

    kind: str
    seed: Whole
    again: Whole = 0
    seconds: Annotated[float, Meta(ge=1.0, le=3600.0)] = 150.0
    changes: tuple[tuple[str, float | str], ...] = ()

    def __post_init__(self) -> None:
        one_of("kind", self.kind, KINDS)
        check(self)
        for name, _ in self.changes:
            one_of("changes", name, [one.name for one in fields(Kind)])

    @property
    def settings(self) -> Kind:
        """Of the kind, with the changes; layout and odometry named."""
        changed = replace(KINDS[self.kind], **dict(self.changes))  # type: ignore[arg-type]
        place = self.seed + list(KINDS).index(self.kind)
        layout = changed.layout or LAYOUTS[place % len(LAYOUTS)]
        odometry = changed.odometry or ODOMETRIES[self.seed % len(ODOMETRIES)]
        return replace(changed, layout=layout, odometry=odometry)

    def rng(self, part: str) -> np.random.Generator:
        """The generator of one of ``PARTS``."""
        again = 0 if part == "layout" else self.again
        return np.random.default_rng([self.seed, PARTS.index(part), again])

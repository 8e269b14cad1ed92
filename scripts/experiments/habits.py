# SPDX-License-Identifier: Apache-2.0
"""Will the door be open, will something stand there? Ours against four rivals, on true sessions.

``python -m scripts.experiments.habits --seeds 12``.

The truth of sessions is a function of scene, seed, change and number, so nothing is simulated.
Places are the doors (open or not), and wherever a chair or a board stood in an earlier session
(one stands within 0.3 m, or not). A predictor sees four in five places a session, two sightings in
a hundred are wrong. From session 10 on, it says after each session how likely every place is taken
(a door: open) in the next five. A building's score is the mean over its places and sessions; the
intervals are of the mean over buildings, by bootstrap. ``--first-seed 100`` and above were not used
to choose anything.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenes import build
from scripts.experiments.shared import Row
from scripts.experiments.study import Study
from scripts.marks import table
from sim.core.seeds import Seeds
from sim.world.sessions import Days
from sim.world.times_of_day import clock_s
from slam.days.habits import Habits
from slam.days.predictions import (
    FreMEn,
    LastSeen,
    Mean,
    PersistenceFilter,
    Predictor,
    brier,
    log_score,
)
from slam.evaluation.statistics import bootstrap_draws, central_interval
from slam.frames import Float

SESSIONS, FIRST, AHEAD = 40, 10, 5
SEEN, WRONG = 0.8, 0.02  # of the places a session; of the sightings
NEAR_M = 0.3  # a thing so near to a place takes it
OPEN_RAD = 0.2  # a door turned by more is open
GROUPS = ("doors", "chairs", "boards")
SPANS_H = ((0.0, 6.0), (6.0, 12.0), (12.0, 25.0))
PREDICTORS: Mapping[str, Callable[[int], Predictor]] = {
    "habits": Habits,
    "last seen": LastSeen,
    "mean": Mean,
    "persistence": PersistenceFilter,
    "fremen": FreMEn,
}


@dataclass(frozen=True, kw_only=True, eq=False)
class Truth:
    """One building: (sessions, n) whether each place is taken, its group, when each session is."""

    taken: NDArray[np.bool_]
    groups: NDArray[np.int64]
    times_s: Float


def truth(scene: str, seed: int, change: float, crowd: str) -> Truth:
    """All sessions of a building."""
    seeds = Seeds(seed)
    options: dict[str, Any] = {"crowd": crowd} if crowd else {}
    days = Days(build(scene, seed=seeds.integer("layout"), **options), seeds, change)
    arranged = [days.arrangement(k) for k in range(SESSIONS)]
    doors = sorted(arranged[0].angles)
    columns = [np.array([[a.angles[d] > OPEN_RAD for d in doors] for a in arranged])]
    groups = [0] * len(doors)
    kinds = {m.name: m.kind for m in days.scene.movers}
    for group, word in ((1, "chair"), (2, "board")):
        names = sorted(n for n in arranged[0].poses if kinds[n].startswith(word))
        stands = [[p[:2] for n in names if (p := a.poses[n]) is not None] for a in arranged]
        places = _places(stands)
        columns.append(_taken(stands, places))
        groups += [group] * len(places)
    times = np.array([clock_s(k) for k in range(SESSIONS)])
    return Truth(
        taken=np.concatenate(columns, axis=1),
        groups=np.array(groups, dtype=np.int64),
        times_s=times,
    )


def _places(stands: Sequence[Sequence[tuple[float, float]]]) -> list[tuple[float, float]]:
    found: list[tuple[float, float]] = []
    for session in stands:
        for at in session:
            if all(math.dist(at, other) > NEAR_M for other in found):
                found.append(at)
    return found


def _taken(
    stands: Sequence[Sequence[tuple[float, float]]], places: Sequence[tuple[float, float]]
) -> NDArray[np.bool_]:
    rows = [
        [any(math.dist(at, place) <= NEAR_M for at in session) for place in places]
        for session in stands
    ]
    return np.array(rows, dtype=np.bool_).reshape(len(stands), len(places))


def sightings(known: Truth, seed: int) -> Float:
    """(sessions, n) what a robot sees of it."""
    rng = np.random.default_rng(seed)
    shape = known.taken.shape
    seen, wrong = rng.random(shape) < SEEN, rng.random(shape) < WRONG
    return np.where(seen, (known.taken ^ wrong).astype(np.float64), np.nan)


def scores(
    known: Truth, seen: Float, make: Callable[[int], Predictor]
) -> Iterator[tuple[int, int, float, float]]:
    """(group, span, Brier, log score) of every prediction of a place that was once seen taken."""
    predictor, ever = make(seen.shape[1]), known.groups == 0
    for k in range(SESSIONS - 1):
        predictor.see(float(known.times_s[k]), seen[k])
        ever = ever | (np.nan_to_num(seen[k]) > 0.5)
        if k < FIRST - 1:
            continue
        for later in range(k + 1, min(k + 1 + AHEAD, SESSIONS)):
            hours = (known.times_s[later] - known.times_s[k]) / 3600.0
            span = next(i for i, (low, high) in enumerate(SPANS_H) if low < hours <= high)
            told = predictor.probability(float(known.times_s[later]))
            came = known.taken[later].astype(np.float64)
            each = zip(brier(told, came), log_score(told, came), known.groups, ever, strict=True)
            yield from ((int(g), span, float(b), float(s)) for b, s, g, e in each if e)


def run(case: Row) -> Row:
    """Of one building: (groups, spans + 1, 2) mean Brier and log scores, last span: all."""
    known = truth(case["scene"], case["seed"], case["change"], case["crowd"])
    seen = sightings(known, case["seed"])
    sums = np.zeros((len(GROUPS), len(SPANS_H) + 1, 3))
    for group, span, b, s in scores(known, seen, PREDICTORS[case["predictor"]]):
        sums[group, [span, -1]] += (b, s, 1.0)
    with np.errstate(invalid="ignore"):
        return {"scores": (sums[..., :2] / sums[..., 2:]).tolist()}


def interval(values: Float) -> tuple[float, float, float]:
    """Mean over buildings and its 95 % interval; NaN of nothing."""
    values = values[np.isfinite(values)]
    if not len(values):
        return math.nan, math.nan, math.nan
    low, high = central_interval(values[bootstrap_draws(len(values))].mean(axis=1).tolist())
    return float(values.mean()), low, high


def tell(rows: Sequence[Row]) -> str:
    """A line for each group, span and predictor; ``not ahead`` where the gap to ours holds 0."""
    found = {
        name: np.array([row["scores"] for row in rows if row["predictor"] == name])
        for name in dict.fromkeys(row["predictor"] for row in rows)
    }
    spans = [f"{low:g} to {high:g} h" for low, high in SPANS_H] + ["all"]
    lines = []
    for group, span, name in product(range(len(GROUPS)), range(len(spans)), found):
        own = found[name][:, group, span]
        b, low, high = interval(own[:, 0])
        if math.isnan(b):
            continue
        gap, gap_low, gap_high = interval(found["habits"][:, group, span, 0] - own[:, 0])
        beside = ["", "", ""]
        if name != "habits":
            beside = [f"{gap:+.4f}", f"{gap_low:+.4f} to {gap_high:+.4f}"]
            beside.append("yes" if gap_high < 0.0 else "**not ahead**")
        log = f"{interval(own[:, 1])[0]:.3f}"
        brier_of = [f"{b:.4f}", f"{low:.4f} to {high:.4f}"]
        lines.append([GROUPS[group], spans[span], name, *brier_of, log, *beside])
    return table(
        ("places", "ahead", "predictor", "Brier", "95 %", "log score", "habits less its", "95 %",
         "better"), lines,
    )  # fmt: skip


STUDY = Study(
    name="habits",
    axes={"scene": ("random-rooms",), "change": (0.3,), "crowd": ("boards:3",),
          "predictor": tuple(PREDICTORS)},
    run=run, tell=tell,
    told="{scene[0]}, change {change[0]:g}, {seeds} buildings from {first_seed}.",
    defaults={"seeds": 12, "first_seed": 100},
)  # fmt: skip


if __name__ == "__main__":
    sys.exit(STUDY.main())

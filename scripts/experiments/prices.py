# SPDX-License-Identifier: Apache-2.0
"""What a lost robot's search costs on this machine, beside what it is taken to cost.

``python -m scripts.experiments.prices``.

A scan's share of that work is counted, not timed, so that poses do not depend on the machine. Its
prices are those of ``matching.budget``. Where this machine takes longer, scans do too; a smaller
``matching.budget.budget_ms`` then makes them as short as wanted.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Iterator

import numpy as np

from sim.simulation import stream
from slam.frames import Frame
from slam.frontend.observations import observe
from slam.frontend.odometry_prior import inverted
from slam.shunting import ShuntingSlam
from slam.tracker.belief.evidence import Evidence
from slam.tracker.belief.places import coarse
from slam.tracker.matching.budget import NS_PER_MS, Budget
from slam.tracker.matching.coarse_map import CoarseMap
from slam.tracker.matching.matcher import Matcher
from slam.tracker.matching.whole_search import WholeSearch

ENDLESS = 1e9  # share of a budget that is never spent


def _now_ns() -> int:
    return time.process_time_ns()


def work(slam: ShuntingSlam, frame: Frame) -> Iterator[tuple[str, float, float]]:
    """Of each part of the work for one scan: its name, ns it took, ns it is taken to take."""
    matching, matcher = slam.config.matching, Matcher(slam.config)
    seen = observe(frame, np.zeros(3), slam.config)
    budget, began = Budget(matching.budget, ENDLESS), _now_ns()
    laid_out = CoarseMap(slam.cell_map, matcher.reward.short_term)
    laid_out.advance(budget)
    yield "lay out the map", _now_ns() - began, budget.spent_ns
    budget, began = Budget(matching.budget, ENDLESS), _now_ns()
    search = WholeSearch(laid_out, seen.points_robot, 6, matching.whole)
    places = search.advance(budget)
    yield "search in it", _now_ns() - began, budget.spent_ns
    spread = coarse(slam.config.tracking.relocalise)
    few = min(len(seen.points_robot), matching.climb.few)
    for place in places:
        began = _now_ns()
        start = matcher.approach(slam.cell_map, seen, place, spread)
        middle = _now_ns()
        match = matcher.climb(slam.cell_map, seen, start, place, inverted(spread))
        Evidence().add(slam.cell_map, seen, match.T_map_robot)
        yield "approach a place", middle - began, few * matching.budget.approach_ns
        price = len(seen.points_robot) * matching.budget.climb_ns
        yield "match there", _now_ns() - middle, price


def main(arguments: list[str] | None = None) -> int:
    """Print a line for each part."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scene", default="office")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--seconds", type=float, default=60.0, help="of mapping, simulated")
    wanted = parser.parse_args(arguments)
    frames = list(stream(wanted.scene, seed=wanted.seed, dynamism=0.5, seconds=wanted.seconds))
    slam = ShuntingSlam()
    for frame in frames[::8]:
        slam.update(frame.without_truth())
    took: dict[str, list[tuple[float, float]]] = {}
    for frame in frames[4 :: len(frames) // 20]:
        for name, measured, taken in work(slam, frame):
            took.setdefault(name, []).append((measured, taken))
    for name, pairs in took.items():
        measured, taken = np.array(pairs).sum(axis=0) / len(pairs) / NS_PER_MS
        print(
            f"{name}: {measured:.2f} ms, taken to be {taken:.2f} ms: {measured / taken:.2f} times"
        )
    return 0


if __name__ == "__main__":
    sys.exit(main())

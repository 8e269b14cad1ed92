# SPDX-License-Identifier: Apache-2.0
"""What JCBB and IPJC cost: ``python -m scripts.experiments.association_effort``.

n landmarks known to 2 mm, a pose that is off by 0.1 m and 2 mrad, and all n seen with 5 mm of
error, among points that come from no landmark but lie about 0.15 m from one. Landmarks lie as
densely whatever their number. Prints two Markdown tables. Of whole searches: medians over the
seeds of processor time, of hypotheses looked into (nodes) and of tests of a pair, the last two
counted where they are made. JCBB's tree is walked in Python, its test is compiled; IPJC's search is
compiled whole: compare how they grow, not their times with each other. Of a single test of a pair,
and of IPJC's update with an accepted one, compiled both: time when so many pairs are accepted.
"""

from __future__ import annotations

import argparse
import math
import sys
import time
from collections.abc import Callable, Iterator, Sequence

import numpy as np

from slam import se2
from slam.frames import Float
from slam.landmarks import jcbb, kernels, pairs
from slam.landmarks.association import METHODS
from slam.landmarks.filter import EkfFilter
from slam.landmarks.hypotheses import Effort, Gates

PAIRS, CLUTTER, SEEDS = (4, 8, 16, 32), (0, 2, 4, 6), range(5)
SQUARE_M2 = 3.0  # for each landmark
LANDMARK_STD_M, SENSOR_STD_M, CLUTTER_STD_M = 0.002, 0.005, 0.15
POSE_STD = (0.1, 0.1, 0.002)
REPEATS, CALLS = 3, 20
DEPTHS = (4, 16, 64, 256)
SHOWN = ("jcbb", "ipjc")


def scene(n: int, clutter: int, seed: int) -> tuple[EkfFilter, Float, Float]:
    """A filter with n landmarks, and the points (n + clutter, 2) seen with their covariances."""
    rng = np.random.default_rng([n, seed])
    half = np.sqrt(n * SQUARE_M2) / 2.0
    landmarks = rng.uniform(-half, half, (n, 2))
    state = EkfFilter()
    state.add(landmarks, np.tile(np.eye(2) * LANDMARK_STD_M**2, (n, 1, 1)))
    state.predict(np.zeros(3), np.diag(np.square(POSE_STD)))
    seen = se2.transform(se2.inverse(rng.normal(0.0, POSE_STD)), landmarks)
    seen = seen + rng.normal(0.0, SENSOR_STD_M, seen.shape)
    near = landmarks[rng.integers(0, n, clutter)]
    points = np.concatenate([seen, near + rng.normal(0.0, CLUTTER_STD_M, near.shape)])
    covariances = np.tile(np.eye(2) * SENSOR_STD_M**2, (len(points), 1, 1))
    return state, rng.permutation(points), covariances


def search(method: str, n: int, clutter: int, seed: int) -> tuple[float, Effort]:
    """ms of processor time, the least of a few repeats, and what was counted."""
    state, points, covariances = scene(n, clutter, seed)
    spent = []
    for _ in range(REPEATS):
        started = time.process_time()
        found = METHODS[method](state, np.arange(n), points, covariances, Gates())
        spent.append(1e3 * (time.process_time() - started))
    return min(spent), found.effort


def table(numbers: Sequence[int], clutter: Sequence[int], seeds: Sequence[int]) -> Iterator[str]:
    """Lines of Markdown, a row for each number of pairs and of clutter."""
    heads = [f"{name.upper()} {what}" for what in ("ms", "nodes", "tests") for name in SHOWN]
    yield f"| pairs | clutter | {' | '.join(heads)} |"
    yield "|---:|---:|" + "---:|" * len(heads)
    for name in SHOWN:
        search(name, numbers[0], 0, 0)  # what is compiled is compiled
    for n in numbers:
        for k in clutter:
            found = [[search(name, n, k, seed) for seed in seeds] for name in SHOWN]
            cells = [_short(float(np.median([ms for ms, _ in runs]))) for runs in found]
            for count in ("nodes", "tests"):
                counts = [[getattr(effort, count) for _, effort in runs] for runs in found]
                cells += [f"{np.median(seen):.0f}" for seen in counts]
            whole = all(effort.complete for runs in found for _, effort in runs)
            yield f"| {n} | {k}{'' if whole else ' (cut short)'} | {' | '.join(cells)} |"


def depths(accepted: Sequence[int]) -> Iterator[str]:
    """Lines of Markdown: what one test of a pair costs after so many accepted ones."""
    yield "| pairs accepted | JCBB test, µs | IPJC test, µs | IPJC update, µs |"
    yield "|---:|---:|---:|---:|"
    for n in accepted:
        yield f"| {n} | {' | '.join(map(_short, single(n)))} |"


def single(n: int) -> tuple[float, float, float]:
    """Microseconds of JCBB's test, of IPJC's, and of IPJC's update, after n accepted pairs."""
    state, points, R = scene(n, 0, 0)
    pose, landmarks, P = state.pose, state.landmarks, state.error_covariance
    L, white, cross, own = np.eye(2 * n), np.zeros(2 * n), np.zeros((2, 2 * n)), np.eye(2)
    every, first = np.ones((n, n), dtype=np.bool_), np.zeros(1, dtype=np.int64)

    def update() -> None:
        copies = pose.copy(), landmarks.copy(), n, P.copy()
        kernels.absorb(*copies, first, points[:1], R[:1])

    def test_all() -> None:
        pairs.distances(pose, landmarks, P, points, R, every, math.inf, math.inf)

    grow_us = _us(lambda: jcbb.grow(L, white, cross, own, np.zeros(2)))
    return grow_us, _us(test_all) / n**2, _us(update)


def _us(work: Callable[[], object]) -> float:
    """Processor time of a call, the least of a few runs of many calls."""
    work()
    least = math.inf
    for _ in range(REPEATS):
        started = time.process_time()
        for _ in range(CALLS):
            work()
        least = min(least, time.process_time() - started)
    return 1e6 * least / CALLS


def _short(value: float) -> str:
    return f"{value:.2f}" if value < 10.0 else f"{value:.0f}"


def main(arguments: list[str] | None = None) -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.parse_args(arguments)
    for line in table(PAIRS, CLUTTER, SEEDS):
        print(line, flush=True)
    print()
    for line in depths(DEPTHS):
        print(line, flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())

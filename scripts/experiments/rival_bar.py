# SPDX-License-Identifier: Apache-2.0
"""The bar that the rival has to clear: ``python -m scripts.experiments.rival_bar [--data FOLDER]``.

Before any comparison counts, the EKF must be accurate and honest on static points with true
associations and with IPJC (0.05 m; NEES within chi-square's bounds), take at most 10 ms a step at
300 landmarks, and close the loops of Victoria Park. What counts as closing them was set after the
result was known; the table says so. Prints a Markdown table: bar, value, met or not. Points are
the paper's static world on training seeds; the park needs its data.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from scripts.benches import slam as bench_slam
from scripts.paper.park_runs import SYSTEMS, read
from scripts.paper.park_scores import loop_errors, loops
from scripts.paper.point_runs import told
from scripts.paper.runs import follow, truth_of
from slam import create
from slam.errors import InvalidValueError, MobiliaError
from slam.evaluation import metrics
from slam.evaluation.points import PointWorld, PointWorldConfig
from slam.frames import Float, Frame
from slam.landmarks.hypotheses import chi_square
from slam.logs import victoria_graph
from slam.trajectory import Trajectory

MOST_M, MOST_MS = 0.05, 10.0
CLOSED_M, CLOSED_SHARE = 3.0, 0.9  # a loop is closed within so much of the graph; and how many
APART = 300  # frames, or fewer, between loops that are told of together
CENTRAL = 0.95  # probability that the NEES of a consistent filter lies within its bounds


@dataclass(frozen=True, kw_only=True)
class Bar:
    """One line of the table."""

    what: str
    value: str
    met: bool

    def line(self) -> str:
        """A row of Markdown."""
        return f"| {self.what} | {self.value} | {'yes' if self.met else '**no**'} |"


def points(seeds: Sequence[int], steps: int = 220) -> Iterator[Bar]:
    """Accuracy and honesty on static points, with true associations and with IPJC."""
    scores: dict[str, list[tuple[float, float]]] = {"true associations": [], "IPJC": []}
    for seed in seeds:
        frames = list(PointWorld(PointWorldConfig(n_steps=steps), seed=seed).stream())
        truth = truth_of(frames)
        track = follow(create("ekf", preset="points"), frames, "EKF")
        found = scored(track.online(), track.covariances(), truth)
        scores["IPJC"].append(found)
        scores["true associations"].append(scored(*_with_true_associations(frames), truth))
    of = f"seeds {min(seeds)} to {max(seeds)}"
    low, high = nees_bounds(len(seeds))
    for name, found_by_seed in scores.items():
        ates, nees = np.array(found_by_seed).T
        yield Bar(
            what=f"static points, {name}: ATE ≤ {1e3 * MOST_M:.0f} mm",
            value=f"median {1e3 * np.median(ates):.1f} mm, worst {1e3 * ates.max():.1f} mm, {of}",
            met=bool(ates.max() <= MOST_M),
        )
        yield Bar(
            what=f"static points, {name}: NEES within {low:.1f} to {high:.1f} (3 is ideal)",
            value=f"mean {nees.mean():.2f}, by seed {nees.min():.1f} to {nees.max():.1f}, {of}",
            met=bool(low <= nees.mean() <= high),
        )


def nees_bounds(runs: int) -> tuple[float, float]:
    """Between which the mean NEES of a pose over so many independent runs lies: chi-square of
    3 degrees of freedom a run. The steps of one run are counted as one: their errors hang together.
    """
    tail = (1.0 - CENTRAL) / 2.0
    return chi_square(tail, 3 * runs) / runs, chi_square(1.0 - tail, 3 * runs) / runs


def scored(estimate: Trajectory, covariances: ArrayLike, truth: Trajectory) -> tuple[float, float]:
    """ATE in m, unaligned, and mean NEES (of the frames after the first, which is exact)."""
    nees = metrics.nees(estimate, covariances, truth).values
    return metrics.ate(estimate, truth).value, float(np.nanmean(nees))


def _with_true_associations(frames: Sequence[Frame]) -> tuple[Trajectory, Float]:
    seen = [f.features.ids for f in frames if f.features is not None]
    everything = {int(i) for ids in seen if ids is not None for i in ids}
    states = [(s.pose.copy(), s.pose_covariance()) for s in told(frames, everything)]
    stamps = np.array([frame.stamp_ns for frame in frames])
    poses, covariances = (np.array(a) for a in zip(*states, strict=True))
    return Trajectory(stamps_ns=stamps, poses=poses), covariances


def speed(seconds: float = 20.0) -> Iterator[Bar]:
    """Rows of ``mobilia bench`` about the EKF: medians, and what nine of ten steps keep to."""
    rows = list(bench_slam.ekf(seconds))
    for median, most in zip(rows[::2], rows[1::2], strict=True):
        what = median["what"].removeprefix("EKF, ").removesuffix(", p50")
        yield Bar(
            what=f"{what}: a step ≤ {MOST_MS:.0f} ms (median)",
            value=f"{median['figure']:.1f} ms; 90 %: {most['figure']:.1f} ms",
            met=median["figure"] <= MOST_MS,
        )


def park(data: Path) -> Bar:
    """Motion from one visit of a place to the next, against the graph of known associations."""
    frames, _ = read(str(data), 0)
    graph = victoria_graph.stamped(victoria_graph.read_graph(data).optimised(), frames)
    kind, options = SYSTEMS["EKF"]
    track = follow(create(kind, **options), frames, "EKF")
    errors = loop_errors(track.online(), graph)
    at = np.array([later for _, later in loops(graph)], dtype=np.int64)
    lost = sum(not e.converged for e in track.estimates)
    return closed(errors, at, lost)


def closed(errors: Float, at: NDArray[np.int64], lost: int) -> Bar:
    """What is said of loops with these errors (m) that end at the frames ``at``."""
    near = errors <= CLOSED_M
    told = f"{near.sum()} of {len(errors)} ({near.mean():.0%}), worst {errors.max():.1f} m"
    if not near.all():
        told += f"; the others end at frames {', '.join(stretches(np.sort(at[~near])))}"
    return Bar(
        what=f"Victoria Park: {CLOSED_SHARE:.0%} of the loops within {CLOSED_M:g} m of the graph, "
        "never lost (set after the result was known)",
        value=f"{told}; lost in {lost} scans",
        met=bool(near.mean() >= CLOSED_SHARE and lost == 0),
    )


def stretches(frames: NDArray[np.int64]) -> list[str]:
    """Ordered frames in words, those together that follow one another within ``APART``."""
    parts = np.split(frames, np.flatnonzero(np.diff(frames) > APART) + 1)
    return [f"{p[0]} to {p[-1]} ({len(p)})" if len(p) > 1 else f"{p[0]}" for p in parts]


def main(arguments: list[str] | None = None) -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--data", type=Path, help="folder of the Victoria Park dataset")
    parser.add_argument("--seeds", type=int, default=10, help="runs of points, from seed 0 on")
    wanted = parser.parse_args(arguments)
    try:
        if not 1 <= wanted.seeds <= 100:
            raise InvalidValueError(f"--seeds must lie in [1, 100], got {wanted.seeds}")
        print("| bar | value | met |\n|---|---|---|")
        for bar in points(range(wanted.seeds)):
            print(bar.line())
        for bar in speed():
            print(bar.line(), flush=True)
        if wanted.data is not None:
            print(park(wanted.data).line())
    except MobiliaError as error:
        print(error, file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())

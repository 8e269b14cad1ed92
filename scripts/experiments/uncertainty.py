# SPDX-License-Identifier: Apache-2.0
"""Is the stated uncertainty honest? A table and a figure.

``python -m scripts.experiments.uncertainty``.

NEES / 3 of the online pose in the frame of the known start, and NIS / 3 of odometry's prior: both
are 1 on average where a covariance is right. Over seeds nobody tuned on, in arena and office, with
the scanner's noise alone and with all its errors, at both scan rates, with the covariance that the
odometry states and without it. Then with parts of the scanner, and where few things are in view: in
the arena without its walls, with some or all of its chairs on the move.
"""

from __future__ import annotations

import argparse
import statistics
import sys
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from scripts.experiments.accuracy import FULL_RATE_HZ, SCANNERS
from scripts.experiments.measured import ended
from scripts.experiments.parts import Part
from scripts.metrics.judged import SETTLED_S, world_truth
from scripts.paper.runs import follow
from sim.core.dynamism import Dynamism
from sim.simulation import stream
from slam import create
from slam.evaluation import metrics
from slam.frames import Float, Frame
from slam.frontend.odometry_sum import thinned

SCENES = ("arena", "office")
DYNAMISM = 0.5
WHOLE = Part(name="")
PARTS = (
    Part(name="1°, 8 m", every=2, range_m=8.0),
    Part(name="2°", every=4),
    Part(name="1°, 90° wide", every=2, fov_deg=90.0),
    Part(name="4 m", range_m=4.0),
)
FEW = {f"no walls, {share:.0%} move": share for share in (0.3, 0.5, 1.0)}
COLOURS = {"noise": "#1f61be", "full": "#ce2c3c"}
NAMES = {"noise": "noise and rounding", "full": "all errors of the LMS-221"}


@dataclass(frozen=True, kw_only=True)
class Case:
    """What is run: ``stride`` thins 37.5 Hz; ``stated``: with the odometry's own covariance;
    ``part`` of the scanner."""

    scene: str
    scanner: str
    stride: int = 8
    stated: bool = True
    part: Part = WHOLE

    @property
    def rate_hz(self) -> float:
        """Scans a second."""
        return FULL_RATE_HZ / self.stride


@dataclass(frozen=True, kw_only=True, eq=False)
class Run:
    """One seed: s since the start, NEES / 3 and NIS / 3 of frames (NaN where there is none), RMS
    error of the settled frames, m."""

    times: Float
    nees: Float
    nis: Float
    rmse_m: float

    def mean(self, name: str) -> float:
        """Over the settled frames."""
        values: Float = getattr(self, name)[self.times > SETTLED_S]
        return float(np.nanmean(values))


def run(name: str, frames: list[Frame], case: Case) -> Run:
    """Let the SLAM see the frames as the case wants them."""
    frames = thinned(frames, case.stride)
    if not case.stated:
        frames = [
            replace(f, odometry=replace(f.odometry, increment_covariance=None)) for f in frames
        ]
    if case.part is not WHOLE:
        frames = case.part.of(frames)
    track, truth = follow(create(name), frames, name), world_truth(frames)
    online = track.online()
    nees = metrics.nees(online, track.covariances(), truth).values
    nis = [e.diagnostics.get("nis") for e in track.estimates]
    times = (online.stamps_ns - online.stamps_ns[0]) * 1e-9
    off = metrics.pose_errors(online, truth).errors[times > SETTLED_S, :2]
    return Run(
        times=times,
        nees=nees / 3.0,
        nis=np.array([np.nan if value is None else value for value in nis]) / 3.0,
        rmse_m=float(np.sqrt((off * off).sum(axis=1).mean())),
    )


def cases(scene: str, scanner: str) -> Iterator[Case]:
    """All that is run on one recording."""
    yield Case(scene=scene, scanner=scanner)
    if scene in FEW:
        return
    yield Case(scene=scene, scanner=scanner, stated=False)
    yield Case(scene=scene, scanner=scanner, stride=1)
    if scanner == "full":
        for part in PARTS:
            yield Case(scene=scene, scanner=scanner, part=part)


def recorded(scene: str, scanner: str, seed: int, seconds: float) -> list[Frame]:
    """One drive."""
    settings: dict[str, Any] = {"dynamism": Dynamism.world_1(DYNAMISM), "seconds": seconds}
    if scene in FEW:
        settings |= {"walls": "none", "moving_share": FEW[scene]}
    name = "arena" if scene in FEW else scene
    return list(stream(name, seed=seed, laser=SCANNERS[scanner], **settings))


def measured(name: str, seeds: list[int], seconds: float) -> dict[Case, list[Run]]:
    """All runs; prints a line for each case when its seeds are done."""
    found: dict[Case, list[Run]] = {}
    worlds = [(scene, scanner) for scene in SCENES for scanner in SCANNERS]
    for scene, scanner in [*worlds, *((scene, "noise") for scene in FEW)]:
        for seed in seeds:
            frames = recorded(scene, scanner, seed, seconds)
            for case in cases(scene, scanner):
                found.setdefault(case, []).append(run(name, frames, case))
        for case in cases(scene, scanner):
            print(line(case, found[case]), flush=True)
    return found


def line(case: Case, runs: list[Run]) -> str:
    """One row of the table: mean over all frames of all seeds, and the runs' own means."""
    parts = [
        f"{case.scene:20s} {case.scanner:5s} {case.part.name:12s} {case.rate_hz:4.1f} Hz "
        f"{'stated' if case.stated else 'none':6s} "
        f"median RMSE {100.0 * statistics.median(one.rmse_m for one in runs):5.2f} cm"
    ]
    for name in ("nees", "nis"):
        means = np.array([one.mean(name) for one in runs])
        parts.append(
            f"{name.upper()}/3 mean {means.mean():5.2f}  median run {np.median(means):5.2f} "
            f"({means.min():.2f} .. {means.max():.2f})"
        )
    return "  ".join(parts)


def draw(found: dict[Case, list[Run]]) -> Figure:
    """NEES above, NIS below, a column for each scene."""
    figure = Figure(figsize=(11.0, 6.6), layout="constrained")
    axes = figure.subplots(2, len(SCENES), sharex=True, sharey="row", squeeze=False)
    for column, scene in enumerate(SCENES):
        for scanner in SCANNERS:
            colour, name = COLOURS[scanner], NAMES[scanner]
            _band(axes[0, column], found[Case(scene=scene, scanner=scanner)], "nees", colour, name)
            for stated, style in ((True, "-"), (False, ":")):
                runs = found[Case(scene=scene, scanner=scanner, stated=stated)]
                label = f"{name}, covariance {'stated' if stated else 'not stated'}"
                _mean(axes[1, column], runs, colour, style, label)
        axes[0, column].set_title(f"{scene}, dynamism {DYNAMISM:g}, {FULL_RATE_HZ / 8:.1f} Hz")
        axes[1, column].set_xlabel("s")
    axes[0, 0].set_ylabel("NEES / 3 of the pose\nmedian of the runs, 10 to 90 %")
    axes[1, 0].set_ylabel("NIS / 3 of the odometry prior\nmean of the runs over 5 s")
    for ax in axes.ravel().tolist():
        ax.axhspan(0.5, 2.0, color="#168c5a", alpha=0.12, lw=0)
        ax.axhline(1.0, color="#168c5a", lw=0.8)
        ax.set_yscale("log")
        ax.grid(alpha=0.25)
    for row in (0, 1):
        axes[row, 0].legend(fontsize=7, loc="upper right")
    axes[0, 0].set_ylim(0.01, 20.0)
    axes[1, 0].set_ylim(0.1, 10.0)
    return figure


def _band(ax: Axes, runs: list[Run], name: str, colour: str, label: str) -> None:
    shortest = min(len(one.times) for one in runs)
    values = np.array([getattr(one, name)[1:shortest] for one in runs])
    times = runs[0].times[1:shortest]
    low, middle, high = np.nanquantile(values, (0.1, 0.5, 0.9), axis=0)
    ax.fill_between(times, low, high, color=colour, alpha=0.15, lw=0)
    ax.plot(times, middle, color=colour, lw=1.2, label=label)


def _mean(ax: Axes, runs: list[Run], colour: str, style: str, label: str) -> None:
    edges = np.arange(0.0, runs[0].times[-1], SETTLED_S)
    means = [
        np.nanmean([np.nanmean(r.nis[(r.times > a) & (r.times <= a + SETTLED_S)]) for r in runs])
        for a in edges
    ]
    ax.plot(edges + 0.5 * SETTLED_S, means, style, color=colour, lw=1.4, label=label)


def main(arguments: list[str] | None = None) -> int:
    """Print the table, write the figure."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--slam", default="shunting")
    parser.add_argument("--seeds", type=int, nargs="+", default=list(range(100, 110)))
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--out", type=Path, default=Path("docs/pictures/uncertainty.png"))
    wanted = parser.parse_args(arguments)
    found = measured(wanted.slam, wanted.seeds, wanted.seconds)
    draw(found).savefig(wanted.out, dpi=100)
    return 0


if __name__ == "__main__":
    sys.exit(ended(main))

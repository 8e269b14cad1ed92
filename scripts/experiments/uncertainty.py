# SPDX-License-Identifier: Apache-2.0
"""Is the stated uncertainty honest? ``python -m scripts.experiments.uncertainty``.

NEES / 3 of the online pose in the frame of the known start, and NIS / 3 of odometry's prior: both
are 1 on average where a covariance is right. Over seeds nobody tuned on, in arena and office, with
the scanner's noise alone and with all its errors, at both scan rates, with the covariance that the
odometry states and without it. Then with parts of the scanner, and where few things are in view: in
the arena without its walls, with some or all of its chairs on the move.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from scripts.comparison.recording import Recording
from scripts.experiments import shared
from scripts.experiments.shared import CM, Row, of
from scripts.experiments.study import Study
from scripts.figures import save, styled
from scripts.metrics.judged import SETTLED_S, world_truth
from scripts.paper.runs import follow
from slam import create
from slam.evaluation import metrics
from slam.frames import Float, Frame, Scan

SCENES = ("arena", "office")
FEW = {f"no walls, {share:.0%} move": share for share in (0.3, 0.5, 1.0)}
WHOLE = "all"
PARTS: dict[str, Row] = {  # of so many beams one; field of view, deg; farther returns are none, m
    "1°, 8 m": {"every": 2, "range_m": 8.0},
    "2°": {"every": 4},
    "1°, 90° wide": {"every": 2, "fov_deg": 90.0},
    "4 m": {"range_m": 4.0},
}
COLORS = {"noise": "#1f61be", "full": "#ce2c3c"}
STATED = ("stated", "not stated")


def fits(case: Row) -> bool:
    """Few things with noise alone; parts with every error; of the rest one thing at a time."""
    usual = case["part"] == WHOLE and case["odometry"] == STATED[0] and case["every"] == 8
    if case["scene"] in FEW:
        return bool(usual and case["scanner"] == "noise")
    odd = (case["part"] != WHOLE, case["odometry"] != STATED[0], case["every"] != 8)
    return sum(odd) <= 1 and bool(case["part"] == WHOLE or case["scanner"] == "full")


def drive(case: Row) -> Row:
    """One drive, of world 1."""
    few: Row = {"scene": "arena", "options": {"crowd": "none", "walls": "none"}}
    few = few | {"moving_share": FEW[case["scene"]]} if case["scene"] in FEW else {}
    return shared.world_1({**case, "level": 0.5}, scanner=case["scanner"], **few)


def poorer(scan: Scan, every: int = 1, fov_deg: float = 360.0, range_m: float = math.inf) -> Scan:
    """What is left of a scan."""
    spec = scan.spec
    chosen = np.arange(0, spec.n_beams, every)
    middle = 0.5 * (spec.angles[0] + spec.angles[-1])
    chosen = chosen[np.abs(spec.angles[chosen] - middle) <= 0.5 * math.radians(fov_deg) + 1e-9]
    less = replace(
        spec,
        n_beams=len(chosen),
        angle_min=float(spec.angles[chosen[0]]),
        angle_increment=spec.angle_increment * every,
        range_max=min(range_m, spec.range_max),
        beam_time_offsets=spec.beam_time_offsets[chosen],
    )
    ranges = scan.ranges[chosen]
    ranges[ranges > less.range_max] = np.inf
    return Scan(stamp_ns=scan.stamp_ns, ranges=ranges, spec=less)


def seen(frame: Frame, case: Row) -> Frame:
    """A frame as the case wants it."""
    if case["odometry"] != STATED[0]:
        frame = replace(frame, odometry=replace(frame.odometry, increment_covariance=None))
    if case["part"] != WHOLE:
        assert frame.scan is not None
        frame = replace(frame, scan=poorer(frame.scan, **PARTS[case["part"]]), labels=None)
    return frame


def run(case: Row, recording: Recording) -> Row:
    """RMS error of the settled frames, m; NEES / 3 and NIS / 3, and their means over these."""
    frames = [seen(frame, case) for frame in shared.kept(recording.frames, case["every"])]
    track, truth = follow(create("shunting"), frames, "shunting"), world_truth(frames)
    online = track.online()
    nis = [e.diagnostics.get("nis") for e in track.estimates]
    times = (online.stamps_ns - online.stamps_ns[0]) * 1e-9
    late = times > SETTLED_S
    both = {
        "nees": metrics.nees(online, track.covariances(), truth).values / 3.0,
        "nis": np.array([np.nan if value is None else value for value in nis]) / 3.0,
    }
    off = metrics.pose_errors(online, truth).errors[late, :2]
    row = {f"mean_{name}": float(np.nanmean(values[late])) for name, values in both.items()}
    row["rmse_m"] = float(np.sqrt((off * off).sum(axis=1).mean()))
    return row | {"times": times.tolist(), **{k: v.tolist() for k, v in both.items()}}


@styled()
def draw(rows: Sequence[Row], path: Path) -> None:
    """NEES above, NIS below, a column for each scene: of the whole scanner at 4.7 Hz."""
    figure = Figure(figsize=(11.0, 6.6))
    axes = figure.subplots(2, len(SCENES), sharex=True, sharey="row", squeeze=False)
    for column, scene in enumerate(SCENES):
        for scanner, color in COLORS.items():
            for stated, style in zip(STATED, ("-", ":"), strict=True):
                wanted = {"scene": scene, "scanner": scanner, "odometry": stated, "part": WHOLE,
                          "every": 8}  # fmt: skip
                own = [row for row in rows if wanted.items() <= row.items()]
                if not own:
                    continue
                times, nees, nis = (_stacked(own, name) for name in ("times", "nees", "nis"))
                if stated == STATED[0]:
                    low, middle, high = np.nanquantile(nees, (0.1, 0.5, 0.9), axis=0)
                    axes[0, column].fill_between(times[0], low, high, color=color, alpha=0.15, lw=0)
                    axes[0, column].plot(times[0], middle, color=color, label=scanner)
                edges = np.arange(0.0, times[0, -1], SETTLED_S)
                spans = [(times[0] > a) & (times[0] <= a + SETTLED_S) for a in edges]
                means = [np.nanmean(nis[:, span]) for span in spans]
                label = f"{scanner}, covariance {stated}"
                axes[1, column].plot(
                    edges + 0.5 * SETTLED_S, means, style, color=color, label=label
                )
        axes[0, column].set_title(f"{scene}, dynamism 0.5, 4.7 Hz")
        axes[1, column].set_xlabel("s")
    axes[0, 0].set_ylabel("NEES / 3 of the pose\nmedian of the runs, 10 to 90 %")
    axes[1, 0].set_ylabel("NIS / 3 of the odometry prior\nmean of the runs over 5 s")
    for ax in axes.ravel().tolist():
        ax.axhspan(0.5, 2.0, color="#168c5a", alpha=0.12, lw=0)
        ax.set_yscale("log")
    for row in (0, 1):
        if axes[row, 0].get_legend_handles_labels()[0]:
            axes[row, 0].legend(fontsize=7, loc="upper right")
    save(figure, path)


def _stacked(rows: Sequence[Row], name: str) -> Float:
    """(runs, frames) without the first frame, as long as the shortest run."""
    shortest = min(len(row[name]) for row in rows)
    return np.array([row[name][1:shortest] for row in rows], dtype=np.float64)


def spread(key: str) -> shared.Column:
    """A column: mean, median and range over the runs."""

    def tell(rows: Sequence[Row]) -> str:
        runs = [row[key] for row in rows]
        middle = f"{np.mean(runs):.2f}, {np.median(runs):.2f}"
        return f"{middle} ({min(runs):.2f} to {max(runs):.2f})"

    return tell


STUDY = Study(
    name="uncertainty",
    axes={"scene": (*SCENES, *FEW), "scanner": tuple(COLORS), "every": (8, 1), "odometry": STATED,
          "part": (WHOLE, *PARTS)},
    drive=drive, fits=fits, run=run, lines=("scene", "scanner", "part", "every", "odometry"),
    columns={"RMSE, cm": of("rmse_m", scale=CM), "NEES / 3": spread("mean_nees"),
             "NIS / 3": spread("mean_nis")},
    brief=lambda row: {k: v for k, v in row.items() if not isinstance(v, list)},
    draw=draw, picture=Path("docs/pictures/uncertainty.png"), defaults={"first_seed": 100},
)  # fmt: skip


if __name__ == "__main__":
    sys.exit(STUDY.main())

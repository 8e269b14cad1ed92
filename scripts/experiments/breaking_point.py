# SPDX-License-Identifier: Apache-2.0
"""At which level each SLAM breaks: ``python -m scripts.experiments.breaking_point``.

For motion and for change apart: unaligned ATE, runs lost by the rule of ``slam.evaluation.lost``,
and for SLAMs that state a covariance the true position error over the one that they claim.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FormatStrFormatter

from scripts import figures
from scripts.comparison.recording import Recording
from scripts.comparison.tables import number
from scripts.experiments import shared
from scripts.experiments.shared import CM, PERCENT, Row, of
from scripts.experiments.study import Study
from scripts.figures import color_of, save, styled
from scripts.options import Axis
from slam.evaluation.lost import LOST_RULE
from slam.evaluation.statistics import quantile
from slam.frames import BeamClass

SLAMS = ("kiss-icp", "karto", "occupancy", "ekf", "shunting", "oracle(shunting)")
SCENES = ("arena", "office", "gallery", "station")
ATE, MOVING = "ate_unaligned_m", "moving_share_of_returns"
LEAST_CM, MOST_CM = 0.2, 1000.0  # of the picture


def run(case: Row, drive: Recording) -> Row:
    """And the claimed and the true position error, m, root mean square over the scans; and how
    much of what the scanner met was moving.

    The claim is 1 sigma, the root of the covariance's trace over x and y.
    """
    row, track = shared.judged_with(case, drive)
    row[MOVING] = drive.share_of_returns(BeamClass.MOVING)
    covariances = track.covariances()
    variances = covariances[:, 0, 0] + covariances[:, 1, 1]
    if not row["failure"] and variances.any():
        row |= {"claimed_m": math.sqrt(float(variances.mean())), "off_m": row[ATE]}
    return row


def ates_m(rows: Sequence[Row]) -> list[float]:
    """Infinite where it failed."""
    return [value for value in (number(row, ATE) for row in rows) if value is not None]


def cell(rows: Sequence[Row]) -> str:
    """Median ATE in cm (lost), and error over claim where one is stated."""
    ate, lost = quantile(ates_m(rows), 0.5), sum(row["lost"] for row in rows)
    words = f"{CM * ate:.1f}" if math.isfinite(ate) else "failed"
    words += f" ({lost})" if lost else ""
    stated = [(row["off_m"], row["claimed_m"]) for row in rows if "claimed_m" in row]
    if stated:
        off, claimed = np.median(stated, axis=0)
        words += f" ×{off / claimed:.1f}"
    return words


@styled({"grid.alpha": 0.3})
def picture(rows: Sequence[Row], path: Path) -> None:
    """A row of panels for each axis, a panel for each scene: median error over the level."""
    axes, rooms, slams = (
        list(dict.fromkeys(r[k] for r in rows)) for k in ("axis", "scene", "slam")
    )
    figure = Figure(figsize=(max(3.6 * len(rooms), 6.4), 3.1 * len(axes) + 1.0))
    grid: Any = figure.subplots(len(axes), len(rooms), sharey=True, squeeze=False)
    for ax, (axis, scene) in zip(grid.flat, product(axes, rooms), strict=True):
        own = [row for row in rows if (row["axis"], row["scene"]) == (axis, scene)]
        levels = sorted({row["level"] for row in own})
        for slam in slams:
            of_it = [row for row in own if row["slam"] == slam]
            aside, color = figures.apart(slam, slams, levels), color_of(slam, slams)
            at = [(level, [row for row in of_it if row["level"] == level]) for level in levels]
            points = [
                (level + aside, _shown(quantile(ates_m(found), 0.5)), math.nan, math.nan)
                for level, found in at
            ]
            figures.line(ax, points, color, figures.marker(slam, slams), slam)
            lost = [
                (r["level"] + aside, _shown(m)) for r in of_it if r["lost"] for m in ates_m([r])
            ]
            ax.plot(
                *zip(*lost, strict=True) if lost else ((), ()), "x", color=color, ms=4, alpha=0.8
            )
        figures.level_axis(ax, levels, f"{axis}, 0 to 1")
        ax.set(title=scene, yscale="log", ylim=(0.8 * LEAST_CM, 1.3 * MOST_CM))
        ax.yaxis.set_major_formatter(FormatStrFormatter("%g"))
    grid[0][0].set_ylabel("position error (ATE) in cm,\nunaligned, median")
    handles, labels = grid[0][0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=4, frameon=False)
    figure.supxlabel(f"x: a lost run; lost: {LOST_RULE}", fontsize=8)
    path.parent.mkdir(parents=True, exist_ok=True)
    save(figure, path)


def _shown(error_m: float) -> float:
    """cm, within the picture; a SLAM that failed is at the top."""
    return min(max(CM * error_m, LEAST_CM), MOST_CM)


STUDY = Study(
    name="breaking_point",
    axes={"axis": ("motion", "change"), "scene": SCENES, "level": (0.0, 0.25, 0.5, 0.75, 1.0),
          "scanner": ("noise",), "slam": SLAMS},
    drive=lambda case: {
        "scene": case["scene"], "seed": case["seed"], "seconds": case["seconds"], "every": 8,
        "scanner": case["scanner"], **Axis(name=case["axis"]).at(case["level"]),
    },
    run=run, lines=("axis", "scene", "level"), across="slam", cell=cell,
    columns={"moving, %": of(MOVING, np.mean, PERCENT, "{:.1f}")}, draw=picture,
    told="World {world}, {seeds} runs of {seconds:g} s a point, seeds from {first_seed}, one scan "
    "in 8, scanner {scanner[0]}. Median ATE in cm, in brackets how many runs were lost; × is "
    "the true position error over the claimed one (1 σ), for those that state a covariance. "
    f"Lost: {LOST_RULE}.",
    picture=Path("docs/pictures/breaking_point.png"), page=Path("docs/dynamism.md"), results=True,
)  # fmt: skip


if __name__ == "__main__":
    sys.exit(STUDY.main())

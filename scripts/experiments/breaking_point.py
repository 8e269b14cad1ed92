# SPDX-License-Identifier: Apache-2.0
"""At which level each SLAM breaks: ``python -m scripts.experiments.breaking_point``.

For motion and for change apart: unaligned ATE, runs lost by the rule of ``slam.evaluation.lost``,
and for SLAMs that state a covariance the true position error over the one that they claim.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, FormatStrFormatter, NullLocator

from scripts.comparison.recording import Recording
from scripts.comparison.tables import number
from scripts.experiments import shared
from scripts.experiments.shared import CM, PERCENT, Row, of
from scripts.experiments.study import Study
from scripts.figures import save, styled
from scripts.options import Axis
from slam.evaluation.lost import LOST_RULE
from slam.evaluation.statistics import quantile
from slam.frames import BeamClass

SLAMS = ("kiss-icp", "karto", "occupancy", "ekf", "shunting", "oracle(shunting)")
SCENES = ("arena", "office", "gallery", "station")
ATE, MOVING = "ate_unaligned_m", "moving_share_of_returns"
LEAST_CM, MOST_CM = 0.2, 1000.0  # of the picture; a SLAM that failed is at the top
_COLORS = ("#1f61be", "#7a3fb0", "#0b8c96", "#8c6d1f", "#ce2c3c", "#202020", "#de6e18", "#5f9e3f")
_MARKERS = "osD^vP*X"
_TICKS_CM = (0.3, 1, 3, 10, 30, 100, 300, 1000)
_ASIDE = 0.012


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
    for i, axis in enumerate(axes):
        for j, scene in enumerate(rooms):
            own = [row for row in rows if (row["axis"], row["scene"]) == (axis, scene)]
            for k, slam in enumerate(slams):
                _curve(grid[i][j], [row for row in own if row["slam"] == slam], k, len(slams))
            _finish(grid[i][j], axis, scene, sorted({row["level"] for row in own}))
        grid[i][0].set_ylabel("position error (ATE) in cm,\nunaligned, median")
    handles, labels = grid[0][0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=4, frameon=False)
    figure.supxlabel(f"x: a lost run; lost: {LOST_RULE}", fontsize=8)
    path.parent.mkdir(parents=True, exist_ok=True)
    save(figure, path)


def _curve(ax: Axes, rows: Sequence[Row], k: int, of_them: int) -> None:
    """The medians, and a cross for each lost run; side by side, so that all are seen."""
    color, aside = _COLORS[k % len(_COLORS)], _ASIDE * (k - 0.5 * (of_them - 1))
    levels, slam = sorted({row["level"] for row in rows}), rows[0]["slam"]
    at = [[row for row in rows if row["level"] == level] for level in levels]
    ax.plot(
        np.add(levels, aside), [_shown(quantile(ates_m(own), 0.5)) for own in at],
        "--" if slam.startswith("oracle(") else "-", color=color, label=slam,
        marker=_MARKERS[k % len(_MARKERS)], ms=4.5, mec="white", mew=0.5, lw=1.4,
    )  # fmt: skip
    lost = [row for row in rows if row["lost"]]
    errors = [_shown(ate) for row in lost for ate in ates_m([row])]
    ax.plot([row["level"] + aside for row in lost], errors, "x", color=color, ms=4.0, alpha=0.8)


def _shown(error_m: float) -> float:
    """cm, within the picture."""
    return min(max(CM * error_m, LEAST_CM), MOST_CM)


def _finish(ax: Axes, axis: str, scene: str, levels: Sequence[float]) -> None:
    ax.set(
        title=scene, yscale="log", xlabel=f"{axis}, 0 to 1", ylim=(0.8 * LEAST_CM, 1.3 * MOST_CM)
    )
    ax.set_xticks(levels)
    ax.yaxis.set_major_locator(FixedLocator(_TICKS_CM))
    ax.yaxis.set_major_formatter(FormatStrFormatter("%g"))
    ax.yaxis.set_minor_locator(NullLocator())


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

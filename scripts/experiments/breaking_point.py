# SPDX-License-Identifier: Apache-2.0
"""At which level each SLAM breaks: ``python -m scripts.experiments.breaking_point``.

For motion and for change apart, a comparison (``scripts.comparison``) of SLAMs and the oracle over
scenes, levels and seeds: unaligned ATE, runs lost by the rule of ``slam.evaluation.lost``, and for
SLAMs that state a covariance the position error that they claim (1 sigma) beside the true one.

Stopped, the same command goes on. ``--out`` has a folder of ``mobilia compare`` for each axis.
Writes ``docs/results/breaking_point.json`` and ``docs/pictures/breaking_point.png``, a column for
each scene.
"""

from __future__ import annotations

import argparse
import math
import sys
import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FixedLocator, FormatStrFormatter, NullLocator

from scripts.comparison import folder, make
from scripts.comparison.plan import Plan
from scripts.comparison.tables import number
from scripts.experiments.measured import add_options, head, seeds_of, table
from scripts.figures import save, styled
from scripts.knobs import AXES
from scripts.marks import fill_page
from scripts.result_files import write
from sim.core.versions import WORLD
from slam import se2
from slam.errors import MobiliaError
from slam.evaluation.lost import LOST_RULE
from slam.evaluation.statistics import quantile

OUT = Path("out/breaking_point")
PICTURE = Path("docs/pictures/breaking_point.png")
PAGE, MARK = Path("docs/dynamism.md"), "breaking_point"
SLAMS = ("kiss-icp", "karto", "occupancy", "ekf", "shunting", "oracle(shunting)")
SCENES = ("arena", "office", "gallery", "station")
ATE, MOVING = "ate_unaligned_m", "moving_share_of_returns"
LEAST_CM, MOST_CM = 0.2, 1000.0  # of the picture; a SLAM that failed is at the top
CM = 100.0
_COLORS = ("#1f61be", "#7a3fb0", "#0b8c96", "#8c6d1f", "#ce2c3c", "#202020", "#de6e18", "#5f9e3f")
_MARKERS = "osD^vP*X"
_TICKS_CM = (0.3, 1, 3, 10, 30, 100, 300, 1000)
_ASIDE = 0.012
CHARACTERS_PER_INCH = 15  # of the smallest print of the picture
Row = dict[str, Any]


def claims(compared: folder.Compared, run: Row) -> tuple[float, float]:
    """(claimed, true) position error of a SLAM's run, m, root mean square over its scans.

    The claim is 1 sigma, the root of the covariance's trace over x and y; NaN for both without one.
    """
    file = compared.run(run["scene"], run["dynamism"], int(run["seed"]))
    said = file.believed(run["slam"])
    variances = said.covariances[:, 0, 0] + said.covariances[:, 1, 1]
    if not variances.any():
        return math.nan, math.nan
    rows = np.searchsorted(file.stamps_ns, said.stamps_ns)
    start = file.truth[0]
    true = np.array([se2.between(start, pose) for pose in file.truth[rows]])
    off = said.poses[:, :2] - true[:, :2]
    claimed_m = math.sqrt(float(variances.mean()))
    return claimed_m, math.sqrt(float((off * off).sum(axis=1).mean()))


def rows_of(axis: str, compared: folder.Compared) -> list[Row]:
    """A row for each scene, level and SLAM of a comparison."""
    groups: dict[tuple[Any, ...], list[Row]] = {}
    for run in compared.runs:
        groups.setdefault((run["scene"], run["dynamism"], run["slam"]), []).append(run)
    out = []
    for (scene, level, slam), runs in groups.items():
        errors_m = [v for v in (number(run, ATE) for run in runs) if v is not None]
        claimed = np.array([claims(compared, run) for run in runs])
        stated = claimed[np.isfinite(claimed).all(axis=1)]
        out.append(
            {
                "axis": axis, "scene": scene, "level": level, "slam": slam, "runs": len(runs),
                "lost": int(sum(run["lost"] for run in runs)),
                "ate_median_m": quantile(errors_m, 0.5) if errors_m else math.inf,
                "ate_worst_m": max(errors_m, default=math.inf),
                "claimed_m": float(np.median(stated[:, 0])) if len(stated) else math.nan,
                "error_m": float(np.median(stated[:, 1])) if len(stated) else math.nan,
                MOVING: float(np.mean([run[MOVING] for run in runs])),
                "lost_ates_m": [number(run, ATE) for run in runs if run["lost"]],
            }
        )  # fmt: skip
    return out


def markdown(rows: Sequence[Row], slams: Sequence[str], told: str) -> str:
    """A table: median ATE in cm (lost), and error over claim where one is stated."""
    found = {(row["axis"], row["scene"], row["level"], row["slam"]): row for row in rows}
    lines = []
    for axis, scene, level in dict.fromkeys(key[:3] for key in found):
        own = [found[axis, scene, level, slam] for slam in slams]
        cells = [_cell(row) for row in own]
        share = f"{CM * own[0][MOVING]:.1f}"
        lines.append([f"{axis}, {scene}", f"{level:g}", share, *cells])
    heads = ["axis, scene", "level", "moving, %", *slams]
    return f"{table(heads, lines)}\n\n{told}"


def _cell(row: Row) -> str:
    ate, lost = row["ate_median_m"], row["lost"]
    words = f"{CM * ate:.1f}" if math.isfinite(ate) else "failed"
    words += f" ({lost})" if lost else ""
    if math.isfinite(row["claimed_m"]) and row["claimed_m"] > 0.0:
        words += f" ×{row['error_m'] / row['claimed_m']:.1f}"
    return words


@styled({"grid.alpha": 0.3})
def picture(rows: Sequence[Row], slams: Sequence[str], told: str, path: Path) -> None:
    """A row of panels for each axis, a panel for each scene: median error over the level."""
    wanted = list(dict.fromkeys(row["axis"] for row in rows))
    rooms = list(dict.fromkeys(row["scene"] for row in rows))
    figure = Figure(figsize=(max(3.6 * len(rooms), 6.4), 3.1 * len(wanted) + 1.0))
    grid: Any = figure.subplots(len(wanted), len(rooms), sharey=True, squeeze=False)
    for i, axis in enumerate(wanted):
        for j, scene in enumerate(rooms):
            own = [row for row in rows if (row["axis"], row["scene"]) == (axis, scene)]
            for k, slam in enumerate(slams):
                _curve(grid[i][j], [row for row in own if row["slam"] == slam], k, len(slams))
            _finish(grid[i][j], axis, scene, sorted({row["level"] for row in own}))
        grid[i][0].set_ylabel("position error (ATE) in cm,\nunaligned, median")
    handles = [
        Line2D([], [], color=_COLORS[k % len(_COLORS)], marker=_MARKERS[k % len(_MARKERS)], ms=4.5,
               lw=1.4, ls=_style(slam), label=slam)
        for k, slam in enumerate(slams)
    ]  # fmt: skip
    handles.append(Line2D([], [], color="0.4", marker="x", ls="", ms=5, label="a lost run"))
    figure.legend(handles=handles, loc="outside upper center", ncols=4, frameon=False)
    wide = int(CHARACTERS_PER_INCH * figure.get_figwidth())
    figure.supxlabel(textwrap.fill(told, wide), fontsize=8)
    path.parent.mkdir(parents=True, exist_ok=True)
    save(figure, path)


def _style(slam: str) -> str:
    return "--" if slam.startswith("oracle(") else "-"


def _curve(ax: Axes, rows: Sequence[Row], k: int, of: int) -> None:
    """The medians, and a cross for each lost run; side by side, so that all are seen."""
    color, aside = _COLORS[k % len(_COLORS)], _ASIDE * (k - 0.5 * (of - 1))
    rows = sorted(rows, key=lambda row: float(row["level"]))
    at = [row["level"] + aside for row in rows]
    ax.plot(
        at, [_shown(row["ate_median_m"]) for row in rows], _style(rows[0]["slam"]), color=color,
        marker=_MARKERS[k % len(_MARKERS)], ms=4.5, mec="white", mew=0.5, lw=1.4,
    )  # fmt: skip
    for x, row in zip(at, rows, strict=True):
        errors = [_shown(math.inf if e is None else e) for e in row["lost_ates_m"]]
        ax.plot([x] * len(errors), errors, "x", color=color, ms=4.0, mew=1.0, alpha=0.8)


def _shown(error_m: float) -> float:
    """cm, within the picture."""
    return min(max(CM * error_m, LEAST_CM), MOST_CM)


def _finish(ax: Axes, axis: str, scene: str, levels: Sequence[float]) -> None:
    name = axis
    ax.set(
        title=scene, yscale="log", xlabel=f"{name}, 0 to 1", ylim=(0.8 * LEAST_CM, 1.3 * MOST_CM)
    )
    ax.set_xticks(levels)
    ax.yaxis.set_major_locator(FixedLocator(_TICKS_CM))
    ax.yaxis.set_major_formatter(FormatStrFormatter("%g"))
    ax.yaxis.set_minor_locator(NullLocator())


def plan_of(axis: str, wanted: argparse.Namespace) -> Plan:
    """The comparison of one axis; raises ``InvalidValueError`` for what cannot be."""
    return Plan(
        slams=tuple(wanted.slams),
        scenes=tuple(wanted.scenes),
        levels=tuple(wanted.levels),
        seeds=tuple(seeds_of(wanted)),
        seconds=wanted.seconds,
        every=wanted.every,
        scanner=wanted.scanner,
        axis=axis,
    )


def told_of(wanted: argparse.Namespace) -> str:
    """How it was made, in a line."""
    return (
        f"World {WORLD}, {wanted.seeds} runs of {wanted.seconds:g} s a point, "
        f"seeds from {wanted.first_seed}, one scan in {wanted.every}, "
        f"scanner {wanted.scanner}; lost: {LOST_RULE}"
    )


EXPLAINED = (
    "Median ATE in cm, in brackets how many runs were lost; × is the true position error over the "
    "claimed one (1 σ), for those that state a covariance. "
)


def cells(rows: Sequence[Row]) -> dict[str, Row]:
    """By "axis scene slam": numbers, level by level."""
    numbers = ("lost", "ate_median_m", "ate_worst_m", "claimed_m", "error_m", MOVING)
    out: dict[str, Row] = {}
    for row in rows:
        key = f"{row['axis']} {row['scene']} {row['slam']}"
        cell = out.setdefault(key, {number: [] for number in numbers})
        for name in numbers:
            cell[name].append(row[name])
    return out


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--slams", nargs="+", default=list(SLAMS))
    parser.add_argument("--scenes", nargs="+", default=list(SCENES))
    parser.add_argument("--axis", nargs="+", choices=AXES, default=["motion", "change"])
    parser.add_argument("--levels", nargs="+", type=float, default=[0.0, 0.25, 0.5, 0.75, 1.0])
    parser.add_argument("--every", type=int, default=8, help="use one scan in so many")
    parser.add_argument("--scanner", default="noise")
    parser.add_argument("--out", type=Path, default=OUT, help="folder of the comparisons")
    parser.add_argument("--picture", type=Path, default=PICTURE)
    add_options(parser, "breaking_point.json", PAGE)
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Make what is missing, print the table, write results, picture and page."""
    wanted = _parser().parse_args(arguments)
    asked = ("axis", "scenes", "slams", "levels", "every", "scanner")
    rows: list[Row] = []
    try:
        first = head(wanted, MARK, arguments, *asked)
        plans = {axis: plan_of(axis, wanted) for axis in wanted.axis}  # all, before any is made
        for axis, plan in plans.items():
            make.carry_out(plan, wanted.out / axis, jobs=wanted.jobs)
            rows += rows_of(axis, folder.read(wanted.out / axis))
        text = markdown(rows, wanted.slams, f"{EXPLAINED}{told_of(wanted)}.")
        write(wanted.results, {**first, "lost_rule": LOST_RULE}, {"broken": cells(rows)})
        picture(rows, wanted.slams, told_of(wanted), wanted.picture)
        if not wanted.no_page:
            fill_page(wanted.page, MARK, text)
    except (MobiliaError, OSError) as error:
        print(error, file=sys.stderr)
        return 1
    print(text)
    return 0


if __name__ == "__main__":
    sys.exit(main())

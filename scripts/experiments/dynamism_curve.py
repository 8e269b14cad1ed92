# SPDX-License-Identifier: Apache-2.0
"""The dynamism curve: error and losses against dynamism.

``python -m scripts.experiments.dynamism_curve out/compare --out dynamism.png``.

Reads the folder of ``mobilia compare``: a picture of error and losses against dynamism, and
Spearman's rank correlation of dynamism with them over the medians of the levels. Beside both stands
what was observed: the share of returns that came from something moving.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, FormatStrFormatter, NullLocator
from scipy.stats import spearmanr

from scripts.comparison.folder import Compared, read
from scripts.figures import color_of, save, styled
from slam.errors import InvalidValueError, MobiliaError
from slam.evaluation.lost import LOST_RULE

PICTURE = Path("docs/pictures/dynamism.png")
ATE, ALIGNED, LOST = "ate_unaligned_m", "ate_se2_m", "lost"
MOVING = "moving_share_of_returns"
CORRELATED = {"ATE": ATE, "aligned": ALIGNED, "lost": LOST, "moving": MOVING}
LEAST_LEVELS = 3
SCANNERS = {"full": "every error of the scanner", "noise": "a scanner with noise only"}
_BAND = 0.13
_ASIDE = 0.015
_MARKERS = "osD^vP"  # curves that lie on each other are told apart by them, too
_TICKS_CM = (1, 2, 5, 10, 20, 50, 100, 200)


class Curve:
    """One metric of one SLAM in one scene: (n,) levels, values, low and high of the interval."""

    def __init__(self, compared: Compared, scene: str, slam: str, metric: str) -> None:
        wanted = {"scene": scene, "slam": slam, "metric": metric}
        rows = [row for row in compared.levels if all(row[key] == wanted[key] for key in wanted)]
        rows.sort(key=lambda row: row["dynamism"])
        self.levels, self.values, self.low, self.high = (
            np.array([row[key] for row in rows], dtype=np.float64)
            for key in ("dynamism", "value", "low", "high")
        )

    def correlation(self) -> float:
        """Spearman's rho of level and value; NaN where the values are all the same."""
        if len(self.levels) < LEAST_LEVELS or len(set(self.values.tolist())) == 1:
            return float("nan")
        return float(spearmanr(self.levels, self.values).statistic)


def correlations(compared: Compared) -> list[dict[str, Any]]:
    """A row for each scene and SLAM: rho of dynamism with what ``CORRELATED`` names."""
    settings = compared.recipe["settings"]
    if len(settings["levels"]) < LEAST_LEVELS:
        raise InvalidValueError(
            f"a rank correlation needs {LEAST_LEVELS} levels, {compared.folder} has "
            f"{settings['levels']}"
        )
    return [
        {
            "scene": scene,
            "slam": slam,
            **{
                name: Curve(compared, scene, slam, metric).correlation()
                for name, metric in CORRELATED.items()
            },
        }
        for scene in settings["scenes"]
        for slam in settings["slams"]
    ]


@styled({"grid.alpha": 0.3})
def picture(compared: Compared, path: Path) -> None:
    """Error above, losses below, a column for each scene."""
    settings = compared.recipe["settings"]
    scenes, slams = settings["scenes"], settings["slams"]
    figure = Figure(figsize=(4.2 * len(scenes), 5.2))
    grid: Any = figure.subplots(
        2, len(scenes), sharex="col", sharey="row", squeeze=False, height_ratios=(1.5, 1.0)
    )
    for column, scene in enumerate(scenes):
        errors, losses = grid[0][column], grid[1][column]
        for k, slam in enumerate(slams):
            color, marker = color_of(slam, slams), _MARKERS[k % len(_MARKERS)]
            aside = _ASIDE * (k - 0.5 * (len(slams) - 1))
            _draw_errors(errors, Curve(compared, scene, slam, ATE), aside, color, marker, slam)
            _draw_shares(losses, Curve(compared, scene, slam, LOST), aside, color, marker)
        errors.set(title=scene, yscale="log")
        errors.yaxis.set_major_locator(FixedLocator(_TICKS_CM))
        errors.yaxis.set_major_formatter(FormatStrFormatter("%g"))
        errors.yaxis.set_minor_locator(NullLocator())
        _name_levels(losses, Curve(compared, scene, slams[0], MOVING))
    runs, scanner = len(settings["seeds"]), settings.get("scanner", "full")
    grid[0][0].set_ylabel("position error (ATE) in cm,\nunaligned: median, 95 % interval")
    grid[1][0].set_ylabel("runs lost in %,\n95 % interval")
    grid[1][0].set_ylim(-4.0, 104.0)
    handles, labels = grid[0][0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=len(slams), frameon=False)
    figure.supxlabel(
        "dynamism (below it: share of the scanner's returns that come from things that move)\n"
        f"{runs} runs of {settings['seconds']:g} s a point, seeds {settings['seeds'][0]} to "
        f"{settings['seeds'][-1]}; {SCANNERS.get(scanner, scanner)}",
        fontsize=9,
    )
    save(figure, path)


def _draw_errors(ax: Axes, curve: Curve, aside: float, color: str, marker: str, label: str) -> None:
    top = np.where(np.isfinite(curve.high), curve.high, np.nan)
    at = curve.levels + aside
    ax.fill_between(at, 100.0 * curve.low, 100.0 * top, color=color, alpha=_BAND, lw=0.0)
    ax.plot(
        at, 100.0 * curve.values, "-", marker=marker, color=color, lw=1.4, ms=4.5, mec="white",
        mew=0.5, label=label,
    )  # fmt: skip


def _draw_shares(ax: Axes, curve: Curve, aside: float, color: str, marker: str) -> None:
    """Side by side, so that curves at zero are all seen."""
    below, above = curve.values - curve.low, curve.high - curve.values
    ax.errorbar(
        curve.levels + aside, 100.0 * curve.values, yerr=100.0 * np.stack([below, above]),
        fmt="-", marker=marker, color=color, lw=1.2, ms=4.5, mec="white", mew=0.5, elinewidth=0.8,
        capsize=2.0,
    )  # fmt: skip


def _name_levels(ax: Axes, moving: Curve) -> None:
    names = [
        f"{level:g}\n{100.0 * share:.1f} %"
        for level, share in zip(moving.levels, moving.values, strict=True)
    ]
    ax.set_xticks(moving.levels, names)


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the correlations, write the picture."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path, help="of mobilia compare")
    parser.add_argument("--out", type=Path, default=PICTURE)
    wanted = parser.parse_args(arguments)
    try:
        compared = read(wanted.folder)
        rows = correlations(compared)
        picture(compared, wanted.out)
    except MobiliaError as error:
        print(error, file=sys.stderr)
        return 1
    print("Spearman's rho with dynamism, over the medians of the levels (nan: all the same)")
    heads = "".join(f"{name:>9s}" for name in CORRELATED)
    print(f"{'scene':12s}{'SLAM':16s}{heads}")
    for row in rows:
        numbers = "".join(f"{row[name]:9.2f}" for name in CORRELATED)
        print(f"{row['scene']:12s}{row['slam']:16s}{numbers}")
    print(
        f"ATE: unaligned; aligned: the same after a rigid motion, without the error of the first "
        f"scan, on which a map is built\nlost: {LOST_RULE}\nmoving: share of returns\n{wanted.out}"
    )
    return 0


if __name__ == "__main__":
    sys.exit(main())

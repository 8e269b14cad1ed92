# SPDX-License-Identifier: Apache-2.0
"""The share of lost runs against the level, from a ``leaderboard.json``: two pictures.

One has the mean of the tracks that count, the other a panel for each track.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from scripts.figures import save, styled
from scripts.report.answer import ODOMETRY
from slam.errors import LogFormatError
from slam.frames import Float

ORACLE = "oracle"  # of every track its own
PERCENT = 100.0
COLUMNS = 4
APART = 4.2  # percent between two names at the ends of their lines
_TITLE = "share of runs lost, %"
_COLORS = ("#ce2c3c", "#1f61be", "#7a3fb0", "#0b8c96", "#8c6d1f", "#5d8a1e", "#b8418f", "#2f9fd0",
           "#a0583c", "#3b2f7d", "#59616e", "#de6e18")  # fmt: skip
_CONTROL = "#9a9a9a"
_MARKERS = "osD^vP*Xh<>d"
Shares = Mapping[str, Mapping[str, Float]]  # by SLAM and track: (levels,) percent


@dataclass(frozen=True, kw_only=True, eq=False)
class Lost:
    """What a leaderboard says of lost runs.

    levels  (n,) the same on all tracks
    tracks  by name: whether the oracle makes it count
    shares  by SLAM, then track: (n,) percent of runs lost
    runs    of each SLAM at each level of a track
    """

    levels: Float
    tracks: Mapping[str, bool]
    shares: Shares
    runs: int

    @property
    def counting(self) -> list[str]:
        """The tracks that count."""
        return [name for name, counts in self.tracks.items() if counts]

    def mean(self, slam: str) -> Float:
        """(n,) percent, over the tracks that count."""
        own = [self.shares[slam][t] for t in self.counting if t in self.shares[slam]]
        return np.mean(own, axis=0) if own else np.full(len(self.levels), np.nan)


def read(path: Path) -> Lost:
    """Of a ``leaderboard.json``; raises ``LogFormatError`` for anything else."""
    try:
        board = json.loads(path.read_text())
        tracks = {name: bool(track["counts"]) for name, track in board["tracks"].items()}
        levels = np.array(board["levels_run"], dtype=np.float64)
        shares: dict[str, dict[str, Float]] = {}
        for key, row in board["lost_shares"].items():
            track, _, slam = key.partition(" ")
            if row["levels"] == levels.tolist():
                shares.setdefault(shown_name(slam), {})[track] = PERCENT * np.array(row["lost"])
        return Lost(levels=levels, tracks=tracks, shares=shares, runs=len(board["seeds"]))
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise LogFormatError(path, f"not a leaderboard of mobilia benchmark: {error!r}") from error


def shown_name(slam: str) -> str:
    """``ORACLE`` for each track's own one."""
    return ORACLE if slam.startswith(f"{ORACLE}(") else slam


def _order(lost: Lost) -> list[str]:
    """Who is lost most comes first, the controls last."""
    ranked = sorted(lost.shares, key=lambda slam: -float(np.nan_to_num(lost.mean(slam)).sum()))
    return sorted(ranked, key=is_control)


def is_control(slam: str) -> bool:
    """Whether it is in every table, and no contestant."""
    return slam in (ODOMETRY, ORACLE)


def _look(slam: str, k: int) -> dict[str, Any]:
    if slam == ORACLE:
        return {"color": "#202020", "ls": "--", "marker": "", "lw": 1.6}
    if is_control(slam):
        return {"color": _CONTROL, "ls": ":", "marker": "", "lw": 1.6}
    wide = 2.4 if slam == "shunting" else 1.4
    return {"color": _COLORS[k % len(_COLORS)], "ls": "-", "lw": wide, "ms": 4.5, "mec": "white",
            "mew": 0.5, "marker": _MARKERS[k % len(_MARKERS)]}  # fmt: skip


def _looks(lost: Lost) -> dict[str, dict[str, Any]]:
    names = sorted(lost.shares, key=lambda slam: (slam != "shunting", slam))
    return {slam: _look(slam, k) for k, slam in enumerate(names)}


@styled({"grid.alpha": 0.3})
def overall(lost: Lost, path: Path) -> None:
    """The mean over the tracks that count, each SLAM named at the end of its line."""
    figure = Figure(figsize=(8.2, 4.6))
    ax: Axes = figure.subplots()
    looks = _looks(lost)
    ends: list[tuple[float, str]] = []
    for slam in _order(lost):
        mean = lost.mean(slam)
        if np.isfinite(mean).all():
            ax.plot(lost.levels, mean, **looks[slam])
            ends.append((float(mean[-1]), slam))
    last, right = float(lost.levels[-1]), 0.03 * float(lost.levels[-1] - lost.levels[0])
    for (end, slam), at in zip(ends, spread([end for end, _ in ends]), strict=True):
        ax.plot([last, last + right], [end, at], color=looks[slam]["color"], lw=0.6, clip_on=False)
        ax.text(last + 1.3 * right, at, f"{slam}  {end:.0f} %", color=looks[slam]["color"],
                va="center", fontsize=8.5, clip_on=False)  # fmt: skip
    _axes(ax, lost, "level of a track, 0 (nothing of its trouble) to 1 (all)")
    ax.set(xlim=(float(lost.levels[0]), last), ylabel=_TITLE)
    ax.set_title(
        f"Runs lost, mean of {len(lost.counting)} tracks, {lost.runs} runs each at every level",
        loc="left", fontsize=10,
    )  # fmt: skip
    _save(figure, path)


def spread(ends: Sequence[float]) -> list[float]:
    """Places for names at these heights: in their order, ``APART`` or more apart, within the axes.

    They are put from the bottom up, then pushed down from 100 where they do not fit.
    """
    order = np.argsort(np.asarray(ends), kind="stable").tolist()
    places = np.asarray(ends, dtype=np.float64)
    for below, k in pairwise(order):
        places[k] = max(places[k], places[below] + APART)
    top = max(PERCENT, APART * (len(ends) - 1))
    for k in reversed(order):
        places[k] = min(places[k], top)
        top = float(places[k]) - APART
    return [float(place) for place in places]


@styled({"grid.alpha": 0.3})
def by_track(lost: Lost, path: Path) -> None:
    """A panel for each track; the lines of one share lie beside one another."""
    rows = -(-len(lost.tracks) // COLUMNS)
    figure = Figure(figsize=(11.0, 2.3 * rows + 0.9))
    grid: Any = figure.subplots(rows, COLUMNS, sharex=True, sharey=True, squeeze=False)
    looks, order = _looks(lost), _order(lost)
    for ax, (track, counts) in zip(grid.flat, lost.tracks.items(), strict=False):
        for k, slam in enumerate(order):
            shares = lost.shares[slam].get(track)
            if shares is not None:
                aside = 0.8 * (k - 0.5 * (len(order) - 1))  # percent, so that all are seen
                ax.plot(lost.levels, shares + aside, **{**looks[slam], "ms": 3.5})
        ax.set_title(track if counts else f"{track} (does not count)", fontsize=9)
        _axes(ax, lost, None)
    for ax in list(grid.flat)[len(lost.tracks) :]:
        ax.set_visible(False)
    for row in grid:
        row[0].set_ylabel(_TITLE, fontsize=8)
    for ax in grid[-1]:
        ax.set_xlabel("level")
    handles = [Line2D([], [], label=slam, **looks[slam]) for slam in order]
    figure.legend(handles=handles, loc="outside upper center", ncols=6, frameon=False)
    _save(figure, path)


def _axes(ax: Axes, lost: Lost, label: str | None) -> None:
    ax.set_xticks(lost.levels)
    ax.set(ylim=(-7.0, 107.0), yticks=np.arange(0.0, 101.0, 25.0))
    if label:
        ax.set_xlabel(label)


def _save(figure: Figure, path: Path) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    save(figure, path)

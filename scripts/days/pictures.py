# SPDX-License-Identifier: Apache-2.0
"""Pictures of a building's places: before and after, and how they change."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from scripts.figures import save, styled
from slam.days.changes import Change
from slam.days.evidence import Snapshot
from slam.days.history import DAY_S, dense
from slam.days.mobility import MobilityMap
from slam.estimate import Raster

COLOURS = {"appeared": "#1b7f4d", "gone": "#c0392b", "moved": "#2457a6", "door": "#b8860b"}
UNSEEN = "#b0b4b8"
_LEAST = 0.05  # a confidence below is not drawn


def _draw(ax: Axes, snapshot: Snapshot, cell_m: float, title: str) -> None:
    low, images = dense(snapshot.cells, snapshot.standing)
    height, width = images[0].shape
    x, y = (low * cell_m).tolist()
    ax.set_facecolor(UNSEEN)
    ax.imshow(
        images[0], origin="lower", extent=(x, x + width * cell_m, y, y + height * cell_m),
        cmap="Greys", vmin=0.0, vmax=1.0, interpolation="nearest",
    )  # fmt: skip
    ax.set_title(title)
    ax.set_xlabel("x, m")


def changes_picture(
    path: Path,
    snapshots: tuple[Snapshot, Snapshot],
    titles: tuple[str, str],
    cell_m: float,
    changes: Sequence[Change],
) -> None:
    """Both sessions beside each other, every change ringed in its colour."""
    with styled():
        figure = Figure(figsize=(11.0, 4.6))
        axes = figure.subplots(1, 2, sharex=True, sharey=True)
        for ax, snapshot, title in zip(axes, snapshots, titles, strict=True):
            _draw(ax, snapshot, cell_m, title)
        for change in changes:
            if change.confidence < _LEAST:
                continue
            colour, radius = COLOURS[change.kind], 0.5 * change.size_m + 0.15
            old = change.kind in ("gone", "door", "moved")
            new = change.kind in ("appeared", "door", "moved")
            first = change.before or change.at
            if old:
                axes[0].add_patch(Circle(first, radius, fill=False, color=colour, lw=1.6))
            if new:
                axes[1].add_patch(Circle(change.at, radius, fill=False, color=colour, lw=1.6))
            if change.before is not None:
                axes[1].annotate(
                    "", change.at, change.before,
                    arrowprops={"arrowstyle": "->", "color": colour, "lw": 1.2},
                )  # fmt: skip
        for kind, colour in COLOURS.items():
            axes[1].plot([], [], "o", mfc="none", color=colour, label=kind)
        axes[1].plot([], [], "s", color=UNSEEN, label="not seen")
        figure.legend(loc="outside lower center", ncols=len(COLOURS) + 1, frameon=False)
        axes[0].set_ylabel("y, m")
        save(figure, path)


def mobility_picture(path: Path, mobility: MobilityMap, hours: Sequence[float]) -> None:
    """How often something stands in each place, how much that changes, and what to expect at
    ``hours`` of the day after the last session."""
    standing, changing = mobility.standing, mobility.mobility
    if standing is None or changing is None:
        return
    last = float(mobility.history.times_s[-1])
    day = (np.floor(last / DAY_S) + 1.0) * DAY_S
    panes: list[tuple[str, Raster | None, str]] = [
        ("how often something stands there, 0 to 1", standing, "Greys"),
        ("how much that changes, 0 to 1", changing, "OrRd"),
    ]
    panes += [
        (f"probability at {h:g} h the day after", mobility.probability(day + 3600.0 * h), "Greys")
        for h in hours
    ]
    with styled():
        rows = -(-len(panes) // 2)
        figure = Figure(figsize=(11.0, 4.4 * rows))
        grid = figure.subplots(rows, 2, squeeze=False)
        for ax, (title, raster, colours) in zip(grid.ravel(), panes, strict=False):
            assert raster is not None
            x, y, _ = raster.T_map_origin.tolist()
            height, width = (n * raster.resolution_m for n in raster.values.shape)
            ax.set_facecolor(UNSEEN)
            drawn = ax.imshow(
                raster.values, origin="lower", extent=(x, x + width, y, y + height),
                cmap=colours, vmin=0.0, vmax=1.0, interpolation="nearest",
            )  # fmt: skip
            figure.colorbar(drawn, ax=ax, shrink=0.8)
            ax.set(title=title, xlabel="x, m", ylabel="y, m")
        for ax in grid.ravel()[len(panes) :]:
            ax.set_axis_off()
        save(figure, path)

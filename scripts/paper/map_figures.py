# SPDX-License-Identifier: Apache-2.0
"""Panels with maps side by side: one window over all that is drawn, one legend beside them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from numpy.typing import NDArray

from scripts.paper.report import new_figure
from slam.frames import Float

FAINTEST = 0.02  # activity that is drawn


@dataclass(frozen=True, kw_only=True)
class Window:
    """What of the plane is shown, m."""

    xmin: float
    ymin: float
    xmax: float
    ymax: float

    def show(self, ax: Axes) -> None:
        """Of these axes, this only."""
        ax.set(xlim=(self.xmin, self.xmax), ylim=(self.ymin, self.ymax), aspect="equal")

    def mark(self, ax: Axes) -> None:
        """As a frame, in axes that show more."""
        size = self.xmax - self.xmin, self.ymax - self.ymin
        frame = Rectangle((self.xmin, self.ymin), *size, fill=False, ec="#ce2c3c", lw=1.2, zorder=9)
        ax.add_patch(frame)


def window_over(things: Iterable[Float]) -> Window:
    """All (n, 2) points, and a little beside them."""
    points = np.concatenate([np.asarray(thing)[:, :2] for thing in things])
    low, high = points.min(axis=0), points.max(axis=0)
    edge = 0.03 * float((high - low).max())
    xmin, ymin = (low - edge).tolist()
    xmax, ymax = (high + edge).tolist()
    return Window(xmin=xmin, ymin=ymin, xmax=xmax, ymax=ymax)


def window_about(middle: Float, half: float) -> Window:
    """A square."""
    x, y = float(middle[0]), float(middle[1])
    return Window(xmin=x - half, ymin=y - half, xmax=x + half, ymax=y + half)


def active(values: NDArray[Any], origin: Float, cell: float) -> Float:
    """(n, 2) centres of the neurons that are drawn."""
    rows, columns = np.nonzero(values > FAINTEST)
    return (np.column_stack([columns, rows]) + 0.5) * cell + np.asarray(origin)[:2]


def map_panels(windows: Sequence[Window], columns: int, width: float) -> tuple[Figure, Any]:
    """Axes, row by row, in a figure of the height that leaves no white about these windows; all of
    a row have one window."""
    wide = (width - 0.9) / columns - 0.6
    height = 0.5
    for window in windows:
        height += wide * (window.ymax - window.ymin) / (window.xmax - window.xmin) + 0.7
    figure, axes = new_figure(width, height, rows=len(windows), columns=columns)
    for k, ax in enumerate(axes):
        windows[k // columns].show(ax)
        ax.set(ylabel="y in m" if k % columns == 0 else "", xlabel="x in m")
    return figure, axes


def legend_below(figure: Figure, axes: Iterable[Axes]) -> None:
    """One for all axes, each name once."""
    named: dict[str, Any] = {}
    for ax in axes:
        for handle, label in zip(*ax.get_legend_handles_labels(), strict=True):
            named.setdefault(label, handle)
    figure.legend(
        named.values(), named.keys(), loc="outside lower center", ncols=len(named), frameon=False
    )

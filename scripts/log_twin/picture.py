# SPDX-License-Identifier: Apache-2.0
"""Where a log and its twin differ."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from scripts.figures import save, styled
from slam.evaluation.beside import Beside
from slam.frames import Float

SHOWN_M = 0.3  # differences beyond are drawn as that
MOST_POINTS = 120_000


@styled()
def differences(path: Path, found: Beside, poses: Float, title: str) -> None:
    """The log's returns, coloured by how much farther (red) or nearer (blue) the twin's lie."""
    every = max(1, len(found.apart) // MOST_POINTS)
    x, y = found.points[::every].T
    apart = np.clip(found.apart[::every], -SHOWN_M, SHOWN_M)
    order = np.argsort(np.abs(apart), kind="stable")
    span = np.ptp(found.points, axis=0)
    figure = Figure(figsize=(8.0, max(3.0, min(12.0, 1.0 + 7.0 * float(span[1] / span[0])))))
    axes = figure.add_subplot()
    drawn = axes.scatter(x[order], y[order], c=apart[order], s=1.0, cmap="RdYlBu_r", linewidths=0)
    axes.plot(poses[:, 0], poses[:, 1], color="0.6", linewidth=0.5)
    axes.set_aspect("equal")
    axes.set(xlabel="x, m", ylabel="y, m", title=title)
    figure.colorbar(drawn, ax=axes, shrink=0.7, label="the twin's return lies farther, m")
    save(figure, path)

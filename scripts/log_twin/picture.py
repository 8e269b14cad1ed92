# SPDX-License-Identifier: Apache-2.0
"""Where a log and its twin differ."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from scripts.figures import save, styled
from slam.evaluation.evidence import Beside
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
    span = np.ptp(found.points, axis=0) / np.ptp(found.points, axis=0).max()
    figure = Figure(figsize=(2.5 + 7.0 * float(span[0]), 1.5 + 7.0 * float(span[1])))
    axes = figure.add_subplot()
    drawn = axes.scatter(x[order], y[order], c=apart[order], s=1.0, cmap="coolwarm", linewidths=0)
    axes.plot(poses[:, 0], poses[:, 1], color="#168c5a", linewidth=0.5)
    axes.set_aspect("equal")
    axes.set(xlabel="x, m", ylabel="y, m", title=title)
    figure.colorbar(drawn, ax=axes, shrink=0.7, label="the twin's return lies farther, m")
    save(figure, path)

# SPDX-License-Identifier: Apache-2.0
"""One figure: what each effect of the scanner does to a wall, a corner, a chair, a leg, a pane."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from scripts.card.bench import Bench, box, only, post
from sim.sensors.lidar.models.lms221 import Lms221Config
from slam.frames import Float

RED, GREY = "#ce2c3c", "#8a8a8a"

# Name -> (MJCF, window of the picture: x from, x to, y from, y to in m).
Window = tuple[float, float, float, float]
_BACK = box(4.05, 0.0, 0.05, 2.5)
SCENES: Mapping[str, tuple[str, Window]] = {
    "a white wall": (box(3.05, 0.0, 0.05, 2.5), (2.93, 3.07, -0.3, 0.3)),
    "a black wall,\nseen along it": (
        box(5.0, -1.05, 8.0, 0.05, "plastic_black"),
        (-0.3, 10.0, -1.5, -0.5),
    ),
    "a corner, 0.5 m\nbefore a wall": (
        box(3.25, 0.915, 0.25, 0.9) + box(3.55, 0.0, 0.05, 2.5),
        (2.9, 3.6, -0.25, 0.25),
    ),
    "a chair's column,\n0.6 m before a wall": (
        post(3.4, 0.0, 0.025, "metal") + _BACK,
        (3.25, 4.12, -0.2, 0.2),
    ),
    "a person's legs": (
        post(3.3, 0.13, 0.06, "trousers") + post(3.4, -0.1, 0.06, "trousers") + _BACK,
        (3.1, 4.12, -0.3, 0.3),
    ),
    "a pane beside the\nway, walls ahead\nand behind it": (
        box(2.25, -0.6, 2.75, 0.006, "glass")
        + box(6.05, 0.7, 0.05, 1.3)
        + box(2.0, -2.05, 4.0, 0.05),
        (-0.7, 6.4, -2.4, 1.8),
    ),
}
# Title -> (switches, settings). Those that need others to show come with them.
_BASE = {"spot": True, "reflectivity": True}
COLUMNS: Mapping[str, tuple[dict[str, bool], dict[str, object]]] = {
    "10 mm noise": ({}, {"noise_std_m": 0.010}),
    "rounding (counter,\ncm mode)": ({"timer": True}, {"quantise": True}),
    "systematic error\nof one unit": ({"systematic": True}, {}),
    "spot, first pulse,\nreflectivity": (_BASE, {}),
    "spot ... +\nmixed pixels": ({**_BASE, "mixed_pixels": True}, {}),
    "spot ... +\nincidence": ({**_BASE, "incidence": True}, {}),
    "spot ... + incidence,\nglass and bounce": (
        {**_BASE, "incidence": True, "glass": True, "bounce": True},
        {},
    ),
    "everything": ({}, {}),
}
SCANS = 12


def points(world: str, config: Lms221Config, scans: int, seed: int) -> Float:
    """(n, 2) what the scans show, m in the frame of the laser."""
    bench = Bench(world, config, seed)
    angles = bench.laser.spec.angles
    ranges = bench.ranges(scans)
    seen = np.isfinite(ranges)
    angles = np.broadcast_to(angles, ranges.shape)[seen]
    shown: Float = ranges[seen][:, None] * np.column_stack((np.cos(angles), np.sin(angles)))
    return shown


def ablation() -> Figure:
    """Rows of scenes, columns of effects: ideal in grey, with the effects in red."""
    figure = Figure(figsize=(13.0, 8.4), layout="constrained")
    axes = figure.subplots(len(SCENES), len(COLUMNS), squeeze=False)
    for row, (name, (world, window)) in enumerate(SCENES.items()):
        ideal = points(world, Lms221Config.ideal(), 1, 0)
        for column, (title, (switches, settings)) in enumerate(COLUMNS.items()):
            config = Lms221Config() if title == "everything" else only(switches, **settings)
            shown = points(world, config, SCANS, 5)
            _panel(axes[row, column], ideal, shown, window)
            if row == 0:
                axes[row, column].set_title(title, fontsize=9)
            if column == 0:
                axes[row, column].set_ylabel(name, fontsize=8)
    figure.suptitle(
        f"what the scanner shows: ideal (grey rings) and {SCANS} scans with effects (red); metres, "
        "the scanner stands at (0, 0) and looks to the right",
        fontsize=10,
    )
    return figure


def _panel(ax: Axes, ideal: Float, shown: Float, window: Window) -> None:
    x0, x1, y0, y1 = window
    inside = (shown[:, 0] > x0) & (shown[:, 0] < x1) & (shown[:, 1] > y0) & (shown[:, 1] < y1)
    ax.plot(ideal[:, 0], ideal[:, 1], "o", ms=5, mfc="none", mec=GREY, mew=0.6)
    ax.plot(shown[inside, 0], shown[inside, 1], ".", ms=3.5, color=RED, alpha=0.7, mew=0)
    ax.set_xlim(x0, x1)
    ax.set_ylim(y0, y1)
    ax.tick_params(labelsize=6, length=2)
    ax.grid(alpha=0.25)
    for side in ("top", "right"):
        ax.spines[side].set_visible(False)
    ax.locator_params(axis="x", nbins=4)
    ax.locator_params(axis="y", nbins=4)

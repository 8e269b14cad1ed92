# SPDX-License-Identifier: Apache-2.0
"""The pictures of the LMS-221's card: six panels beside its data sheet, and what each effect does
to a wall, a corner, a chair, a leg, a pane."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from PIL import Image

from scripts.card import rows as measure
from scripts.card.bench import Bench, box, only, post
from scripts.figures import save, styled
from sim.sensors.lidar.models.lms221 import NEEDED, Lms221Config
from sim.sensors.lidar.receiver import needed_reflectivity
from slam.files import make_folder
from slam.frames import Float

INK, RED, BLUE, GREY = "#222222", "#ce2c3c", "#1f61be", "#8a8a8a"
TARGETS = {"white paper": 0.80, "black trousers": 0.08, "black rubber": 0.02}  # reflectivity
Window = tuple[float, float, float, float]
_BACK = box(4.05, 0.0, 0.05, 2.5)
# Name -> (MJCF, window of the picture: x from, x to, y from, y to in m).
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
_SPOT = {"spot": True, "reflectivity": True}
_SEEN = {**_SPOT, "incidence": True}
# Those effects that need others to show come with them.
COLUMNS: Mapping[str, Lms221Config] = {
    "10 mm noise": only(noise_std_m=0.010),
    "rounding (counter,\ncm mode)": only({"timer": True}, quantise=True),
    "systematic error\nof one unit": only({"systematic": True}),
    "spot, first pulse,\nreflectivity": only(_SPOT),
    "spot ... +\nmixed pixels": only({**_SPOT, "mixed_pixels": True}),
    "spot ... +\nincidence": only(_SEEN),
    "spot ... + incidence,\nglass and bounce": only({**_SEEN, "glass": True, "bounce": True}),
    "everything": Lms221Config(),
}
SCANS = 12


@styled({"font.size": 8, "grid.alpha": 0.3})
def draw(folder: Path) -> None:
    """Write both as PNGs with a palette: of few colours, a third of the bytes."""
    make_folder(folder)
    for figure, name in ((_card(), "sensor_card"), (_ablation(), "sensor_ablation")):
        path = folder / f"{name}.png"
        save(figure, path)
        with Image.open(path) as picture:
            small = picture.convert("RGB").quantize(64, dither=Image.Dither.NONE)
        small.save(path, optimize=True)


# -- beside the data sheet ------------------------------------------------------------------------


def _card() -> Figure:
    """Six panels: noise, systematic error, spot, needed reflectivity, timing, range."""
    figure = Figure(figsize=(10.0, 5.6), layout="constrained")
    panels = figure.subplots(2, 3).ravel()
    for draw_panel, ax in zip((_noise, _bias, _spot, _needed, _times, _rate), panels, strict=True):
        draw_panel(ax)
    return figure


def _noise(ax: Axes) -> None:
    for mode, color, shift in (("32m", BLUE, -0.15), ("80m", RED, 0.15)):
        std = [1e3 * measure.noise_std(d, mode) for d in measure.NOISE_AT_M]
        at = np.arange(len(std)) + shift
        ax.bar(at, std, 0.28, color=color, label=f"{mode} mode, measured")
    ax.axhline(10.0, color=INK, lw=1.0, ls="--", label="data sheet, TD p34")
    ax.set_xticks(range(len(measure.NOISE_AT_M)), [f"{d:g} m" for d in measure.NOISE_AT_M])
    ax.set(title="statistical error, one sigma", ylabel="mm", ylim=(0, 15))
    ax.legend(fontsize=7, loc="upper left")


def _bias(ax: Axes) -> None:
    true, curves = measure.systematic_curves("32m", 40)
    ax.plot(true, 1e3 * curves.T, color=GREY, lw=0.4, alpha=0.6)
    ax.plot(true, 1e3 * curves[3], color=BLUE, lw=1.4, label="one of 40 units (grey: the others)")
    for bound in (-35.0, 35.0):
        label = "data sheet, TD p34" if bound > 0 else None
        ax.axhline(bound, color=INK, lw=1.0, ls="--", label=label)
    ax.set(title="systematic error, mm mode", xlabel="range [m]", ylabel="mm", ylim=(-50, 75))
    ax.legend(fontsize=7, loc="upper right")


def _spot(ax: Axes) -> None:
    at = np.linspace(0.0, 21.0, 40)
    ax.plot(at, [100 * measure.spot_diameter(d) for d in at], color=BLUE, label="seven rays (D4σ)")
    ax.plot(measure.SPOT_AT_M, measure.SPOT_CM, "o", color=INK, ms=4, label="TL table 10-1")
    ax.set(title="diameter of the spot", xlabel="range [m]", ylabel="cm")
    ax.legend(fontsize=7, loc="upper left")


def _needed(ax: Axes) -> None:
    at = np.geomspace(0.16, 60.0, 50).tolist()
    found = [100 * measure.least_reflectivity(d) for d in at]
    ax.loglog(at, found, color=BLUE, label="measured")
    ax.loglog(*(np.array(NEEDED) * (1.0, 100.0)).T, "o", color=INK, ms=4, label="TD fig. 4-2")
    ax.axhline(10.0, color=GREY, lw=0.8, ls=":")
    ax.set(title="reflectivity needed for a return", xlabel="range [m]", ylabel="%")
    ax.set_xticks([0.2, 0.5, 1, 2, 5, 10, 30, 60], ["0.2", "0.5", "1", "2", "5", "10", "30", "60"])
    ax.set_yticks([1, 2, 5, 10, 20, 50, 100], ["1", "2", "5", "10", "20", "50", "100"])
    ax.minorticks_off()
    ax.legend(fontsize=7, loc="upper center")


def _times(ax: Axes) -> None:
    spec = Lms221Config(resolution_deg=0.5).spec()
    degrees = np.rad2deg(spec.angles)
    for turn, color in ((0, BLUE), (1, RED)):
        mine = slice(turn, None, 2)
        times = 1e3 * spec.beam_time_offsets[mine]
        ax.plot(degrees[mine], times, color=color, lw=1.6, label=f"turn {turn + 1} of the mirror")
    ax.set(title="time of each beam, 0.5°", xlabel="angle [°]", ylabel="ms")
    ax.set_xticks([-90, -45, 0, 45, 90])
    ax.legend(fontsize=7, loc="lower right")


def _rate(ax: Axes) -> None:
    at = np.geomspace(0.16, 79.0, 400).tolist()
    for row, (name, value) in enumerate(TARGETS.items()):
        seen = np.array([value >= needed_reflectivity(NEEDED, d) for d in at])
        lit = np.where(seen, row, math.nan)
        ax.plot(at, lit, lw=9, color=(BLUE, INK, RED)[row], solid_capstyle="butt")
        ax.text(0.17, row + 0.2, f"{name}, {100 * value:g} %", fontsize=8)
    ax.set_xscale("log")
    title = "range at which a full target returns"
    ax.set(title=title, xlabel="range [m]", ylim=(-0.4, 2.6), yticks=[])
    ax.set_xticks([0.2, 0.5, 1, 2, 5, 10, 30, 80], ["0.2", "0.5", "1", "2", "5", "10", "30", "80"])
    ax.minorticks_off()


# -- what each effect does ------------------------------------------------------------------------


def _ablation() -> Figure:
    """Rows of scenes, columns of effects: ideal in grey, with the effects in red."""
    figure = Figure(figsize=(13.0, 8.4), layout="constrained")
    axes = figure.subplots(len(SCENES), len(COLUMNS), squeeze=False)
    for row, (name, (world, window)) in enumerate(SCENES.items()):
        ideal = _points(world, Lms221Config.ideal(), 1, 0)
        for column, config in enumerate(COLUMNS.values()):
            _panel(axes[row, column], ideal, _points(world, config, SCANS, 5), window)
        axes[row, 0].set_ylabel(name, fontsize=8)
    for column, title in enumerate(COLUMNS):
        axes[0, column].set_title(title, fontsize=9)
    figure.suptitle(
        f"what the scanner shows: ideal (grey rings) and {SCANS} scans with effects (red); metres, "
        "the scanner stands at (0, 0) and looks to the right",
        fontsize=10,
    )
    return figure


def _points(world: str, config: Lms221Config, scans: int, seed: int) -> Float:
    """(n, 2) what the scans show, m in the frame of the laser."""
    bench = Bench(world, config, seed)
    ranges = bench.ranges(scans)
    seen = np.isfinite(ranges)
    angles = np.broadcast_to(bench.laser.spec.angles, ranges.shape)[seen]
    shown: Float = ranges[seen][:, None] * np.column_stack((np.cos(angles), np.sin(angles)))
    return shown


def _panel(ax: Axes, ideal: Float, shown: Float, window: Window) -> None:
    x0, x1, y0, y1 = window
    inside = (shown[:, 0] > x0) & (shown[:, 0] < x1) & (shown[:, 1] > y0) & (shown[:, 1] < y1)
    ax.plot(ideal[:, 0], ideal[:, 1], "o", ms=5, mfc="none", mec=GREY, mew=0.6)
    ax.plot(shown[inside, 0], shown[inside, 1], ".", ms=3.5, color=RED, alpha=0.7, mew=0)
    ax.set(xlim=(x0, x1), ylim=(y0, y1))
    ax.tick_params(labelsize=6, length=2)
    ax.grid(alpha=0.25)
    ax.locator_params(nbins=4)

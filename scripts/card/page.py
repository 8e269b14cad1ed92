# SPDX-License-Identifier: Apache-2.0
"""The page that ``mobilia sensor-card`` writes: the rows, six panels, and the ablation figure."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from PIL import Image

from scripts.card import rows as measure
from scripts.card.ablation import ablation
from scripts.figures import save, styled
from sim.sensors.lidar.effects import needed_reflectivity
from sim.sensors.lidar.models.lms221 import NEEDED, Lms221Config
from slam.files import write_text

INK, RED, BLUE, GREY = "#222222", "#ce2c3c", "#1f61be", "#8a8a8a"


@styled({"font.size": 8, "grid.alpha": 0.3})
def write_card(out: Path, rows: Sequence[measure.Row]) -> None:
    """The page and its two pictures."""
    pictures = out / "pictures"
    pictures.mkdir(parents=True, exist_ok=True)
    for figure, name in ((card_figure(), "sensor_card"), (ablation(), "sensor_ablation")):
        save_small(figure, pictures / f"{name}.png")
    write_text(out / "sensor_card.md", page(rows))


def save_small(figure: Figure, path: Path) -> None:
    """Write a figure with few colours as a PNG with a palette: a third of the bytes."""
    save(figure, path)
    with Image.open(path) as picture:
        small = picture.convert("RGB").quantize(64, dither=Image.Dither.NONE)
    small.save(path, optimize=True)


def page(rows: Sequence[measure.Row]) -> str:
    """The card as Markdown."""
    lines = [
        "# SICK LMS-221: the simulated scanner against its data sheet",
        "",
        "Check how real the simulated LMS-221 is. Every figure of this page is measured on",
        "the simulated scanner, by this command:",
        "",
        "    mobilia sensor-card --out docs",
        "",
        "Sources: TD is SICK's technical description 8008970/06-2003. TL is the telegram",
        "listing 8007954/2006-08-01. STW is the ROS driver `sicktoolbox_wrapper`.",
        "",
        "![Card](pictures/sensor_card.png)",
        "",
        *measure.table(rows),
    ]
    return "\n".join([*lines, "", *NOTES])


NOTES = (
    "## What each effect does",
    "",
    "![Ablation](pictures/sensor_ablation.png)",
    "",
    "Each panel shows effects against the ideal scan (grey rings). Noise and rounding are",
    "off, except where a panel names them. The first three panels show one effect each.",
    "The next ones show the effects that build on the spot. The last one shows all. Each",
    "effect has its own switch in `sim.sensors.lidar.models.lms221.RangeEffects`.",
    "`Lms221Config()` has all of them on, `Lms221Config.ideal()` none,",
    "`Lms221Config.noise_only()` the 10 mm noise and the rounding.",
    "",
    "## What no source says, and what is assumed",
    "",
    "- The mirror turns in 13.33 ms, not 13.32: four physics steps of 1/300 s.",
    "- The systematic error of a unit is the sum of five random waves, within the printed",
    "  bound.",
    "- The counter's 10 mm step is applied to the measured time, before corrections and",
    "  rounding. Noise is set so that the *sent* value has the printed 10 mm. In cm mode,",
    "  for one surface, the corrected value lies on a grid as coarse as the code's, so",
    "  rounding adds nothing (9.6 mm).",
    "- At edges, rays closer than 0.1 m (0.5 m on one surface) are one pulse. A mixed",
    "  pixel is evenly distributed between the two surfaces.",
    "- A pane mirrors like two faces of n = 1.5 (Schlick), and lets the rest through. It",
    "  returns a beam itself only within 5° of its normal. Polished faces (`mirror`,",
    "  `metal_polished`, `chrome`) mirror 90 %. Only the middle ray is mirrored, once, by",
    "  flat faces.",
    "- Reflectivities of cloth and paint follow the classes that TD p7 lists.",
    "- Which of its codes the device sends for a dark surface: all are NaN, as in the ROS",
    "  driver.",
    "- 19.2 kBd is computed by the rule that gives the printed 9.6 and 38.4 kBd.",
    "",
    "Not simulated: warm-up drift, dazzle by sunlight (`dropout_rate` stands in for it),",
    "a dirty window, two scanners that disturb each other.",
    "",
)


def card_figure() -> Figure:
    """Six panels: noise, systematic error, spot, needed reflectivity, timing, range."""
    figure = Figure(figsize=(10.0, 5.6), layout="constrained")
    panels = figure.subplots(2, 3).ravel()
    for draw, ax in zip((_noise, _bias, _spot, _needed, _times, _rate), panels, strict=True):
        draw(ax)
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
    names = {"white paper": 0.80, "black trousers": 0.08, "black rubber": 0.02}
    at = np.geomspace(0.16, 79.0, 400).tolist()
    for row, (name, value) in enumerate(names.items()):
        seen = np.array([value >= needed_reflectivity(NEEDED, d) for d in at])
        lit = np.where(seen, row, math.nan)
        ax.plot(at, lit, lw=9, color=(BLUE, INK, RED)[row], solid_capstyle="butt")
        ax.text(0.17, row + 0.2, f"{name}, {100 * value:g} %", fontsize=8)
    ax.set_xscale("log")
    ax.set(
        title="range at which a full target returns",
        xlabel="range [m]",
        ylim=(-0.4, 2.6),
        yticks=[],
    )
    ax.set_xticks([0.2, 0.5, 1, 2, 5, 10, 30, 80], ["0.2", "0.5", "1", "2", "5", "10", "30", "80"])
    ax.minorticks_off()

# SPDX-License-Identifier: Apache-2.0
"""The pages of sensor cards: one writer of their words, tables and pictures."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from PIL import Image
from rich.markup import escape
from rich.table import Table

from scripts.card.rows import HEADINGS, Bench, Row, box, only, post
from scripts.figures import save, styled
from scripts.marks import table, with_tables_apart
from sim.sensors.lidar.models.lms221 import Lms221Config
from sim.sensors.lidar.registry import DEFAULT, describe
from sim.sensors.lidar.sheet import NOT_STATED
from slam.files import make_folder, write_text
from slam.frames import Float

STYLES = {"✓": "[green]✓[/green]", "✗": "[red]✗[/red]"}
RED, GREY = "#ce2c3c", "#8a8a8a"
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


def markdown(headings: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    """The lines of a table."""
    return table(headings, rows, left=len(headings)).splitlines()


def printed(title: str, headings: Sequence[str], rows: Sequence[Sequence[str]]) -> Table:
    """The same table for a console."""
    found = Table(*map(escape, headings), title=escape(title), title_justify="left")
    for row in rows:
        found.add_row(*(STYLES.get(cell, escape(cell)) for cell in row))
    return found


def write(out: Path, name: str, lines: Sequence[str]) -> Path:
    """A page ``name``.md in the folder ``out``; long tables as CSV in its ``results``."""
    make_folder(out)
    text = with_tables_apart("\n".join(lines) + "\n", name, out / "results", out)
    write_text(out / f"{name}.md", text)
    return out / f"{name}.md"


def page(scanner: str, rows: Sequence[Row]) -> list[str]:
    """The card of a scanner; that of the LMS-221 has a picture and notes."""
    usual = scanner == DEFAULT
    title, name, option = "SICK LMS-221", "LMS-221", ""
    if not usual:
        title, name = describe(scanner).rstrip("."), f"`{scanner}`"
        option = f" --scanner {scanner}"
    return [
        f"# {title}: the simulated scanner against its data sheet",
        "",
        f"Check how real the simulated {name} is. Every figure of this page is measured on the",
        "simulated scanner, by this command:",
        "",
        f"    mobilia sensor-card{option} --out docs",
        "",
        *(SOURCES if usual else _sources(scanner)),
        "",
        *markdown(HEADINGS, [row.cells() for row in rows]),
        *(NOTES if usual else ()),
    ]


def _sources(scanner: str) -> tuple[str, ...]:
    return (
        f"The top of `sim/sensors/lidar/models/{scanner}.py` names the sources and their short",
        f'names, and lists what they do not state. "{NOT_STATED}" means: not by the sources',
        "read. Such a thing is not simulated, unless the row says so.",
    )


SOURCES = (
    "Sources: TD is SICK's technical description 8008970/06-2003. TL is the telegram",
    "listing 8007954/2006-08-01. STW is the ROS driver `sicktoolbox_wrapper`.",
)
NOTES = (
    "",
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
)


@styled({"font.size": 8, "grid.alpha": 0.3})
def draw(path: Path) -> None:
    """Write it as a PNG with a palette: of few colours, a third of the bytes."""
    save(_ablation(), path)
    with Image.open(path) as picture:
        small = picture.convert("RGB").quantize(64, dither=Image.Dither.NONE)
    small.save(path, optimize=True)


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

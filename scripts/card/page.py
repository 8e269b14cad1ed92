# SPDX-License-Identifier: Apache-2.0
"""The pages of sensor cards: one writer of their words, tables and pictures."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from PIL import Image

from scripts.card.rows import HEADINGS, Bench, Row, box, only, post
from scripts.figures import save, styled
from scripts.marks import with_tables_apart
from scripts.pages.page import template
from scripts.pages.table import Table
from sim.sensors.lidar.models.lms221 import Lms221Config
from sim.sensors.lidar.registry import DEFAULT, describe
from sim.sensors.lidar.sheet import NOT_STATED
from slam.files import make_folder, write_text
from slam.frames import Float

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


def table(scanner: str, rows: Sequence[Row]) -> Table:
    """What the data sheet of a scanner says, beside what was measured."""
    return Table(
        caption=f"{describe(scanner)} (simulated)", head=HEADINGS,
        rows=[row.cells() for row in rows], words=len(HEADINGS),
    )  # fmt: skip


def page(scanner: str, measured: Table) -> str:
    """The card of a scanner; that of the LMS-221 has a picture and notes."""
    usual = scanner == DEFAULT
    title, name, option = "SICK LMS-221", "LMS-221", ""
    if not usual:
        title, name = describe(scanner).rstrip("."), f"`{scanner}`"
        option = f" --scanner {scanner}"
    text = template("card.md", Path(__file__).parent).render(
        title=title, name=name, option=option, usual=usual, scanner=scanner,
        not_stated=NOT_STATED, table=measured.markdown(),
    )  # fmt: skip
    return text.rstrip()


def write(out: Path, name: str, text: str) -> Path:
    """A page ``name``.md in the folder ``out``; long tables as CSV in its ``results``."""
    make_folder(out)
    path = out / f"{name}.md"
    write_text(path, with_tables_apart(f"{text}\n", name, out / "results", out))
    return path


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

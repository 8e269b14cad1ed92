# SPDX-License-Identifier: Apache-2.0
"""The pages of sensor cards: one writer of their words, tables and pictures."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from rich.markup import escape
from rich.table import Table

from scripts.marks import table, with_tables_apart
from sim.sensors.lidar.registry import DEFAULT, describe
from sim.sensors.lidar.sheet import NOT_STATED
from slam.files import make_folder, write_text

HEADINGS = ("", "what", "data sheet", "measured", "source")
MARKS = {True: "✓", False: "✗"}
STYLES = {"✓": "[green]✓[/green]", "✗": "[red]✗[/red]"}


class Row(NamedTuple):
    """One line of a card; ``kept`` whether what was measured agrees with the data sheet."""

    what: str
    datasheet: str
    measured: str
    source: str
    kept: bool

    def cells(self) -> tuple[str, ...]:
        """Under ``HEADINGS``."""
        return (MARKS[self.kept], *self[:4])


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

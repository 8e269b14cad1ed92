# SPDX-License-Identifier: Apache-2.0
"""``mobilia bench``: speed figures of this machine, as a table and as JSON."""

import json
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from rich.table import Table

from scripts.console import console, working
from scripts.spec import option, spec
from slam.errors import InvalidValueError
from slam.files import write_text

PLACE = "speed"  # of a page


@spec
class Bench:
    """Measure the speed of simulation, scanner, environment and SLAM on this machine.

    Everything is processor time after a warm-up, the median of several repeats where it can be, at
    dynamism 0.5, seed 100, scanner and odometry at their defaults (LMS-221, 0.5 degrees, 361
    beams; pioneer3dx) unless a row says otherwise. Targets are those of the design, for one core of
    a 2020s server.
    """

    seconds: float = option(
        "Simulated seconds for each measurement, s.", 20, span=(1, 3600), unit="s"
    )
    out: Path | None = option(
        "Also write the figures to this JSON file.", None, "--json", writes="file"
    )
    against: bool = option("Only ratios to others that are installed, in turn.", False)
    page: Path | None = option(
        "With --against: fill the place `speed` of this page of Markdown.", writes=True
    )

    def __call__(self) -> None:
        if self.page is not None and not self.against:
            raise InvalidValueError("--page needs --against: its table is of ratios to others")
        if self.page is not None:
            from scripts.marks import check_page

            check_page(self.page, PLACE)
        from scripts.machine import machine, versions

        rows = _against(self.seconds, self.page) if self.against else _measured(self.seconds)
        if self.out is not None:
            report = {"schema": 1, "machine": machine(), "versions": versions(), "rows": rows}
            write_text(self.out, json.dumps(report, indent=2) + "\n")


def _measured(seconds: float) -> list[dict[str, Any]]:
    """Every figure, also on the console."""
    from scripts.benches import episodes, world
    from scripts.benches import slam as bench_slam
    from scripts.machine import machine

    measures: tuple[Callable[[float], Iterable[dict[str, Any]]], ...] = (
        world.simulation, world.scanner, world.physics, world.environments, episodes.crowds,
        world.pictures, bench_slam.updates, bench_slam.ekf, bench_slam.area, episodes.office,
    )  # fmt: skip
    rows: list[dict[str, Any]] = []
    for measure in measures:
        with working(f"measuring ({len(rows)} rows so far)"):
            rows += measure(seconds)
    table = Table(title="Speed", title_justify="left", caption=str(machine()["processor"]))
    for heading in ("what", "figure", "unit", "target", "how"):
        table.add_column(heading, justify="right" if heading == "figure" else "left")
    for row in rows:
        figure = row["figure"]
        shown = f"{figure:.0f}" if figure >= 100.0 else f"{figure:.3g}"
        table.add_row(row["what"], shown, row["unit"], row["target"], row["how"])
    console.print(table)
    return rows


def _against(seconds: float, page: Path | None) -> list[dict[str, Any]]:
    """Ratios to others, also on the console and in their place on a page."""
    from scripts import marks
    from scripts.benches import against
    from scripts.machine import machine

    with working("measuring ours and others in turn"):
        rows = list(against.rows(seconds))
    told = against.table(rows, machine())
    console.print(told, markup=False, soft_wrap=True)
    if page is not None:
        marks.fill_page(page, PLACE, told)
    return rows

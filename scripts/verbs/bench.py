# SPDX-License-Identifier: Apache-2.0
"""``mobilia bench``: speed figures of this machine, as a table and as JSON."""

import json
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from rich.table import Table

from scripts.console import console, working
from scripts.spec import names_of, option, spec
from slam.errors import InvalidValueError
from slam.files import write_text

MEASURES = ("scans", "others", "slams", "rooms", "episodes")  # of ``scripts.benches.against``


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
    only: str | None = option(
        f"With --against, one of {', '.join(MEASURES)}: these rows alone. rooms: what the workers "
        "of a vector environment gain, beside as many copies of a plain loop.",
        choices=MEASURES,
        complete=names_of("scripts.verbs.bench:MEASURES"),
    )
    page: Path | None = option(
        "With --against: fill the place `speed`, or the one called as --only, of this page of "
        "Markdown.",
        writes=True,
    )

    def __call__(self) -> None:
        if (self.page or self.only) is not None and not self.against:
            raise InvalidValueError("--page and --only need --against: they are of its table")
        if self.page is not None:
            from scripts.marks import check_page

            check_page(self.page, self.only or "speed")
        from scripts.machine import machine, versions

        rows = self._against() if self.against else _measured(self.seconds)
        if self.out is not None:
            report = {"schema": 1, "machine": machine(), "versions": versions(), "rows": rows}
            write_text(self.out, json.dumps(report, indent=2) + "\n")

    def _against(self) -> list[dict[str, Any]]:
        """Ratios to others, also on the console and in their place on a page."""
        from scripts import marks
        from scripts.benches import against
        from scripts.machine import machine

        wanted = (self.only,) if self.only else MEASURES
        with working("measuring ours and others in turn"):
            rows = [row for name in wanted for row in getattr(against, name)(self.seconds)]
        told = against.table(rows, machine(), self.only or "")
        console.print(told, markup=False, soft_wrap=True)
        if self.page is not None:
            marks.fill_page(self.page, self.only or "speed", told)
        return rows


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

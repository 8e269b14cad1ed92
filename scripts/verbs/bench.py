# SPDX-License-Identifier: Apache-2.0
"""``mobilia bench``: speed figures of this machine, as a table and as JSON."""

import json
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.table import Table

from scripts.console import console, working
from slam.errors import InvalidValueError
from slam.files import write_text


def bench(
    seconds: Annotated[float, typer.Option(help="Simulated seconds for each measurement, s.")] = 20,
    out: Annotated[
        Path | None, typer.Option("--json", help="Also write the figures to this JSON file.")
    ] = None,
    against: Annotated[
        bool, typer.Option("--against", help="Only ratios to others that are installed, in turn.")
    ] = False,
    page: Annotated[
        Path | None,
        typer.Option(help="With --against: fill the place `speed` of this page of Markdown."),
    ] = None,
) -> None:
    """Measure the speed of simulation, scanner, environment and SLAM on this machine.

    Everything is processor time after a warm-up, the median of several repeats where it can be, at
    dynamism 0.5, seed 100, scanner and odometry at their defaults (LMS-221, 0.5 degrees, 361
    beams; pioneer3dx) unless a row says otherwise. Targets are those of the design, for one core of
    a 2020s server.
    """
    if not 1.0 <= seconds <= 3600.0:
        raise InvalidValueError(f"--seconds must lie in [1, 3600] s, got {seconds}")
    from scripts.benches import episodes, world
    from scripts.benches import slam as bench_slam
    from scripts.machine import machine

    if page is not None and not against:
        raise InvalidValueError("--page needs --against: its table is of ratios to others")
    measures: tuple[Callable[[float], Iterable[dict[str, Any]]], ...] = (
        world.simulation,
        world.scanner,
        world.physics,
        world.environments,
        episodes.crowds,
        world.pictures,
        bench_slam.updates,
        bench_slam.ekf,
        bench_slam.area,
        episodes.office,
    )

    if against:
        _against(seconds, page, out)
        return
    rows: list[dict[str, Any]] = []
    table = Table(title="Speed", title_justify="left", caption=str(machine()["processor"]))
    for heading in ("what", "figure", "unit", "target", "how"):
        table.add_column(heading, justify="right" if heading == "figure" else "left")
    for measure in measures:
        with working(f"measuring ({len(rows)} rows so far)"):
            found = list(measure(seconds))
        for row in found:
            rows.append(row)
            figure = row["figure"]
            shown = f"{figure:.0f}" if figure >= 100.0 else f"{figure:.3g}"
            table.add_row(row["what"], shown, row["unit"], row["target"], row["how"])
    console.print(table)
    _saved(out, rows)


def _against(seconds: float, page: Path | None, out: Path | None) -> None:
    """The table of ratios to others, on the console and where else it is wanted."""
    from scripts import marks
    from scripts.benches import against
    from scripts.machine import machine

    with working("measuring ours and others in turn"):
        rows = list(against.rows(seconds))
    told = against.table(rows, machine())
    console.print(told, markup=False, soft_wrap=True)
    if page is not None:
        marks.fill_page(page, "speed", told)
    _saved(out, rows)


def _saved(out: Path | None, rows: list[dict[str, Any]]) -> None:
    from scripts.machine import machine, versions

    if out is not None:
        report = {"schema": 1, "machine": machine(), "versions": versions(), "rows": rows}
        write_text(out, json.dumps(report, indent=2) + "\n")

# SPDX-License-Identifier: Apache-2.0
"""``mobilia sensor-card``: the simulated LMS-221 measured against its data sheet, row by row."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table

from scripts.console import console, note
from slam.errors import MobiliaError


def sensor_card(
    out: Annotated[
        Path | None, typer.Option(help="Also write sensor_card.md and pictures/ into this folder.")
    ] = None,
) -> None:
    """Measure the simulated LMS-221 against its data sheet; with --out, as a page with figures."""
    from scripts.card import page  # mujoco: only once the environment is known good
    from scripts.card import rows as sensor_rows

    rows = sensor_rows.rows()
    table = Table(title="SICK LMS-221, simulated", title_justify="left")
    for heading in ("", "what", "data sheet", "measured", "source"):
        table.add_column(heading)
    for row in rows:
        mark = "[green]✓[/green]" if row.kept else "[red]✗[/red]"
        table.add_row(mark, row.what, row.datasheet, row.measured, row.source)
    console.print(table)
    if out is not None:
        page.write_card(out, rows)
        note(f"wrote {out / 'sensor_card.md'} and its pictures")
    broken = [row.what for row in rows if not row.kept]
    if broken:
        raise MobiliaError(f"the scanner departs from its data sheet: {'; '.join(broken)}")

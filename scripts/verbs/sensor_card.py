# SPDX-License-Identifier: Apache-2.0
"""``mobilia sensor-card``: a simulated scanner measured against its data sheet, row by row."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.markup import escape
from rich.table import Table

from scripts.console import console, note, working
from slam.errors import MobiliaError
from slam.files import write_text


def sensor_card(
    out: Annotated[
        Path | None, typer.Option(help="Also write sensor_card.md and pictures/ into this folder.")
    ] = None,
    scanner: Annotated[
        str, typer.Option(help="Which one, by name: utm30lx, tim561, ... (mobilia list).")
    ] = "lms221",
) -> None:
    """Measure a simulated scanner against its data sheet; with --out, as a page.

    The LMS-221's page has figures; that of another scanner is sensor_card_NAME.md.

    [bold]mobilia sensor-card --scanner utm30lx[/bold]
    """
    from scripts.card import page, stated  # mujoco: only once the environment is known good
    from scripts.card import rows as sensor_rows
    from sim.sensors.lidar.registry import DEFAULT, describe

    own = scanner == DEFAULT
    with working("measuring"):
        rows = sensor_rows.rows() if own else stated.rows_of(scanner)
    headings = ("", "what", "data sheet", "measured", "source")
    title = escape(f"{describe(scanner)} (simulated)")
    table = Table(*headings, title=title, title_justify="left")
    for row in rows:
        mark = "[green]✓[/green]" if row.kept else "[red]✗[/red]"
        table.add_row(mark, row.what, row.datasheet, row.measured, row.source)
    console.print(table)
    if out is not None:
        if own:
            with working("drawing the page"):
                page.write_card(out, rows)
            note(f"wrote {out / 'sensor_card.md'} and its pictures")
        else:
            out.mkdir(parents=True, exist_ok=True)
            write_text(out / f"sensor_card_{scanner}.md", stated.page(scanner, rows))
            note(f"wrote {out / f'sensor_card_{scanner}.md'}")
    broken = [row.what for row in rows if not row.kept]
    if broken:
        raise MobiliaError(f"the scanner departs from its data sheet: {'; '.join(broken)}")

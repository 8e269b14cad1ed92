# SPDX-License-Identifier: Apache-2.0
"""``mobilia sensor-card``: a simulated scanner beside its data sheet, or beside a real log."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.markup import escape
from rich.table import Table

from scripts.console import console, note, working
from scripts.log_options import Strict, TextFormat
from slam.errors import MobiliaError
from slam.files import write_text

if TYPE_CHECKING:
    from scripts.card.rows import Row


def sensor_card(
    out: Annotated[
        Path | None, typer.Option(help="Also write sensor_card.md and pictures/ into this folder.")
    ] = None,
    scanner: Annotated[
        str, typer.Option(help="Which one, by name: utm30lx, tim561, ... (mobilia list).")
    ] = "lms221",
    log: Annotated[
        list[Path] | None,
        typer.Option(help="A real log to set it beside; several are taken for one scanner's."),
    ] = None,
    text_format: TextFormat = None,
    strict: Strict = False,
) -> None:
    """Measure a simulated scanner against its data sheet, or with --log beside a real one.

    The LMS-221's page has figures; that of another scanner is sensor_card_NAME.md. With --log,
    noise, mixed pixels, lost beams and rounding are measured on the log and on simulated scans
    by the same code. The LMS-221 then takes the log's angle between beams.

    [bold]mobilia sensor-card --scanner utm30lx[/bold]
    [bold]mobilia sensor-card --log robot.log[/bold]
    """
    if log:
        beside_log(log, scanner, out, text_format=text_format, strict=strict)
        return
    beside_sheet(scanner, out)


def beside_sheet(scanner: str, out: Path | None) -> None:
    """Print what a scanner's data sheet says beside what was measured; with ``out`` also write it.

    Raises ``MobiliaError`` where the scanner departs from its data sheet.
    """
    from scripts.card import rows, stated  # mujoco: only once the environment is known good
    from sim.sensors.lidar.registry import DEFAULT, describe

    with working("measuring"):
        measured = rows.rows() if scanner == DEFAULT else stated.rows_of(scanner)
    console.print(_table(f"{describe(scanner)} (simulated)", measured))
    if out is not None:
        _write_card(out, scanner, measured)
    broken = [row.what for row in measured if not row.kept]
    if broken:
        raise MobiliaError(f"the scanner departs from its data sheet: {'; '.join(broken)}")


def _table(title: str, rows: list[Row]) -> Table:
    headings = ("", "what", "data sheet", "measured", "source")
    table = Table(*headings, title=escape(title), title_justify="left")
    for row in rows:
        mark = "[green]✓[/green]" if row.kept else "[red]✗[/red]"
        table.add_row(mark, row.what, row.datasheet, row.measured, row.source)
    return table


def _write_card(out: Path, scanner: str, rows: list[Row]) -> None:
    """The page of one scanner; that of the LMS-221 has figures."""
    from scripts.card import page, stated
    from sim.sensors.lidar.registry import DEFAULT

    if scanner == DEFAULT:
        with working("drawing the page"):
            page.write_card(out, rows)
        note(f"wrote {out / 'sensor_card.md'} and its pictures")
    else:
        out.mkdir(parents=True, exist_ok=True)
        write_text(out / f"sensor_card_{scanner}.md", stated.page(scanner, rows))
        note(f"wrote {out / f'sensor_card_{scanner}.md'}")


def beside_log(
    logs: list[Path], scanner: str, out: Path | None, *, text_format: Path | None, strict: bool
) -> None:
    """Print the two cards side by side; with ``out``, also write them as real_scanner_log.md."""
    from scripts.card.real import table
    from scripts.card.real.beside import like, real_card, simulated_card
    from sim.sensors.lidar.registry import scanner_of

    scanner_of(scanner)  # an unknown name is said before anything is read
    with working("measuring the log"):
        real = {"log": real_card(logs, text_format=text_format, strict=strict)}
    name = like(real["log"], scanner)
    with working("simulating and measuring"):
        ours = {name: simulated_card(name)}
    title = "value (95 % interval, whole stretches drawn again); ≠: the intervals do not meet"
    shown = Table(*map(escape, table.headings(real, ours)), title=title, title_justify="left")
    for line in table.lines(real, ours):
        shown.add_row(*table.cells(line))
    console.print(shown)
    for what, card in {**real, **ours}.items():
        note(f"{what}: {table.amount(card)}")
    if out is not None:
        out.mkdir(parents=True, exist_ok=True)
        text = f"# {', '.join(log.name for log in logs)} beside {name}\n\n"
        write_text(out / "real_scanner_log.md", f"{text}{table.markdown(real, ours)}\n")
        note(f"wrote {out / 'real_scanner_log.md'}")

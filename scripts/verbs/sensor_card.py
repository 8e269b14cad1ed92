# SPDX-License-Identifier: Apache-2.0
"""``mobilia sensor-card``: a simulated scanner beside its data sheet, or beside a real log."""

from pathlib import Path

from scripts.console import console, note, working
from scripts.options import Recorded
from scripts.spec import SCANNERS, option, part, spec
from slam.errors import MobiliaError


@spec
class SensorCard:
    """Measure a simulated scanner against its data sheet, or with --log beside a real one.

    The LMS-221's page has figures; that of another scanner is sensor_card_NAME.md. With --log,
    noise, mixed pixels, lost beams and rounding are measured on the log and on simulated scans
    by the same code. The LMS-221 then takes the log's angle between beams.

    [bold]mobilia sensor-card --scanner utm30lx[/bold]
    [bold]mobilia sensor-card --log robot.log[/bold]
    """

    out: Path | None = option(
        "Also write sensor_card.md and pictures/ into this folder.", writes=True
    )
    scanner: str = option(
        "Which one, by name: utm30lx, tim561, ... (mobilia list).", "lms221", complete=SCANNERS
    )
    log: list[Path] | None = option(
        "A real log to set it beside; several are taken for one scanner's."
    )
    recorded: Recorded = part(Recorded, without=("scan", "laser", "flip"))

    def __call__(self) -> None:
        if self.out is not None:
            from slam.files import refuse_links

            refuse_links(self.out / "pictures", self.out / "results")
        if not self.log:
            beside_sheet(self.scanner, self.out)
            return
        beside_log(
            self.log, self.scanner, self.out, text_format=self.recorded.text_format,
            strict=self.recorded.strict,
        )  # fmt: skip


def beside_sheet(scanner: str, out: Path | None) -> None:
    """Print what a scanner's data sheet says beside what was measured; with ``out`` also write it.

    Raises ``MobiliaError`` where the scanner departs from its data sheet.
    """
    from scripts.card import page, rows, stated
    from sim.sensors.lidar.registry import DEFAULT
    from slam.files import make_folder

    usual = scanner == DEFAULT
    with working("measuring"):
        measured = rows.rows() if usual else stated.rows_of(scanner)
    table = page.table(scanner, measured)
    console.print(table.printed(ruled=True))
    if out is not None:
        if usual:
            make_folder(out / "pictures")
            with working("drawing what each effect does"):
                page.draw(out / "pictures" / "sensor_ablation.png")
        name = "sensor_card" if usual else f"sensor_card_{scanner}"
        note(f"wrote {page.write(out, name, page.page(scanner, table))}")
    broken = [row.what for row in measured if not row.kept]
    if broken:
        raise MobiliaError(f"the scanner departs from its data sheet: {'; '.join(broken)}")


def beside_log(
    logs: list[Path], scanner: str, out: Path | None, *, text_format: Path | None, strict: bool
) -> None:
    """Print the two cards side by side; with ``out``, also write them as real_scanner_log.md."""
    from scripts.card import beside, page
    from scripts.card.beside import like, real_card, simulated_card
    from sim.sensors.lidar.registry import scanner_of

    scanner_of(scanner)  # an unknown name is said before anything is read
    with working("measuring the log"):
        real = {"log": real_card(logs, text_format=text_format, strict=strict)}
    name = like(real["log"], scanner)
    with working("simulating and measuring"):
        ours = {name: simulated_card(name)}
    console.print(beside.table(real, ours).printed(ruled=True))
    for what, card in (real | ours).items():
        note(f"{what}: {beside.amount(card)}")
    if out is not None:
        head = f"# {', '.join(log.name for log in logs)} beside {name}"
        text = f"{head}\n\n{beside.markdown(real, ours)}"
        note(f"wrote {page.write(out, 'real_scanner_log', text)}")

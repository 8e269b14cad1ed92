# SPDX-License-Identifier: Apache-2.0
"""``mobilia doctor``: what works here, and how to get what does not."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer
from rich.markup import escape
from rich.table import Table

from scripts.console import console, say, working
from slam.errors import MobiliaError

if TYPE_CHECKING:
    from scripts.doctor.checks import Finding

_MARKS = {"ok": "[green]✓[/green]", "can do without": "[yellow]-[/yellow]",
          "missing": "[red]✗[/red]"}  # fmt: skip


def doctor(
    sizes: Annotated[
        bool, typer.Option("--sizes", help="Print what the virtual environment is made of, in MB.")
    ] = False,
) -> None:
    """Say what works on this machine, and how to get what does not.

    3D pictures, films, cores, the cache of compiled loops, packages and extras with their versions.
    ✓ is there, - can be done without, ✗ is needed and missing: then the exit status is 1.
    """
    if sizes:
        _print_sizes()
        return
    from scripts.doctor.checks import findings

    with working("looking"):
        found = findings()
    for finding in found:
        _print(finding)
    missing = [finding.what for finding in found if finding.state == "missing"]
    if missing:
        raise MobiliaError(f"needed and missing: {', '.join(missing)}")


def _print(finding: Finding) -> None:
    told = f"{_MARKS[finding.state]} {escape(f'{finding.what:<24}')} {escape(finding.found)}"
    say(told, highlight=False)
    if finding.how:
        say(f"    to get it: {escape(finding.how)}", highlight=False)


def _print_sizes() -> None:
    from scripts.doctor.sizes import sizes, totals

    found = sizes()
    table = Table("package", "version", "MB", "needed for")
    table.columns[2].justify = "right"
    for size in found:
        if size.megabytes >= 0.5:
            table.add_row(size.name, size.version, f"{size.megabytes:.0f}", escape(size.group))
    console.print(table)
    parts = [f"{group} {mb:.0f} MB" for group, mb in totals(found).items()]
    whole = sum(size.megabytes for size in found)
    say(escape(f"{whole:.0f} MB in all: {', '.join(parts)}"))

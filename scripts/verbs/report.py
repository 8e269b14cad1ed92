# SPDX-License-Identifier: Apache-2.0
"""``mobilia report``: a comparison as one page."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.markup import escape

from scripts.console import console


def report(
    folder: Annotated[
        Path, typer.Argument(help="Folder that mobilia compare wrote.", metavar="DIR")
    ],
    drive: Annotated[
        list[Path] | None,
        typer.Option(help="Folders that mobilia drive wrote; DIR/drive* need not be named."),
    ] = None,
) -> None:
    """Write DIR/report.html: one page, self-contained, that opens from disk and prints.

    [bold]mobilia report out/compare[/bold]
    """
    from scripts.report import page
    from scripts.report.closed import driven
    from scripts.report.study import study

    found = [*(drive or []), *sorted(path for path in folder.glob("drive*") if path.is_dir())]
    path = page.write(study(folder), [driven(one) for one in found])
    console.print(
        f"Open [bold]{escape(str(path))}[/bold] ({path.stat().st_size / 1e6:.1f} MB).",
        soft_wrap=True,
    )

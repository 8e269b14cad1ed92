# SPDX-License-Identifier: Apache-2.0
"""``mobilia report``: a comparison as one page."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.markup import escape

from scripts.console import console, fact, working


def report(
    folder: Annotated[
        Path, typer.Argument(help="Folder that mobilia compare wrote.", metavar="DIR")
    ],
    drive: Annotated[
        list[Path] | None,
        typer.Option(help="Folders that mobilia drive wrote; DIR/drive* need not be named."),
    ] = None,
    subject: Annotated[
        str | None,
        typer.Option(help="SLAM that the page is about; default the one named first."),
    ] = None,
) -> None:
    """Write DIR/report.html: one page, self-contained, that opens from disk and prints.

    It begins with the answer, which is printed here too: from which level on the SLAM is lost.

    [bold]mobilia report out/compare --subject ekf[/bold]
    """
    from scripts.closed_loop.folder import driven, drives_in
    from scripts.report import page
    from scripts.report.answer import failed
    from scripts.report.study import study
    from scripts.report.wanted import check_comparison

    check_comparison(folder)
    found = [*(drive or []), *drives_in(folder)]
    about = study(folder, subject)
    with working("drawing the page"):
        path = page.write(about, [driven(one) for one in found])
    for line in failed(about.compared.runs, about.axis):
        fact(line, bad=True)
    for line in page.answers(about):
        fact(line)
    for line in page.blame_worst(about):
        console.print(f"What misled it: [bold]{escape(line)}[/bold]", highlight=False,
                      soft_wrap=True)  # fmt: skip
    console.print(
        f"Open [bold]{escape(str(path))}[/bold] ({path.stat().st_size / 1e6:.1f} MB).",
        soft_wrap=True,
    )

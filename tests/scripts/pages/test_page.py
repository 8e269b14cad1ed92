# SPDX-License-Identifier: Apache-2.0
"""The page of a folder: what is there is listed, what is not is left out, nothing is loaded."""

import re
from pathlib import Path

import numpy as np
from rich.table import Table

from scripts.pages.page import Page, Part, inline, write
from scripts.pages.table import Cell, grid, of_printed
from scripts.spec import command_line


def made(folder: Path, **more) -> str:
    (folder / "map.png").write_bytes(b"")
    (folder / "replays").mkdir()
    (folder / "replays" / "a b.html").write_text("")
    parts = [
        Part(title="Map", picture="map.png", legend={"#fff": "empty"}),
        Part(title="Not drawn", picture="changes.png"),
        Part(title="Start", picture=inline(np.zeros((2, 2, 3), np.uint8))),
    ]
    page = Page(
        title="<b>", said=["`x` was off by 2 cm."], parts=parts,
        next={"Why?": command_line("blame", folder="a folder")},
        settings={"seed": 3, "crowd": None}, **more,
    )  # fmt: skip
    return write(folder, page).read_text()


def test_a_page_lists_what_is_there_and_asks_for_nothing(tmp_path: Path):
    text = made(tmp_path)
    assert "&lt;b&gt;" in text
    assert "<b>" not in text
    assert "<code>x</code> was off by 2 cm." in text
    assert "mobilia blame &#39;a folder&#39;" in text
    assert 'src="map.png"' in text
    assert "Not drawn" not in text
    assert 'href="replays/a%20b.html"' in text
    assert "SHA256SUMS" in text
    assert "<video" not in text
    assert "<dt>seed</dt><dd>3</dd>" in text
    assert "crowd" not in text
    loaded = re.findall(r'(?:src|href|poster)="([^"]*)"', text)
    assert not [name for name in loaded if "//" in name]
    assert not re.search(r"url\(|@import|<script", text)


def test_a_printed_table_has_the_same_cells_on_the_page():
    table = Table("what", "[bold]n[/bold]", title="one [i]two[/i]")
    table.add_row("[green]✓[/green] a", "1")
    again = of_printed(table)
    assert (again.caption, again.head) == ("one two", ["what", "n"])
    assert [[cell.text for cell in row] for row in again.rows] == [["✓ a", "1"]]


def test_a_table_is_the_same_on_the_console_and_in_markdown():
    table = grid("what", "at", ["a|b", "[bold]"], [0.5], lambda row, at: Cell(text=row, small="x"))
    assert table.markdown() == "| at | 0.5 |\n| --- | ---: |\n| a/b | a/b [x] |\n" + (
        "| [bold] | [bold] [x] |"
    )
    again = of_printed(table.printed())
    assert (again.caption, list(again.head)) == ("what", ["at", "0.5"])
    assert [str(cell) for row in again.rows for cell in row] == [
        str(cell) for row in table.rows for cell in row
    ]

# SPDX-License-Identifier: Apache-2.0
"""Marked places of a Markdown page, which a script fills: ``<!-- name -->`` … ``<!-- /name -->``.

A rendered page does not show the marks. A place of its own lines has each mark on a line of its
own; a place within a line is within one line, and not at its beginning, where Markdown would take
all of the line for HTML.
"""

from __future__ import annotations

import re
from pathlib import Path

from slam.errors import InvalidValueError
from slam.files import write_text

_BEGIN = re.compile(r"<!-- ([\w.-]+) -->")


def names(text: str) -> list[str]:
    """Of the marked places, in order."""
    return _BEGIN.findall(text)


def filled(text: str, name: str, told: str, page: object) -> str:
    """``text`` with ``told`` at the place ``name``; empty lines round it where it has its own.

    Raises ``InvalidValueError`` that names ``page`` where the marks are not there once, are in the
    wrong order, or a place within a line would get several.
    """
    start, end = _marks(text, name, page)
    begin = f"<!-- {name} -->"
    before, after = text[: start + len(begin)], text[end:]
    if text[start + len(begin)] == "\n":
        return f"{before}\n\n{told}\n\n{after}"
    if "\n" in told:
        raise InvalidValueError(f"{page}: {begin} must stand on a line of its own for {told!r}")
    return f"{before}{told}{after}"


def fill_page(page: Path, name: str, told: str) -> None:
    """Write ``told`` at the place ``name`` of a page that is there, the rest as it is."""
    write_text(page, filled(page.read_text(encoding="utf-8"), name, told, page))


def without(text: str) -> str:
    """``text`` with nothing at its marked places."""
    for name in names(text):
        start, end = _marks(text, name, "the page")
        text = text[:start] + text[end + len(f"<!-- /{name} -->") :]
    return text


def _marks(text: str, name: str, page: object) -> tuple[int, int]:
    """Where the first mark begins and where the second does."""
    begin, end = f"<!-- {name} -->", f"<!-- /{name} -->"
    if text.count(begin) != 1 or text.count(end) != 1:
        raise InvalidValueError(f"{page} must have one {begin} and one {end}")
    start, stop = text.index(begin), text.index(end)
    if stop < start:
        raise InvalidValueError(f"{page} must have {begin} before {end}")
    return start, stop

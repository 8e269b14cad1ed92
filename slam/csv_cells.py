# SPDX-License-Identifier: Apache-2.0
"""Words in the cells of a CSV file, of which a spreadsheet takes some for formulas.

A cell that begins with ``=``, ``+``, ``-``, ``@``, a tab or a carriage return and is no number gets
an apostrophe in front, which a spreadsheet takes for "this is text". Reading takes it off again.
"""

from __future__ import annotations

import re

_BEGINS = frozenset("=+-@\t\r")
_NUMBER = re.compile(r"[-+]?(\d+(\.\d*)?([eE][-+]?\d+)?|inf|nan)")


def cell_of(word: str) -> str:
    """The cell that holds this word."""
    return f"'{word}" if _is_formula(word) and not _NUMBER.fullmatch(word) else word


def word_of(cell: str) -> str:
    """The word that this cell holds."""
    return cell[1:] if cell.startswith("'") and _is_formula(cell) else cell


def _is_formula(text: str) -> bool:
    """What has more apostrophes in front counts too, so that every word comes back the same."""
    return text.lstrip("'")[:1] in _BEGINS

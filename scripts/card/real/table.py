# SPDX-License-Identifier: Apache-2.0
"""Cards side by side: cells, rows and the Markdown table."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from slam.evaluation.scanner.card import PLAIN, SCALE, STATISTICS, ScannerCard
from slam.evaluation.scanner.figures import Figure, apart

NONE = "–"
DIFFERS, AGREES = "≠", "="


@dataclass(frozen=True, kw_only=True)
class Line:
    """One statistic of each card, in their order.

    verdicts  one a real card, against the first of ours: ≠ where the intervals do not meet, =
              where they do, empty where one of them has none
    """

    what: str
    unit: str
    cells: tuple[str, ...]
    verdicts: tuple[str, ...]


def cell(figure: Figure, unit: str) -> str:
    """``value (low to high)`` in that unit; a dash where nothing was measured."""
    if not math.isfinite(figure.value):
        return NONE
    if figure.value == 0.0:
        return "0"
    scale = SCALE[unit]
    digits = 2 if unit == PLAIN else 1
    if 0.0 < scale * figure.value < 0.1:
        digits = 2
    value, low, high = (
        f"{scale * number:.{digits}f}" for number in (figure.value, figure.low, figure.high)
    )
    return f"{value} ({low} to {high})" if figure.has_interval else value


Cards = Mapping[str, ScannerCard]


def lines(real: Cards, ours: Cards, *, details: bool = True) -> list[Line]:
    """Every statistic that one of the real cards has; ``details``: also range by range."""
    out = []
    for row in STATISTICS:
        if row.detail and not details:
            continue
        mine = [card.figures[row.key] for card in ours.values()]
        theirs = [card.figures[row.key] for card in real.values()]
        if not any(math.isfinite(figure.value) for figure in theirs):
            continue
        verdicts = (apart(figure, mine[0]) for figure in theirs)
        out.append(Line(
            what=row.what, unit=row.unit,
            cells=tuple(cell(figure, row.unit) for figure in (*theirs, *mine)),
            verdicts=tuple({None: "", True: DIFFERS, False: AGREES}[v] for v in verdicts),
        ))  # fmt: skip
    return out


def headings(real: Cards, ours: Cards) -> list[str]:
    """Of the columns."""
    return ["", "unit", *(name for log in real for name in (log, "")), *ours]


def cells(line: Line) -> list[str]:
    """Of one row, under ``headings``: each real cell is followed by its verdict."""
    logs = len(line.verdicts)
    pairs = zip(line.cells[:logs], line.verdicts, strict=True)
    return [line.what, line.unit, *(word for pair in pairs for word in pair), *line.cells[logs:]]


def markdown(real: Cards, ours: Cards) -> str:
    """The table without details, then what was there to measure."""
    head = headings(real, ours)
    rows = [head, ["---"] * len(head), *(cells(line) for line in lines(real, ours, details=False))]
    text = ["| " + " | ".join(row) + " |" for row in rows]
    text += ["", *(f"- {name}: {amount(card)}." for name, card in {**real, **ours}.items())]
    return "\n".join(text)


def amount(card: ScannerCard) -> str:
    """What a card is of, in words."""
    crept = f"; {card.crept} more not used, as their ranges moved" if card.crept else ""
    return (
        f"{card.scans} scans of {card.beams} beams, {math.degrees(card.increment_rad):g}° apart; "
        f"{card.blocks} blocks while driving; {card.standing_stretches} standing stretches "
        f"({card.standing_scans} scans){crept}"
    )

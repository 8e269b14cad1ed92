# SPDX-License-Identifier: Apache-2.0
"""Film strips: a few moments of a run side by side in one PNG, each labelled with its time.

strips({"": pictures}, seconds, Path("strip.png"))
strips({"as it was": pictures, "without chair 3": others}, seconds, Path("both.png"))
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import cv2
import numpy as np
from PIL import Image

from sim.view import draw
from sim.view.draw import Picture
from slam.errors import InvalidValueError
from slam.files import replacing

CELL_WIDTH = 400  # px
GAP, MARGIN = 10, 14
LABEL = 22  # px above a picture for its time
HEADING = 30  # px above a row for its name
KEY_PX, SWATCH = 13, 20  # px, of the words and of the colours of a legend
Legend = Sequence[tuple[str, draw.Color]]


def evenly(n: int, start_s: float, end_s: float) -> list[float]:
    """``n`` moments from ``start_s`` to ``end_s``, ends included; one alone is the end."""
    if n < 1:
        raise InvalidValueError(f"a strip needs at least 1 moment, got {n}")
    if n == 1:
        return [end_s]
    return [start_s + (end_s - start_s) * k / (n - 1) for k in range(n)]


def strips(
    rows: Mapping[str, Sequence[Picture]],
    seconds: Sequence[float],
    path: Path | None = None,
    *,
    columns: int | None = None,
    cell_width: int = CELL_WIDTH,
    legend: Legend = (),
) -> Picture:
    """Pictures of moments in a row (or in several of ``columns`` each) with their times, each run
    under its name; written to ``path``.

    rows      by name, "" for one without: (height, width, 3) uint8 RGB, all of one size
    seconds   of each, written above it
    legend    what colours stand for, written below all of them
    Raises ``InvalidValueError`` where these do not fit together.
    """
    columns = min(columns or len(seconds), len(seconds))
    shape = _cell(rows, seconds, cell_width)
    blocks = [_block(name, parts, seconds, columns, shape) for name, parts in rows.items()]
    if legend:
        blocks.append(_key(legend, blocks[0].shape[1]))
    inner = np.vstack(blocks)
    whole: Picture = np.full(
        (inner.shape[0] + MARGIN, inner.shape[1] + 2 * MARGIN, 3), draw.PAPER, np.uint8
    )
    whole[: inner.shape[0], MARGIN : MARGIN + inner.shape[1]] = inner
    if path is not None:
        with replacing(path) as temporary:
            Image.fromarray(whole).save(temporary, format="PNG", optimize=True)
    return whole


def _key(legend: Legend, width: int) -> Picture:
    """Colours and words, in as many lines as they take."""
    lines: list[list[tuple[str, draw.Color]]] = [[]]
    x = 0
    for word, color in legend:
        wide = SWATCH + draw.text_width(word, KEY_PX) + SWATCH
        if lines[-1] and x + wide > width:
            lines.append([])
            x = 0
        lines[-1].append((word, color))
        x += wide
    picture: Picture = np.full((LABEL * len(lines) + GAP, width, 3), draw.PAPER, np.uint8)
    for row, line in enumerate(lines):
        x, y = 0, GAP + row * LABEL
        for word, color in line:
            picture[y + 4 : y + 12, x : x + SWATCH - 6] = color
            x = draw.text(picture, word, (x + SWATCH, y), KEY_PX, draw.INK) + SWATCH
    return picture


def _cell(
    rows: Mapping[str, Sequence[Picture]], seconds: Sequence[float], cell_width: int
) -> tuple[int, int]:
    """(height, width) px of each picture in the strip."""
    if not seconds or not rows:
        raise InvalidValueError("a strip needs at least 1 moment, got 0")
    for name, parts in rows.items():
        if len(parts) != len(seconds):
            raise InvalidValueError(
                f"strip '{name}' has {len(parts)} pictures for {len(seconds)} moments"
            )
    shapes = sorted({part.shape for parts in rows.values() for part in parts})
    if len(shapes) != 1 or len(shapes[0]) != 3 or shapes[0][2] != 3:
        raise InvalidValueError(f"pictures of a strip must be RGB of one size, got {shapes}")
    height, width, _ = shapes[0]
    return max(1, round(height * cell_width / width)), cell_width


def _block(
    name: str,
    parts: Sequence[Picture],
    seconds: Sequence[float],
    columns: int,
    cell: tuple[int, int],
) -> Picture:
    """One run: its name and its pictures, ``columns`` a line."""
    (height, width), lines = cell, -(-len(parts) // columns)
    top = HEADING if name else 6
    shape = (top + lines * (LABEL + height + GAP) - GAP, columns * (width + GAP) - GAP, 3)
    block: Picture = np.full(shape, draw.PAPER, np.uint8)
    if name:
        draw.text(block, name, (0, 9), 15, draw.INK, bold=True)
    for k, (part, at_s) in enumerate(zip(parts, seconds, strict=True)):
        line, column = divmod(k, columns)
        x, y = column * (width + GAP), top + line * (LABEL + height + GAP)
        draw.text(block, f"{at_s:.1f} s", (x, y + 3), 13, draw.MUTED, bold=True)
        small = cv2.resize(part, (width, height), interpolation=cv2.INTER_AREA)
        block[y + LABEL : y + LABEL + height, x : x + width] = small
    return block

# SPDX-License-Identifier: Apache-2.0
"""Film strips: a few moments of a run side by side in one PNG, each labelled with its time."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
from PIL import Image

from sim.view import draw
from sim.view.draw import Picture
from slam.errors import InvalidValueError
from slam.files import replacing

CELL_WIDTH = 400  # px
TOP, GAP, MARGIN = 6, 10, 14
LABEL = 22  # px above a picture for its time
KEY_PX, SWATCH = 13, 20  # px, of the words and of the colours of a legend
Legend = Sequence[tuple[str, draw.Color]]


def evenly(n: int, start_s: float, end_s: float) -> list[float]:
    """``n`` moments from ``start_s`` to ``end_s``, ends included; one alone is the end."""
    if n < 1:
        raise InvalidValueError(f"a strip needs at least 1 moment, got {n}")
    if n == 1:
        return [end_s]
    return [start_s + (end_s - start_s) * k / (n - 1) for k in range(n)]


def strip(
    pictures: Sequence[Picture],
    seconds: Sequence[float],
    path: Path,
    *,
    columns: int,
    cell_width: int = CELL_WIDTH,
    legend: Legend = (),
) -> Picture:
    """Pictures of moments, ``columns`` a line, with their times; written to ``path``.

    pictures  (height, width, 3) uint8 RGB, all of one size
    seconds   of each, written above it
    legend    what colours stand for, written below all of them
    """
    columns, lines = min(columns, len(seconds)), -(-len(pictures) // columns)
    width = cell_width
    height = max(1, round(pictures[0].shape[0] * width / pictures[0].shape[1]))
    wide, high = columns * (width + GAP) - GAP, TOP + lines * (LABEL + height + GAP) - GAP
    inner: Picture = np.full((high, wide, 3), draw.PAPER, np.uint8)
    for k, (part, at_s) in enumerate(zip(pictures, seconds, strict=True)):
        line, column = divmod(k, columns)
        x, y = column * (width + GAP), TOP + line * (LABEL + height + GAP)
        draw.text(inner, f"{at_s:.1f} s", (x, y + 3), 13, draw.MUTED, bold=True)
        small = cv2.resize(part, (width, height), interpolation=cv2.INTER_AREA)
        inner[y + LABEL : y + LABEL + height, x : x + width] = small
    if legend:
        inner = np.vstack([inner, _key(legend, wide)])
    edges = ((0, MARGIN), (MARGIN, MARGIN))
    whole: Picture = np.stack(
        [np.pad(inner[..., k], edges, constant_values=draw.PAPER[k]) for k in range(3)], axis=-1
    )
    with replacing(path) as temporary:
        Image.fromarray(whole).save(temporary, format="PNG", optimize=True)
    return whole


def _key(legend: Legend, width: int) -> Picture:
    """Colours and words, in as many lines as they take."""
    places, x, line = [], 0, 0
    for word, color in legend:
        wide = SWATCH + draw.text_width(word, KEY_PX) + SWATCH
        if x and x + wide > width:
            x, line = 0, line + 1
        places.append((x, GAP + line * LABEL, word, color))
        x += wide
    picture: Picture = np.full((LABEL * (line + 1) + GAP, width, 3), draw.PAPER, np.uint8)
    for x, y, word, color in places:
        picture[y + 4 : y + 12, x : x + SWATCH - 6] = color
        draw.text(picture, word, (x + SWATCH, y), KEY_PX, draw.INK)
    return picture

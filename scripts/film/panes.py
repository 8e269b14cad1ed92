# SPDX-License-Identifier: Apache-2.0
"""Panes of your own in the film: a function that paints one picture of a frame.

They stand in a column at the right of the map. Without any the film is what it was.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np

from sim.view import draw
from sim.view.draw import Picture
from slam.errors import InvalidValueError

Painter = Callable[[Any, Any, tuple[int, int]], Picture]
F = TypeVar("F", bound=Painter)
MOST = 3  # panes; more would be too small to read
_panes: dict[str, Painter] = {}  # by title


def pane(title: str) -> Callable[[F], F]:
    """Function decorator: show ``paint(show, frame, size)`` in every film, under that title.

    show   a ``Show``: tracks (``show.track()``), paths (``show.moments.paths``), ``show.series``
    frame  the one that is painted
    size   (width, height) px of the (height, width, 3) picture to return

    Raises ``InvalidValueError`` beyond ``MOST`` panes.
    """
    if title not in _panes and len(_panes) >= MOST:
        raise InvalidValueError(f"a film has room for {MOST} more panes, '{title}' is one too many")

    def add(paint: F) -> F:
        _panes[title] = paint
        return paint

    return add


def registered() -> dict[str, Painter]:
    """All by title, in the order in which they were registered."""
    return dict(_panes)


def painted(title: str, show: Any, frame: Any, size: tuple[int, int]) -> Picture:
    """The picture of one; ``InvalidValueError`` names the pane that gives another shape."""
    picture, wanted = _panes[title](show, frame, size), (size[1], size[0], 3)
    if np.shape(picture) != wanted:
        raise InvalidValueError(
            f"film pane '{title}' must paint (height, width, 3) = {wanted}, got {np.shape(picture)}"
        )
    return picture


def blank(size: tuple[int, int]) -> Picture:
    """An empty picture of (width, height) to draw on."""
    return np.full((size[1], size[0], 3), draw.PAPER, np.uint8)

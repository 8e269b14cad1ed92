# SPDX-License-Identifier: Apache-2.0
"""Panes of your own in the film: a function that paints one picture of a frame.

They stand in a column at the right of the map. Without any the film is what it was.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from scripts.film import draw
from scripts.film.draw import Picture
from slam.errors import InvalidValueError

if TYPE_CHECKING:
    from scripts.film.encode import Size
    from scripts.film.show import Show
    from slam.frames import Frame

Painter = Callable[["Show", "Frame", "Size"], Picture]
F = TypeVar("F", bound=Painter)
MOST = 3  # panes; more would be too small to read


@dataclass(frozen=True, kw_only=True)
class Pane:
    """``paint(show, frame, (width, height))`` is a picture of that size, (height, width, 3)."""

    title: str
    paint: Painter

    def __call__(self, show: Show, frame: Frame, size: Size) -> Picture:
        """The picture; ``InvalidValueError`` names the pane whose picture has another shape."""
        picture = self.paint(show, frame, size)
        wanted = (size[1], size[0], 3)
        if np.shape(picture) != wanted:
            raise InvalidValueError(
                f"film pane '{self.title}' must paint (height, width, 3) = {wanted}, "
                f"got {np.shape(picture)}"
            )
        return picture


_panes: dict[str, Pane] = {}


def pane(title: str) -> Callable[[F], F]:
    """Function decorator: show ``paint(show, frame, size)`` in every film, under that title.

    show   the tracks (``show.track()``), paths (``show.trails``) and errors (``show.series``)
    frame  the one that is painted
    size   (width, height) px of the picture to return

    Raises ``InvalidValueError`` beyond ``MOST`` panes.
    """
    if title not in _panes and len(_panes) >= MOST:
        raise InvalidValueError(f"a film has room for {MOST} more panes, '{title}' is one too many")

    def add(paint: F) -> F:
        _panes[title] = Pane(title=title, paint=paint)
        return paint

    return add


def registered() -> tuple[Pane, ...]:
    """All, in the order in which they were registered."""
    return tuple(_panes.values())


def blank(size: Size) -> Picture:
    """An empty picture of (width, height) to draw on."""
    return np.full((size[1], size[0], 3), draw.PAPER, np.uint8)

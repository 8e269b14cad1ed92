# SPDX-License-Identifier: Apache-2.0
"""Where the panes of a film frame lie, and panes of your own: a function that paints one.

Your own stand in a column at the right of the map. Without any the film is what it was.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np

from scripts.film.encode import Size
from sim.view import draw
from sim.view.draw import Picture
from slam.errors import InvalidValueError

Painter = Callable[[Any, Any, tuple[int, int]], Picture]
F = TypeVar("F", bound=Painter)
MOST = 3  # panes; more would be too small to read
_panes: dict[str, Painter] = {}  # by title
MARGIN, TOP, TITLE, GUTTER = 16, 66, 20, 16  # of a 1280 x 720 frame, px
CHART, LEFT, CLOSE = 240, 480, 150
MORE = 220  # width of the column of panes that users add, px


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


@dataclass(frozen=True)
class Box:
    """One pane: its left upper corner and its size, px."""

    x: int
    y: int
    width: int
    height: int

    @property
    def size(self) -> Size:
        """(width, height)."""
        return self.width, self.height


@dataclass(frozen=True, kw_only=True)
class Layout:
    """The panes of a frame; ``camera`` is None without a 3D view, whose place the others take.

    unit  px that stand for one of 1280 x 720: what fonts and lines scale with
    more  panes that users add (``scripts.film.panes``), a column at the right of the map
    """

    size: Size
    unit: float
    scan: Box
    map: Box
    chart: Box
    close: Box
    camera: Box | None = None
    more: tuple[Box, ...] = ()

    @classmethod
    def of(cls, size: Size, *, camera: bool, more: int = 0) -> "Layout":
        """For a frame of (width, height) with ``more`` panes of users; all grow with it."""
        unit = min(size[0] / 1280.0, size[1] / 720.0)
        width, height = size[0] / unit, size[1] / unit

        def box(x: float, y: float, w: float, h: float) -> Box:
            left, top = round(x * unit), round(y * unit)
            return Box(left, top, round((x + w) * unit) - left, round((y + h) * unit) - top)

        chart_top = height - 14 - CHART
        upper = chart_top - 26 - TOP
        if camera:
            left = MARGIN + LEFT + GUTTER
            lower = TOP + 300 + 28
            scan = box(MARGIN, lower, LEFT, height - 14 - lower)
            view = box(MARGIN, TOP, LEFT, 300)
        else:
            left = MARGIN
            half = (width - 2 * MARGIN - GUTTER) / 2.0
            scan, view = box(MARGIN, TOP, half, upper), None
        map_left = left if camera else MARGIN + half + GUTTER
        map_width = width - MARGIN - map_left - (MORE + GUTTER if more else 0)
        each = (upper - (more - 1) * (TITLE + 4)) / more if more else 0.0
        column = [
            box(width - MARGIN - MORE, TOP + k * (each + TITLE + 4), MORE, each)
            for k in range(more)
        ]
        return cls(
            size=size,
            unit=unit,
            camera=view,
            scan=scan,
            map=box(map_left, TOP, map_width, upper),
            chart=box(left, chart_top, width - MARGIN - CLOSE - GUTTER - left, CHART),
            close=box(width - MARGIN - CLOSE, chart_top + TITLE, CLOSE, CLOSE),
            more=tuple(column),
        )

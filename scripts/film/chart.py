# SPDX-License-Identifier: Apache-2.0
"""The pane of errors over time: position and heading, the 2 sigma claimed, and what happened."""

import math
from array import array
from collections.abc import Mapping, Sequence
from typing import Any

import cv2
import numpy as np

from scripts.film.panes import Box
from sim.events import KIDNAP, NEAR_M, Event
from sim.view import draw
from sim.view.draw import Color, Picture
from sim.view.moment import Shown
from slam.frames import Float

BAND_PALE = 0.82
MAX_POINTS = 1200  # of a curve as drawn
UNSURE = "unsure"
_LANES = {
    "chair": "pushed", "door": "doors", "person": "people", "change": "unseen", UNSURE: "unsure",
}  # fmt: skip
_HEADINGS_DEG = (0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 45.0, 90.0, 180.0)
_LOW = -3.0  # 1 mm, as a power of ten m
_TITLES = "position error", "heading error"


class Series:
    """Errors and claims of one SLAM over time, as they come.

    Columns: s since the first frame, m and rad of error (NaN without truth), and of what it claims
    (``Shown.claimed``).
    """

    def __init__(self) -> None:
        self._rows = array("d")

    def add(self, shown: Shown, name: str) -> None:
        """That track's at the next moment."""
        self._rows.extend((shown.seconds, *shown.error(name), *shown.claimed(name)))

    def rows(self) -> Float:
        """(n, 5)."""
        return np.array(self._rows).reshape(-1, 5)


class ErrorChart:
    """Paints the pane.

    primary  the SLAM whose claims are shown;   colors  of all of them
    lanes    which of "chair", "door", "person", "change", "unsure" there are, from the top
    """

    def __init__(
        self,
        size: tuple[int, int],
        unit: float,
        *,
        span_s: tuple[float, float],
        primary: str,
        colors: Mapping[str, Color],
        lanes: Sequence[str],
    ) -> None:
        self._size, self._unit, self._span = size, unit, span_s
        self._primary, self._colors, self._lanes = primary, colors, tuple(lanes)
        width, height = size
        self._bar, title = self._px(11), self._px(21)
        left, box_w = self._px(58), width - self._px(58) - self._px(10)
        self._bottom = height - self._px(20)
        lanes_top = self._bottom - self._bar * len(self._lanes)
        plots = lanes_top - 3 * title
        upper = round(plots * 0.62)
        self._boxes = (
            Box(left, title, box_w, upper), Box(left, 2 * title + upper, box_w, plots - upper)
        )  # fmt: skip
        self._lane_box = Box(left, lanes_top, box_w, self._bottom - lanes_top)
        self._grids: dict[tuple[float, float], Picture] = {}

    def paint(self, series: Mapping[str, Series], events: Sequence[Event]) -> Picture:
        """A fresh picture."""
        rows = {name: one.rows() for name, one in series.items()}
        own = rows[self._primary]
        worst = max((_largest(r[:, 1], 0.0) for r in rows.values() if _known(r[:, 1])), default=1.0)
        worst = max(worst, _largest(own[:, 3], -math.inf))
        high = next(power for power in (0.0, 1.0, 2.0) if power == 2.0 or worst <= 10.0**power)
        turned = math.degrees(max(_largest(own[:, 2], 0.0), _largest(own[:, 4], 0.0)))
        reach = next((r for r in _HEADINGS_DEG if r >= turned), _HEADINGS_DEG[-1])
        picture = self._grid(high, reach).copy()
        self._paint_bars(picture, events)
        self._paint_curves(picture, rows, 0, high)
        self._paint_curves(picture, rows, 1, reach)
        for event in events:
            if event.kind == KIDNAP:
                x, top = round(self._x(event.start_s)), self._boxes[0].y
                cv2.line(picture, (x, top), (x, self._bottom), draw.INK, 1)
                draw.text(picture, "kidnapped", (x + 3, top), self._px(11), draw.INK, True)
        return picture

    # -- parts ----------------------------------------------------------------------------

    def _px(self, value: float) -> int:
        return max(1, round(value * self._unit))

    def _x(self, seconds: Any) -> Any:
        """px from the left, of one moment or of many."""
        (start, end), box = self._span, self._lane_box
        return box.x + box.width * (seconds - start) / (end - start)

    def _y(self, plot: int, values: Any, axis: float) -> Any:
        """px below the top of the plot of errors, m or rad; ``axis`` as for ``_grid``."""
        if plot == 0:
            level = np.clip(np.log10(np.maximum(values, 10.0**_LOW)), _LOW, axis)
            share = (axis - level) / (axis - _LOW)
        else:  # beyond the axis: along its edge
            share = 0.5 * (1.0 - np.clip(np.degrees(values) / axis, -1.0, 1.0))
        return self._boxes[plot].height * share

    def _grid(self, high: float, reach: float) -> Picture:
        """Axes, lines and words that stay; up to 10^``high`` m and to ``reach`` degrees."""
        if (high, reach) in self._grids:
            return self._grids[high, reach]
        width, height = self._size
        picture: Picture = np.full((height, width, 3), draw.PAPER, np.uint8)
        small = self._px(11)
        for box, title in zip(self._boxes, _TITLES, strict=True):
            corner = (box.x + box.width, box.y + box.height)
            cv2.rectangle(picture, (box.x, box.y), corner, draw.GRID, 1)
            draw.text(picture, title, (box.x, box.y - self._px(19)), self._px(13), draw.INK, True)
        for decade in range(round(_LOW), round(high) + 1):
            self._rule(picture, 0, 10.0**decade, high, draw.length(10.0**decade))
        for degrees in (-reach, 0.0, reach):
            word = f"{degrees:+g}°" if degrees else "0°"
            self._rule(picture, 1, math.radians(degrees), reach, word)
        start, end = self._span
        # between marks of the time axis: six to thirteen of them
        span_s = end - start
        power = 10.0 ** math.floor(math.log10(span_s))
        step = next(s * power for s in (0.1, 0.2, 0.5, 1.0) if span_s / (s * power) <= 12.5)
        for k in range(math.ceil(start / step - 1e-9), math.floor(end / step + 1e-9) + 1):
            x, word = round(self._x(k * step)), f"{k * step:g} s"
            cv2.line(picture, (x, self._boxes[0].y), (x, self._bottom), draw.GRID, 1)
            left = min(x - draw.text_width(word, small) // 2, width - draw.text_width(word, small))
            draw.text(picture, word, (left, self._bottom + self._px(4)), small, draw.MUTED)
        self._name_lanes(picture)
        self._grids[high, reach] = picture
        return picture

    def _name_lanes(self, picture: Picture) -> None:
        box = self._lane_box
        for k, lane in enumerate(self._lanes):
            self._left_of(picture, box.y + k * self._bar - self._px(2), _LANES[lane])
        x, y = box.x, box.y - self._px(18)
        title = "events" if len(self._lanes) > 1 else "trust in itself"
        x = draw.text(picture, title, (x, y), self._px(13), draw.INK, True) + self._px(14)
        keys = [("hit by the scanner", draw.MAGENTA), ("out of its sight", _faint(draw.MAGENTA))]
        for word, color in keys if len(self._lanes) > 1 else ():
            x = self._key(picture, (x, y), word, color)
        if "person" in self._lanes:
            draw.text(picture, f"people: within {NEAR_M:g} m", (x, y + 1), self._px(12), draw.MUTED)

    def _key(self, picture: Picture, at: tuple[int, int], word: str, color: Color) -> int:
        """A swatch and what it stands for; returns the x of what comes next."""
        (x, y), side = at, self._px(10)
        picture[y + self._px(4) : y + self._px(4) + side, x : x + side] = color
        end = draw.text(picture, word, (x + side + self._px(4), y + 1), self._px(12), draw.MUTED)
        return end + self._px(12)

    def _rule(self, picture: Picture, plot: int, value: float, axis: float, word: str) -> None:
        box = self._boxes[plot]
        y = box.y + round(float(self._y(plot, value, axis)))
        cv2.line(picture, (box.x, y), (box.x + box.width, y), draw.GRID, 1)
        self._left_of(picture, y - self._px(7), word)

    def _left_of(self, picture: Picture, y: int, word: str) -> None:
        small = self._px(11)
        left = self._lane_box.x - draw.text_width(word, small) - self._px(5)
        draw.text(picture, word, (left, y), small, draw.MUTED)

    def _paint_curves(
        self, picture: Picture, rows: Mapping[str, Float], plot: int, axis: float
    ) -> None:
        """One of the two plots, and the numbers of now in the line of its title."""
        box, own = self._boxes[plot], rows[self._primary]
        inside = picture[box.y : box.y + box.height + 1, box.x : box.x + box.width + 1]
        pale = draw.paler(self._colors[self._primary], BAND_PALE)
        thin = _thinned(own)
        upper = self._y(plot, thin[:, 3 + plot], axis)
        lower = self._y(1, -thin[:, 4], axis) if plot else np.full(len(thin), float(box.height))
        if len(thin) >= 2:
            at = self._x(thin[:, 0]) - box.x
            outline = np.stack([np.r_[at, at[::-1]], np.r_[upper, lower[::-1]]], axis=1)
            draw.polygon(inside, outline, pale)
        for name in sorted(rows, key=lambda name: name == self._primary):
            thin = _thinned(rows[name])
            thin = thin[~np.isnan(thin[:, 1 + plot])]
            pixels = [self._x(thin[:, 0]) - box.x, self._y(plot, thin[:, 1 + plot], axis)]
            wide = max(1, self._px(1.6))
            draw.polyline(inside, np.stack(pixels, axis=1), self._colors[name], wide)
        words = {
            name: _turned(math.degrees(last), axis) if plot else draw.measured(last)
            for name, last in ((name, float(one[-1, 1 + plot])) for name, one in rows.items())
            if not math.isnan(last)
        }
        last = float(own[-1, 3 + plot])
        claim = f"2 σ it claims: {draw.measured(last)}"
        if plot:
            claim = f"±2 σ it claims: {math.degrees(last):.2f}°"
        x = box.x + draw.text_width(_TITLES[plot], self._px(13), bold=True) + self._px(14)
        y = box.y - self._px(18)
        for name, word in words.items():
            color = self._colors[name]
            x = draw.text(picture, f"{name} {word}", (x, y + 1), self._px(12), color, True)
            x += self._px(12)
        if not words:
            x = draw.text(picture, "no truth to compare with", (x, y + 1), self._px(12), draw.MUTED)
            x += self._px(12)
        self._key(picture, (x, y), claim, pale)

    def _paint_bars(self, picture: Picture, events: Sequence[Event]) -> None:
        for event in sorted(events, key=lambda e: e.seen):  # what was seen lies over what was not
            if event.kind not in self._lanes:
                continue
            x0, x1 = (round(self._x(at_s)) for at_s in (event.start_s, event.end_s))
            y = self._lane_box.y + self._lanes.index(event.kind) * self._bar
            full = draw.RED if event.kind == UNSURE else draw.MAGENTA
            low, high = max(x0, self._lane_box.x), max(x1, x0 + self._px(2))
            bar = picture[y + 1 : y + self._bar - self._px(2), low:high]
            bar[:] = full if event.seen else _faint(full)


def _known(column: Float) -> bool:
    return bool((~np.isnan(column)).any())


def _largest(column: Float, least: float) -> float:
    """The largest amount in it, or ``least``; NaN counts for nothing."""
    return float(np.fmax.reduce(np.abs(column), initial=least))


def _thinned(rows: Float) -> Float:
    """At most ``MAX_POINTS`` of them and the last."""
    return np.concatenate([rows[: -1 : max(1, -(-len(rows) // MAX_POINTS))], rows[-1:]])


def _turned(degrees: float, reach: float) -> str:
    """A heading error; with an arrow where it is beyond the axis, along whose edge it is drawn."""
    beyond = "" if abs(degrees) <= reach else " ↑" if degrees > 0.0 else " ↓"
    return f"{degrees:+.2f}°{beyond}"


def _faint(color: Color) -> Color:
    return draw.paler(color, 0.72)

# SPDX-License-Identifier: Apache-2.0
"""The pane of errors over time: position and heading, the 2 sigma claimed, and what happened."""

from __future__ import annotations

import math
from array import array
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import cv2
import numpy as np

from scripts.film import draw
from scripts.film.draw import Color, Picture
from scripts.film.layout import Box
from slam.frames import Float

CLAIM = 2.0  # sigmas of the band
BAND_PALE = 0.82
NEAR_M = 1.5  # of the people lane (``sim.events.NEAR_M``; logs film without the simulator)
MAX_POINTS = 1200  # of a curve as drawn
_LANES = {
    "chair": "pushed", "door": "doors", "person": "people", "change": "unseen", "unsure": "unsure",
}  # fmt: skip
_HEADINGS_DEG = (0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 45.0, 90.0, 180.0)
_LOW = -3.0  # 1 mm, as a power of ten m


@dataclass(eq=False)
class Series:
    """Numbers of one SLAM over time, as they come.

    seconds   since the first frame
    position  m of error, NaN without truth;   heading  rad, signed
    claimed   m, ``CLAIM`` sigma along the longest axis of the ellipse;  claimed_rad  of the heading
    """

    seconds: array[float] = field(default_factory=lambda: array("d"))
    position: array[float] = field(default_factory=lambda: array("d"))
    heading: array[float] = field(default_factory=lambda: array("d"))
    claimed: array[float] = field(default_factory=lambda: array("d"))
    claimed_rad: array[float] = field(default_factory=lambda: array("d"))

    def add(self, seconds: float, error: Float | None, covariance: Float) -> None:
        """``error`` (x m, y m, theta rad wrapped), None without truth."""
        a, b, c = covariance[0, 0], covariance[0, 1], covariance[1, 1]
        longest = 0.5 * (a + c) + math.sqrt(0.25 * (a - c) * (a - c) + b * b)
        self.seconds.append(seconds)
        self.position.append(math.nan if error is None else math.hypot(error[0], error[1]))
        self.heading.append(math.nan if error is None else float(error[2]))
        self.claimed.append(CLAIM * math.sqrt(max(float(longest), 0.0)))
        self.claimed_rad.append(CLAIM * math.sqrt(float(covariance[2, 2])))

    def thinned(self, name: str) -> Float:
        """That column in at most ``MAX_POINTS`` rows, the last among them."""
        column = np.array(getattr(self, name))
        step = max(1, -(-len(column) // MAX_POINTS))
        return np.concatenate([column[:-1:step], column[-1:]])


@dataclass(frozen=True, kw_only=True)
class Bar:
    """A stretch of time in one of the lanes; ``strong``: it was in the scanner's sight."""

    lane: str
    start_s: float
    end_s: float
    strong: bool = True


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
        self._position = Box(left, title, box_w, upper)
        self._heading = Box(left, 2 * title + upper, box_w, plots - upper)
        self._lane_box = Box(left, lanes_top, box_w, self._bottom - lanes_top)
        self._grids: dict[tuple[float, float], Picture] = {}

    def paint(
        self, series: Mapping[str, Series], bars: Sequence[Bar], kidnaps: Sequence[float] = ()
    ) -> Picture:
        """A fresh picture; ``kidnaps``: moments of, s."""
        own = series[self._primary]
        worst = max(self._worst(series), _largest(own.claimed, -math.inf))
        high = next(power for power in (0.0, 1.0, 2.0) if power == 2.0 or worst <= 10.0**power)
        reach = self._reach(own)
        picture = self._grid(high, reach).copy()
        self._paint_bars(picture, bars)
        self._paint_position(picture, series, high)
        self._paint_heading(picture, series, reach)
        for at_s in kidnaps:
            x = round(float(self._x(np.array([at_s]))[0]))
            cv2.line(picture, (x, self._position.y), (x, self._bottom), draw.INK, 1)
            draw.text(picture, "kidnapped", (x + 3, self._position.y), self._px(11), draw.INK, True)
        return picture

    # -- parts ----------------------------------------------------------------------------

    def _px(self, value: float) -> int:
        return max(1, round(value * self._unit))

    def _x(self, seconds: Float) -> Float:
        start, end = self._span
        x: Float = self._position.x + self._position.width * (seconds - start) / (end - start)
        return x

    def _worst(self, series: Mapping[str, Series]) -> float:
        known = [_largest(s.position) for s in series.values() if s.position]
        return max((p for p in known if p == p), default=1.0)

    def _reach(self, own: Series) -> float:
        """Degrees that the heading's axis goes up and down to."""
        worst = math.degrees(max(_largest(own.heading, 0.0), _largest(own.claimed_rad, 0.0)))
        return next((r for r in _HEADINGS_DEG if r >= worst), _HEADINGS_DEG[-1])

    def _grid(self, high: float, reach: float) -> Picture:
        """Axes, lines and words that stay."""
        if (high, reach) in self._grids:
            return self._grids[high, reach]
        width, height = self._size
        picture: Picture = np.full((height, width, 3), draw.PAPER, np.uint8)
        small = self._px(11)
        for box, title in ((self._position, "position error"), (self._heading, "heading error")):
            cv2.rectangle(
                picture, (box.x, box.y), (box.x + box.width, box.y + box.height), draw.GRID, 1
            )
            draw.text(picture, title, (box.x, box.y - self._px(19)), self._px(13), draw.INK, True)
        for decade in range(round(_LOW), round(high) + 1):
            y = round(float(self._y_position(np.array([10.0**decade]), high)[0]))
            self._rule(picture, self._position, y, draw.length(10.0**decade))
        for degrees in (-reach, 0.0, reach):
            y = round(float(self._y_heading(np.array([math.radians(degrees)]), reach)[0]))
            self._rule(picture, self._heading, y, f"{degrees:+g}°" if degrees else "0°")
        start, end = self._span
        step = _nice_step(end - start)
        for k in range(math.ceil(start / step - 1e-9), math.floor(end / step + 1e-9) + 1):
            x, word = round(float(self._x(np.array([k * step]))[0])), f"{k * step:g} s"
            cv2.line(picture, (x, self._position.y), (x, self._bottom), draw.GRID, 1)
            left = min(x - draw.text_width(word, small) // 2, width - draw.text_width(word, small))
            draw.text(picture, word, (left, self._bottom + self._px(4)), small, draw.MUTED)
        self._name_lanes(picture)
        self._grids[high, reach] = picture
        return picture

    def _name_lanes(self, picture: Picture) -> None:
        small, box = self._px(11), self._lane_box
        for k, lane in enumerate(self._lanes):
            y = box.y + k * self._bar
            left = box.x - draw.text_width(_LANES[lane], small) - self._px(5)
            draw.text(picture, _LANES[lane], (left, y - self._px(2)), small, draw.MUTED)
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

    def _rule(self, picture: Picture, box: Box, y: int, word: str) -> None:
        y += box.y
        cv2.line(picture, (box.x, y), (box.x + box.width, y), draw.GRID, 1)
        small = self._px(11)
        left = box.x - draw.text_width(word, small) - self._px(5)
        draw.text(picture, word, (left, y - self._px(7)), small, draw.MUTED)

    def _y_position(self, meters: Float, high: float) -> Float:
        box = self._position
        level = np.clip(np.log10(np.maximum(meters, 10.0**_LOW)), _LOW, high)
        y: Float = box.height * (high - level) / (high - _LOW)
        return y

    def _y_heading(self, radians: Float, reach: float) -> Float:
        box = self._heading
        level = np.clip(np.degrees(radians) / reach, -1.0, 1.0)  # beyond the axis: along its edge
        y: Float = box.height * 0.5 * (1.0 - level)
        return y

    def _paint_position(self, picture: Picture, series: Mapping[str, Series], high: float) -> None:
        own, box = series[self._primary], self._position
        top = self._y_position(own.thinned("claimed"), high)
        self._fill(picture, box, own, top, np.full(len(top), float(box.height)))
        for name, one in self._in_order(series):
            self._curve(picture, box, name, one, self._y_position(one.thinned("position"), high))
        known = {n: s.position[-1] for n, s in series.items() if s.position}
        words = {name: draw.measured(p) for name, p in known.items() if p == p}
        claimed = draw.measured(own.claimed[-1]) if own.claimed else ""
        self._say(picture, box, "position error", words, f"2 σ it claims: {claimed}")

    def _paint_heading(self, picture: Picture, series: Mapping[str, Series], reach: float) -> None:
        own, box = series[self._primary], self._heading
        claimed = own.thinned("claimed_rad")
        upper, lower = self._y_heading(claimed, reach), self._y_heading(-claimed, reach)
        self._fill(picture, box, own, upper, lower)
        for name, one in self._in_order(series):
            self._curve(picture, box, name, one, self._y_heading(one.thinned("heading"), reach))
        known = {n: s.heading[-1] for n, s in series.items() if s.heading}
        words = {name: _turned(math.degrees(h), reach) for name, h in known.items() if h == h}
        degrees = math.degrees(own.claimed_rad[-1]) if own.claimed_rad else 0.0
        self._say(picture, box, "heading error", words, f"±2 σ it claims: {degrees:.2f}°")

    def _in_order(self, series: Mapping[str, Series]) -> list[tuple[str, Series]]:
        """The primary one last, over the others."""
        return sorted(series.items(), key=lambda item: item[0] == self._primary)

    def _say(
        self, picture: Picture, box: Box, title: str, words: Mapping[str, str], claim: str
    ) -> None:
        """The numbers of now, in the line of the title."""
        x = box.x + draw.text_width(title, self._px(13), bold=True) + self._px(14)
        y = box.y - self._px(18)
        for name, word in words.items():
            at = (x, y + 1)
            x = draw.text(picture, f"{name} {word}", at, self._px(12), self._colors[name], True)
            x += self._px(12)
        if not words:
            x = draw.text(picture, "no truth to compare with", (x, y + 1), self._px(12), draw.MUTED)
            x += self._px(12)
        self._key(picture, (x, y), claim, draw.paler(self._colors[self._primary], BAND_PALE))

    def _fill(self, picture: Picture, box: Box, own: Series, upper: Float, lower: Float) -> None:
        """What lies between two curves, px from the top of the box, clipped to it."""
        x = self._x(own.thinned("seconds")) - box.x
        if len(x) < 2:
            return
        outline = np.stack([np.r_[x, x[::-1]], np.r_[upper, lower[::-1]]], axis=1)
        fixed = np.round(outline * 16.0).astype(np.int32)
        color = draw.paler(self._colors[self._primary], BAND_PALE)
        cv2.fillPoly(_window(picture, box), [fixed], color, cv2.LINE_AA, 4)

    def _curve(self, picture: Picture, box: Box, name: str, one: Series, y: Float) -> None:
        known = ~np.isnan(y)
        pixels = np.stack([self._x(one.thinned("seconds")) - box.x, y], axis=1)[known]
        draw.polyline(_window(picture, box), pixels, self._colors[name], max(1, self._px(1.6)))

    def _paint_bars(self, picture: Picture, bars: Sequence[Bar]) -> None:
        for strong in (False, True):  # what was seen lies over what was not
            for bar in bars:
                if bar.lane not in self._lanes or bar.strong != strong:
                    continue
                x0, x1 = self._x(np.array([bar.start_s, bar.end_s])).round().astype(int).tolist()
                y = self._lane_box.y + self._lanes.index(bar.lane) * self._bar
                full = draw.RED if bar.lane == "unsure" else draw.MAGENTA
                color = full if strong else _faint(full)
                low = max(x0, self._lane_box.x)
                picture[y + 1 : y + self._bar - self._px(2), low : max(x1, x0 + self._px(2))] = (
                    color
                )


def _largest(column: array[float], least: float = math.nan) -> float:
    """The largest amount in it, or ``least``; NaN counts for nothing."""
    return float(np.fmax.reduce(np.abs(np.array(column)), initial=least))


def _window(picture: Picture, box: Box) -> Picture:
    """A view of that part of the picture: what is drawn into it ends at its edges."""
    return picture[box.y : box.y + box.height + 1, box.x : box.x + box.width + 1]


def _turned(degrees: float, reach: float) -> str:
    """A heading error; with an arrow where it is beyond the axis, along whose edge it is drawn."""
    beyond = "" if abs(degrees) <= reach else " ↑" if degrees > 0.0 else " ↓"
    return f"{degrees:+.2f}°{beyond}"


def _faint(color: Color) -> Color:
    return draw.paler(color, 0.72)


def _nice_step(span_s: float) -> float:
    """Between marks of the time axis: six to thirteen of them."""
    power = 10.0 ** math.floor(math.log10(span_s))
    return next(s * power for s in (0.1, 0.2, 0.5, 1.0) if span_s / (s * power) <= 12.5)

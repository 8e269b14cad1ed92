# SPDX-License-Identifier: Apache-2.0
"""Small drawing helpers on RGB uint8 images, for all pictures: colours, text, lines, scale bars."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import cv2
import matplotlib
import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from slam import se2
from slam.frames import Float

Picture = NDArray[np.uint8]
Color = tuple[int, int, int]

INK: Color = (32, 36, 44)
MUTED: Color = (120, 126, 138)
PAPER: Color = (250, 250, 248)
GRID: Color = (226, 228, 232)
BLUE: Color = (31, 97, 190)  # the paper's raw LIDAR
ORANGE: Color = (222, 110, 24)  # odometry
GREEN: Color = (22, 140, 90)  # truth
RED: Color = (206, 44, 60)  # the SLAM's estimate; lost
AMBER: Color = (184, 108, 0)  # unsure
# what a beam hit
AZURE: Color = (18, 116, 255)  # static
TEAL: Color = (0, 150, 158)  # semi-static
MAGENTA: Color = (222, 0, 128)  # moving
VIOLET: Color = (140, 84, 206)  # a mixed pixel
GRAY: Color = (164, 168, 176)  # no return
SHIFT = 4  # fractional bits of pixel coordinates given to OpenCV
_TRACKS: tuple[Color, ...] = (RED, BLUE, (122, 63, 176))


@dataclass(frozen=True)
class View:
    """The part of the plane a pane shows: lower left corner (m), pixels per metre, size (px)."""

    x: float
    y: float
    scale: float
    width: int
    height: int

    @classmethod
    def fitting(cls, bounds: tuple[float, float, float, float], width: int, height: int) -> "View":
        """The largest scale at which ``bounds`` (xmin, ymin, xmax, ymax) fit, centred."""
        xmin, ymin, xmax, ymax = bounds
        scale = min(width / (xmax - xmin), height / (ymax - ymin))
        return cls(
            x=(xmin + xmax) / 2.0 - width / scale / 2.0,
            y=(ymin + ymax) / 2.0 - height / scale / 2.0,
            scale=scale,
            width=width,
            height=height,
        )

    def pixels(self, points: Float) -> Float:
        """(n, 2) m to (n, 2) px, x right and y down."""
        out = np.empty((len(points), 2))
        out[:, 0] = (points[:, 0] - self.x) * self.scale
        out[:, 1] = self.height - (points[:, 1] - self.y) * self.scale
        return out


@lru_cache(maxsize=8)
def _font(size: int, bold: bool) -> ImageFont.FreeTypeFont:
    name = "DejaVuSans-Bold.ttf" if bold else "DejaVuSans.ttf"
    return ImageFont.truetype(str(Path(matplotlib.get_data_path()) / "fonts" / "ttf" / name), size)


@lru_cache(maxsize=512)
def _glyphs(words: str, size: int, bold: bool) -> Picture:
    font = _font(size, bold)
    _, _, right, bottom = font.getbbox(words)
    image = Image.new("L", (max(int(right), 1) + 1, max(int(bottom), 1) + 1), 0)
    ImageDraw.Draw(image).text((0, 0), words, fill=255, font=font)
    return np.asarray(image, dtype=np.uint8)


def text(
    image: Picture,
    words: str,
    at: tuple[int, int],
    size: int = 14,
    color: Color = INK,
    bold: bool = False,
) -> int:
    """Write ``words`` with its top left corner at ``at``; returns the x after it.

    What lies outside the picture to the left, to the right or below is cut off.
    """
    x, y = at
    mask = _glyphs(words, size, bold)[:, max(-x, 0) :]
    x = max(x, 0)
    height = min(mask.shape[0], image.shape[0] - y)
    width = min(mask.shape[1], image.shape[1] - x)
    if height <= 0 or width <= 0:
        return x
    alpha = mask[:height, :width, None].astype(np.float32) / 255.0
    patch = image[y : y + height, x : x + width]
    patch[:] = (patch * (1.0 - alpha) + np.array(color, np.float32) * alpha).astype(np.uint8)
    return x + int(mask.shape[1])


def text_width(words: str, size: int, bold: bool = False) -> int:
    """How many px ``text`` would take."""
    return int(_glyphs(words, size, bold).shape[1])


def length(meters: float) -> str:
    """A length in the unit that people would use."""
    if abs(meters) >= 1.0:
        return f"{meters:.4g} m"
    return f"{meters * 100.0:.3g} cm" if abs(meters) >= 0.01 else f"{meters * 1000.0:.3g} mm"


def measured(meters: float) -> str:
    """An error: metres with two decimals, below that centimetres with one."""
    return f"{meters:.2f} m" if meters >= 1.0 else f"{meters * 100.0:.1f} cm"


def round_down(value: float) -> float:
    """The greatest 1, 2 or 5 times a power of ten that is not greater than ``value`` > 0."""
    power = 10.0 ** math.floor(math.log10(value))
    return max(step * power for step in (1.0, 2.0, 5.0) if step == 1.0 or step * power <= value)


def paler(color: Color, share: float) -> Color:
    """``color`` with that share of paper in it."""
    red, green, blue = (round(c + share * (p - c)) for c, p in zip(color, PAPER, strict=True))
    return red, green, blue


def darker(color: Color, share: float) -> Color:
    """That share of ``color``."""
    red, green, blue = (round(share * c) for c in color)
    return red, green, blue


def fixed(pixels: Float) -> NDArray[np.int32]:
    """Pixel coordinates as OpenCV's fixed point of ``SHIFT`` bits."""
    return np.round(np.asarray(pixels) * float(1 << SHIFT)).astype(np.int32)


def polyline(image: Picture, pixels: NDArray[Any], color: Color, thickness: int = 1) -> None:
    """An antialiased line through ``pixels`` (n, 2) float, sub-pixel exact."""
    if len(pixels) >= 2:
        cv2.polylines(image, [fixed(pixels)], False, color, thickness, cv2.LINE_AA, SHIFT)


def polygon(image: Picture, pixels: Float, color: Color) -> None:
    """A filled outline, sub-pixel exact."""
    cv2.fillPoly(image, [fixed(pixels)], color, cv2.LINE_AA, SHIFT)


def dots(image: Picture, pixels: Float, colors: Any, radius: float) -> None:
    """Discs of ``radius`` px; ``colors`` (n, 3)."""
    wide = round(radius * (1 << SHIFT))
    for at, color in zip(fixed(pixels).tolist(), np.asarray(colors).tolist(), strict=True):
        cv2.circle(image, at, wide, color, cv2.FILLED, cv2.LINE_AA, SHIFT)


def robot(image: Picture, view: View, T_view_robot: Float, color: Color) -> None:
    """A triangle, never smaller than 9 px."""
    size = max(1.0, 9.0 / (0.28 * view.scale))
    body = np.array([[0.28, 0.0], [-0.2, 0.19], [-0.2, -0.19]]) * size
    polygon(image, view.pixels(se2.transform(T_view_robot, body)), color)


def colors_of(names: Sequence[str]) -> dict[str, Color]:
    """A colour for each track and "truth"; odometry is always orange."""
    rest = [name for name in names if name != "odometry"]
    found = {name: _TRACKS[k % len(_TRACKS)] for k, name in enumerate(rest)}
    return {**found, "odometry": ORANGE, "truth": GREEN}


def scale_bar(picture: Picture, view: View, unit: float) -> None:
    """A length of 1, 2 or 5 times a power of ten in a corner: the lower left one, or the first of
    the others in which nothing is drawn."""
    meters = round_down(view.width / view.scale / 4.0)
    word, size, thick = length(meters), round(12 * unit), max(1, round(3 * unit))
    margin, bar, above = round(12 * unit), round(meters * view.scale), round(18 * unit)
    wide = max(bar, text_width(word, size))
    places = [
        (x, y)
        for y in (view.height - margin, margin + above)
        for x in (margin, view.width - margin - wide)
    ]
    free = (
        (x, y) for x, y in places if (picture[y - above : y + thick, x : x + wide] == PAPER).all()
    )
    x, y = next(free, places[0])
    picture[y : y + thick, x : x + bar] = INK
    text(picture, word, (x, y - above), size, INK)

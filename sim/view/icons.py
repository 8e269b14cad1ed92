# SPDX-License-Identifier: Apache-2.0
"""What movers look like from above: a few filled shapes and strokes each, in their own frame.

x is forward, y left, in metres; colours are RGB 0..255. ``sim.view.mapview`` places and draws them.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from scenes.kinds import kind_of
from slam.errors import UnknownNameError

Float = NDArray[np.float64]
Colour = tuple[int, int, int]

INK: Colour = (52, 58, 70)
SHADE: Colour = (206, 204, 200)
STEEL: Colour = (150, 156, 166)
BLUE: Colour = (70, 118, 186)
RED: Colour = (206, 74, 66)
WOOD: Colour = (160, 108, 66)
GREEN: Colour = (84, 132, 116)
CARTON: Colour = (202, 164, 116)
PAPER: Colour = (244, 244, 240)
NAVY: Colour = (48, 74, 140)
SICK_BLUE: Colour = (34, 84, 196)
ROBOT_RED: Colour = (196, 36, 44)


@dataclass(frozen=True, kw_only=True, eq=False)
class Shape:
    """``lines``: polylines (k, 2) m of one colour; filled when ``width`` is 0, else strokes of that
    many metres (at least a pixel)."""

    lines: tuple[Float, ...]
    colour: Colour
    width: float = 0.0
    closed: bool = False


def disc(x: float, y: float, a: float, b: float | None = None, n: int = 18) -> Float:
    """An ellipse as a polygon."""
    b = a if b is None else b
    turns = [math.tau * k / n for k in range(n)]
    return np.array([[x + a * math.cos(t), y + b * math.sin(t)] for t in turns])


def block(x: float, y: float, a: float, b: float, corner: float = 0.0) -> Float:
    """A rectangle with cut corners, by centre and half sizes."""
    c = corner
    return np.array(
        [
            [x + a, y - b + c],
            [x + a, y + b - c],
            [x + a - c, y + b],
            [x - a + c, y + b],
            [x - a, y + b - c],
            [x - a, y - b + c],
            [x - a + c, y - b],
            [x + a - c, y - b],
        ]
    )


def icon(kind: str, size: float, colour: Colour | None = None) -> tuple[Shape, ...]:
    """The drawing of a mover; ``size`` is ``Mover.radius``, ``colour`` its cloth or upholstery.

    ``UnknownNameError`` where its row in ``scenes.kinds`` names no drawing of ``DRAWINGS``.
    """
    name = kind_of(kind).icon
    if name not in DRAWINGS:
        known = ", ".join(DRAWINGS)
        raise UnknownNameError(f"icon of {kind} must be one of {known}, got {name!r}")
    return _drawn(name, size, colour)


@cache
def _drawn(name: str, size: float, colour: Colour | None) -> tuple[Shape, ...]:
    return DRAWINGS[name](size, colour)


def foot() -> tuple[Shape, ...]:
    """One shoe, its ankle at the origin."""
    return (Shape(lines=(disc(0.05, 0.0, 0.125, 0.05, 12),), colour=INK),)


def _plain(size: float, colour: Colour | None) -> tuple[Shape, ...]:
    """Its hull, for whatever has no drawing of its own."""
    return (
        Shape(lines=(disc(0.0, 0.0, size),), colour=colour or STEEL),
        Shape(lines=(disc(0.0, 0.0, 0.8 * size),), colour=_darker(colour or STEEL)),
    )


def _bin() -> tuple[Shape, ...]:
    return (
        Shape(lines=(disc(0, 0, 0.15),), colour=GREEN),
        Shape(lines=(disc(0, 0, 0.11),), colour=INK),
    )


def _door(width: float) -> tuple[Shape, ...]:
    leaf = np.array([[0.0, 0.0], [width, 0.0]])
    return (
        Shape(lines=(leaf,), colour=WOOD, width=0.06),
        Shape(lines=(disc(0, 0, 0.045),), colour=INK),
    )


def _door_sliding(width: float) -> tuple[Shape, ...]:
    leaf = np.array([[-0.03, 0.0], [width, 0.0]])
    return (
        Shape(lines=(leaf,), colour=INK, width=0.06),
        Shape(lines=(leaf,), colour=STEEL, width=0.03),
    )


def _chair_swivel(cloth: Colour) -> tuple[Shape, ...]:
    arms = tuple(
        np.array([[0.0, 0.0], [0.31 * math.cos(t), 0.31 * math.sin(t)]])
        for t in (math.tau * k / 5 for k in range(5))
    )
    castors = tuple(disc(float(arm[1, 0]), float(arm[1, 1]), 0.035, n=8) for arm in arms)
    back = np.array([[-0.25, -0.20], [-0.29, 0.0], [-0.25, 0.20]])
    return (
        Shape(lines=arms, colour=INK, width=0.045),
        Shape(lines=castors, colour=INK),
        Shape(lines=(block(0.01, 0.0, 0.22, 0.22, 0.07),), colour=cloth),
        Shape(lines=(back,), colour=_darker(cloth), width=0.085),
    )


def _chair_visitor(cloth: Colour) -> tuple[Shape, ...]:
    legs = tuple(disc(x, y, 0.032, n=8) for x in (-0.22, 0.20) for y in (-0.2, 0.2))
    back = np.array([[-0.235, -0.20], [-0.235, 0.20]])
    return (
        Shape(lines=legs, colour=STEEL),
        Shape(lines=(block(0.01, 0.0, 0.20, 0.19, 0.04),), colour=cloth),
        Shape(lines=(back,), colour=_darker(cloth), width=0.065),
    )


def _trolley() -> tuple[Shape, ...]:
    handle = np.array([[-0.45, -0.26], [-0.45, 0.26]])
    return (
        Shape(lines=(block(0.0, 0.0, 0.45, 0.30, 0.03),), colour=STEEL),
        Shape(lines=(block(0.19, 0.01, 0.21, 0.27), block(-0.21, 0.03, 0.15, 0.21)), colour=CARTON),
        Shape(lines=(handle,), colour=NAVY, width=0.05),
    )


def _pallet() -> tuple[Shape, ...]:
    boards = tuple(block(x, 0.0, 0.05, 0.30) for x in (-0.35, -0.175, 0.0, 0.175, 0.35))
    loads = (block(-0.19, 0.0, 0.175, 0.26), block(0.19, 0.0, 0.175, 0.26))
    return (Shape(lines=boards, colour=WOOD), Shape(lines=loads, colour=CARTON))


def _board() -> tuple[Shape, ...]:
    feet = tuple(np.array([[x, -0.25], [x, 0.25]]) for x in (-0.70, 0.70))
    panel = np.array([[-0.80, 0.0], [0.80, 0.0]])
    return (
        Shape(lines=feet, colour=INK, width=0.05),
        Shape(lines=(panel,), colour=STEEL, width=0.07),
        Shape(lines=(0.95 * panel,), colour=PAPER, width=0.035),
    )


def _hospital_bed() -> tuple[Shape, ...]:
    ends = tuple(np.array([[x, -0.45], [x, 0.45]]) for x in (-0.98, 0.98))
    return (
        Shape(lines=(block(0.0, 0.0, 0.97, 0.43, 0.03),), colour=PAPER),
        Shape(lines=(block(0.31, 0.0, 0.62, 0.43),), colour=BLUE),
        Shape(lines=(block(-0.70, 0.0, 0.16, 0.30, 0.06),), colour=SHADE),
        Shape(lines=ends, colour=WOOD, width=0.05),
    )


def _couch(cloth: Colour) -> tuple[Shape, ...]:
    seats = (block(-0.29, -0.09, 0.27, 0.26, 0.04), block(0.29, -0.09, 0.27, 0.26, 0.04))
    return (
        Shape(lines=(block(0.0, 0.0, 0.75, 0.38, 0.06),), colour=_darker(cloth)),
        Shape(lines=seats, colour=cloth),
    )


def _person(shirt: Colour) -> tuple[Shape, ...]:
    arms = (
        np.array([[0.0, 0.21], [0.10, 0.235]]),
        np.array([[0.0, -0.21], [0.10, -0.235]]),
    )
    return (
        Shape(lines=arms, colour=shirt, width=0.09),
        Shape(lines=(disc(0, 0, 0.13, 0.225),), colour=shirt),
        Shape(lines=(disc(0, 0, 0.13, 0.225),), colour=_darker(shirt), width=0.02, closed=True),
    )


def head(hair: Colour, skin: Colour) -> tuple[Shape, ...]:
    """Head of a person, its nose ahead."""
    return (
        Shape(lines=(disc(0.035, 0.0, 0.10, 0.085, 14),), colour=skin),
        Shape(lines=(disc(-0.01, 0.0, 0.10, 0.095, 14),), colour=hair),
    )


def _robot() -> tuple[Shape, ...]:
    wheels = (block(0.0, 0.175, 0.0975, 0.025), block(0.0, -0.175, 0.0975, 0.025))
    nose = np.array([[0.20, 0.0], [0.155, 0.035], [0.155, -0.035]])
    return (
        Shape(lines=wheels, colour=INK),
        Shape(lines=(block(-0.02, 0.0, 0.22, 0.165, 0.07),), colour=ROBOT_RED),
        Shape(lines=(block(-0.02, 0.0, 0.17, 0.12, 0.05),), colour=(40, 42, 48)),
        Shape(lines=(disc(0.08, 0.0, 0.085),), colour=SICK_BLUE),
        Shape(lines=(nose,), colour=(255, 255, 255)),
    )


def _darker(colour: Colour) -> Colour:
    red, green, blue = (round(0.68 * c) for c in colour)
    return red, green, blue


# Name of a drawing -> its shapes, from the mover's radius m and the colour of its cloth.
DRAWINGS: dict[str, Callable[[float, Colour | None], tuple[Shape, ...]]] = {
    "plain": _plain,
    "chair_swivel": lambda size, colour: _chair_swivel(colour or BLUE),
    "chair_visitor": lambda size, colour: _chair_visitor(colour or RED),
    "bin": lambda size, colour: _bin(),
    "trolley": lambda size, colour: _trolley(),
    "pallet": lambda size, colour: _pallet(),
    "board": lambda size, colour: _board(),
    "hospital_bed": lambda size, colour: _hospital_bed(),
    "couch": lambda size, colour: _couch(colour or GREEN),
    "person": lambda size, colour: _person(colour or BLUE),
    "door_sliding": lambda size, colour: _door_sliding(size),
    "door": lambda size, colour: _door(size),
    "robot": lambda size, colour: _robot(),
}

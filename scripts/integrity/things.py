# SPDX-License-Identifier: Apache-2.0
"""Chairs, boards and people of a stream: what they are, and how they look to a beam."""

import math
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from scripts.integrity.kinds import Kind
from slam._jit import njit
from slam.frames import Float

CHAIR, BOX, BOARD, LEGS, COAT = 0, 1, 2, 3, 4
SIDES = {BOX: 4, BOARD: 4}  # segments that a beam may hit
DISCS = {CHAIR: 4, LEGS: 2, COAT: 1}
LEG_M, SEAT_M = 0.025, 0.2  # radius of a chair's leg; half the side between legs
SHOE_M, HIP_M, PACE_M = 0.07, 0.12, 0.16  # radius of a leg; half between legs; half a step
COAT_M = 0.2  # radius
THICK_M = 0.03  # half of a board
AROUND_M = (0.6, 1.6)  # of the robot: an escort
THING = np.dtype(
    [
        ("kind", "i8"),
        # what it is: half length and radius (m), slow and fast (m/s), longest rest (s), share of
        # its ways that it rests, share that it goes with the robot, nearest and farthest there (m)
        *((name, "f8") for name in ("half", "radius", "slow", "fast", "rest_s", "rests")),
        *((name, "f8") for name in ("follows", "near", "wide")),
        # where it stands, m and rad
        *((name, "f8") for name in ("x", "y", "a")),
        # what it is about to do: until when (s); goal (m), or distance and bearing from the robot;
        # speed (m/s); turn (rad or rad/s); does it follow; the last step of the robot's that it
        # saw, -1 for none; is it to be moved
        *((name, "f8") for name in ("until", "gx", "gy", "speed", "turn", "beside", "seen", "due")),
        ("state", "u8"),  # of its generator
    ]
)
"""A thing: numbers with names, which the kernels read and write as ``thing.x``."""
Things = NDArray[np.void]
Thing = Any  # one of them


class Plane(NamedTuple):
    """All that the kernels know.

    things                 (m,) of ``THING``
    rooms, walls, pillars  (r, 4), (n, 4) and (k, 3) m, of the building
    path                   (n, 3) poses of the robot, ``dt`` s apart
    fov                    rad, what the robot sees
    """

    things: Things
    rooms: Float
    walls: Float
    pillars: Float
    path: Float
    dt: float
    fov: float


def traits(kind: Kind, chairs: np.random.Generator, boards: np.random.Generator) -> Things:
    """The things of a stream, in the order of their numbers; they stand nowhere yet."""
    rows = [*_chairs(kind, chairs), *_boards(kind, boards), *_people(kind)]
    made = np.zeros(len(rows), THING)
    made["x"] = made["y"] = made["a"] = 1e6  # out of everybody's way until they are placed
    made["seen"] = -1.0
    for one, row in zip(made, rows, strict=True):
        for name, value in row.items():
            one[name] = value
    return made


def _chairs(kind: Kind, rng: np.random.Generator) -> Iterator[dict[str, float]]:
    for k in range(kind.chairs):
        chair = {"kind": CHAIR, "radius": 0.3}
        if k % 3:
            half, radius = float(rng.uniform(0.0, 0.2)), float(rng.uniform(0.2, 0.3))
            chair = {"kind": BOX, "half": half, "radius": radius}
        yield {**chair, "slow": 0.1, "fast": 0.5, "rest_s": kind.chair_rest_s, "rests": 0.6}


def _boards(kind: Kind, rng: np.random.Generator) -> Iterator[dict[str, float]]:
    for _ in range(kind.boards):
        yield {
            "kind": BOARD, "half": float(rng.uniform(*kind.board_m)) / 2.0,
            "radius": THICK_M + 0.02, "slow": 0.1, "fast": 0.4, "rest_s": kind.board_rest_s,
            "rests": 0.3, "follows": kind.hug, "near": 0.6, "wide": 1.4,
        }  # fmt: skip


def _people(kind: Kind) -> Iterator[dict[str, float]]:
    near, wide = AROUND_M
    for k in range(kind.people):
        escort = k < round(kind.escort * kind.people)
        yield {
            "kind": COAT if k % 3 else LEGS, "radius": 0.24, "slow": 0.6, "fast": 1.3,
            "rest_s": 3.0, "rests": 0.0 if escort else 0.2, "follows": 1.0 if escort else 0.1,
            "near": near, "wide": wide,
        }  # fmt: skip


@njit
def outlines(poses: Float, things: Things, segments: Float, discs: Float) -> None:
    """Write what beams hit of things at ``poses`` (m, 3): ``SIDES`` and ``DISCS`` of each.

    ``segments`` (s, 5) and ``discs`` (d, 4) are filled from their starts; their last column gets
    the number of the thing.
    """
    n, d = 0, 0
    for i in range(things.shape[0]):
        thing: Thing = things[i]
        x, y = poses[i, 0], poses[i, 1]
        c, s = math.cos(poses[i, 2]), math.sin(poses[i, 2])
        if thing.kind == BOX or thing.kind == BOARD:
            half, side = thing.half + THICK_M, THICK_M
            if thing.kind == BOX:
                half, side = thing.half + 0.7 * thing.radius, 0.7 * thing.radius
            for k in range(4):
                u0 = half if k == 0 or k == 3 else -half
                v0 = side if k < 2 else -side
                u1 = half if k == 2 or k == 3 else -half
                v1 = side if k == 0 or k == 3 else -side
                segments[n, 0], segments[n, 1] = x + c * u0 - s * v0, y + s * u0 + c * v0
                segments[n, 2], segments[n, 3] = x + c * u1 - s * v1, y + s * u1 + c * v1
                segments[n, 4] = i
                n += 1
            continue
        count = 4 if thing.kind == CHAIR else (2 if thing.kind == LEGS else 1)
        swing = PACE_M * math.sin(4.5 * (x + y))
        for k in range(count):
            u, v, r = 0.0, 0.0, COAT_M
            if thing.kind == CHAIR:
                u, v, r = SEAT_M * (2 * (k % 2) - 1), SEAT_M * (2 * (k // 2) - 1), LEG_M
            elif thing.kind == LEGS:
                u, v, r = swing * (2 * k - 1), HIP_M * (2 * k - 1), SHOE_M
            discs[d, 0], discs[d, 1], discs[d, 2] = x + c * u - s * v, y + s * u + c * v, r
            discs[d, 3] = i
            d += 1

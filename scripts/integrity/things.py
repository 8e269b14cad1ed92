# SPDX-License-Identifier: Apache-2.0
"""Chairs, boards and people of a stream: what they are, where they stand, how they look."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from scripts.integrity.crew import (
    BOARD,
    BOX,
    CHAIR,
    COAT,
    CRUMB,
    FAST,
    FOLLOWS,
    HALF,
    LEGS,
    MINDS,
    NEAR,
    RADIUS,
    REST_S,
    RESTS,
    SLOW,
    TRAITS,
    WIDE,
    Crew,
    Place,
)
from scripts.integrity.kinds import StreamSpec
from scripts.integrity.movers import may_stand
from slam._jit import njit
from slam.frames import Float

LEG_M, SEAT_M = 0.025, 0.2  # radius of a chair's leg; half the side between legs
SHOE_M, HIP_M, PACE_M = 0.07, 0.12, 0.16  # radius of a leg; half between legs; half a step
THICK_M = 0.03  # half of a board
TRIES = 400
AROUND_M = (0.6, 1.6)  # of the robot: an escort


def _trait(**columns: float) -> Float:
    names = {
        "half": HALF, "radius": RADIUS, "slow": SLOW, "fast": FAST, "rest_s": REST_S,
        "rests": RESTS, "follows": FOLLOWS, "near": NEAR, "wide": WIDE,
    }  # fmt: skip
    row = np.zeros(TRAITS)
    for name, value in columns.items():
        row[names[name]] = value
    return row


def _chairs(spec: StreamSpec, rng: np.random.Generator) -> list[tuple[int, Float]]:
    out = []
    for k in range(spec.settings.chairs):
        rest = {"slow": 0.1, "fast": 0.5, "rest_s": spec.settings.chair_rest_s, "rests": 0.6}
        if k % 3 == 0:
            out.append((CHAIR, _trait(radius=0.3, **rest)))
        else:
            half = float(rng.uniform(0.0, 0.2))
            out.append((BOX, _trait(half=half, radius=float(rng.uniform(0.2, 0.3)), **rest)))
    return out


def _boards(spec: StreamSpec, rng: np.random.Generator) -> list[tuple[int, Float]]:
    settings = spec.settings
    return [
        (
            BOARD,
            _trait(
                half=float(rng.uniform(*settings.board_m)) / 2.0, radius=THICK_M + 0.02,
                slow=0.1, fast=0.4, rest_s=settings.board_rest_s, rests=0.3,
                follows=settings.hug, near=0.6, wide=1.4,
            ),
        )
        for _ in range(settings.boards)
    ]  # fmt: skip


def _people(spec: StreamSpec) -> list[tuple[int, Float]]:
    settings = spec.settings
    escorts = round(settings.escort * settings.people)
    return [
        (
            LEGS if k % 3 == 0 else COAT,
            _trait(
                radius=0.24, slow=0.6, fast=1.3, rest_s=3.0, rests=0.0 if k < escorts else 0.2,
                follows=1.0 if k < escorts else 0.1, near=AROUND_M[0], wide=AROUND_M[1],
            ),
        )
        for k in range(settings.people)
    ]  # fmt: skip


def things(spec: StreamSpec, place: Place, robot: Float) -> Crew:
    """What moves in a stream whose robot starts at ``robot`` (3,), each drawn of its own part."""
    rngs = {part: spec.rng(part) for part in ("chairs", "boards", "people")}
    rows = [("chairs", *one) for one in _chairs(spec, rngs["chairs"])]
    rows += [("boards", *one) for one in _boards(spec, rngs["boards"])]
    rows += [("people", *one) for one in _people(spec)]
    m = len(rows)
    crew = Crew(
        kinds=np.array([kind for _, kind, _ in rows], dtype=np.int64),
        traits=np.array([trait for _, _, trait in rows]).reshape(-1, TRAITS),
        at=np.full((m, 3), 1e6),  # out of everybody's way until they are placed
        minds=np.zeros((m, MINDS)),
        states=np.zeros(m, dtype=np.uint64),
    )
    crew.minds[:, CRUMB] = -1.0
    for i, (part, _, trait) in enumerate(rows):
        escorts = part == "people" and trait[FOLLOWS] == 1.0
        draw = _around(robot, rngs[part]) if escorts else _in_rooms(place, rngs[part])
        for _ in range(TRIES):
            pose = next(draw)
            if may_stand(crew, i, pose, robot, place):
                crew.at[i] = pose
                break
        crew.states[i] = rngs[part].integers(0, 2**63, dtype=np.uint64)
    crew.minds[crew.traits[:, FOLLOWS] == 1.0, CRUMB] = 0.0
    return crew


def _in_rooms(place: Place, rng: np.random.Generator) -> Iterator[Float]:
    """Poses in the rooms, by their areas."""
    rooms = place.rooms
    areas = (rooms[:, 2] - rooms[:, 0]) * (rooms[:, 3] - rooms[:, 1])
    shares = np.cumsum(areas / areas.sum())
    while True:
        x0, y0, x1, y1 = rooms[min(int(np.searchsorted(shares, rng.random())), len(rooms) - 1)]
        yield np.array([rng.uniform(x0, x1), rng.uniform(y0, y1), rng.uniform(0.0, math.tau)])


def _around(robot: Float, rng: np.random.Generator) -> Iterator[Float]:
    """Poses about the robot, ever farther from it."""
    for n in itertools.count():
        away, bearing = rng.uniform(*AROUND_M) + 0.01 * n, rng.uniform(0.0, math.tau)
        yield robot + np.array([away * math.cos(bearing), away * math.sin(bearing), bearing])


@njit
def outlines(  # noqa: PLR0913 (kernel)
    poses: Float,
    kinds: NDArray[np.int64],
    traits: Float,
    segments: Float,
    of_segment: Float,
    discs: Float,
    of_disc: Float,
) -> None:
    """Write what beams hit of things at ``poses`` (m, 3): four sides, four legs, two legs, a disc.

    ``segments`` and ``discs`` are filled from their starts; a box or board has 4, a chair 4 discs,
    LEGS 2 and COAT 1. ``of_segment`` and ``of_disc`` get the number of the thing.
    """
    n, d = 0, 0
    for i in range(kinds.shape[0]):
        x, y = poses[i, 0], poses[i, 1]
        c, s = math.cos(poses[i, 2]), math.sin(poses[i, 2])
        if kinds[i] == BOX or kinds[i] == BOARD:
            half, side = traits[i, HALF] + THICK_M, THICK_M
            if kinds[i] == BOX:
                half, side = traits[i, HALF] + 0.7 * traits[i, RADIUS], 0.7 * traits[i, RADIUS]
            for k in range(4):
                u0 = half if k == 0 or k == 3 else -half
                v0 = side if k < 2 else -side
                u1 = half if k == 2 or k == 3 else -half
                v1 = side if k == 0 or k == 3 else -side
                segments[n, 0], segments[n, 1] = x + c * u0 - s * v0, y + s * u0 + c * v0
                segments[n, 2], segments[n, 3] = x + c * u1 - s * v1, y + s * u1 + c * v1
                of_segment[n] = i
                n += 1
            continue
        count = 4 if kinds[i] == CHAIR else (2 if kinds[i] == LEGS else 1)
        swing = PACE_M * math.sin(4.5 * (x + y))
        for k in range(count):
            u, v, r = 0.0, 0.0, 0.2
            if kinds[i] == CHAIR:
                u, v, r = SEAT_M * (2 * (k % 2) - 1), SEAT_M * (2 * (k // 2) - 1), LEG_M
            elif kinds[i] == LEGS:
                u, v, r = swing * (2 * k - 1), HIP_M * (2 * k - 1), SHOE_M
            discs[d, 0], discs[d, 1], discs[d, 2] = x + c * u - s * v, y + s * u + c * v, r
            of_disc[d] = i
            d += 1

# SPDX-License-Identifier: Apache-2.0
"""Walls where the floor of a map ends and none stands: nothing can leave the scene."""

from itertools import pairwise

import cv2
import numpy as np
from numpy.typing import NDArray

from slam.frames import Float

Mask = NDArray[np.bool_]

HALF_M = 0.05  # half thickness of such a wall
TOLERANCE = 1.5  # cells by which it may miss the edge of the floor
BEYOND = 2  # cells by which it reaches into the walls at its ends


def ends_of(floor: Mask, built: Mask, cell_m: float) -> Float:
    """(n, 5) boxes along the edge of the floor where a way leads from it out of the picture.

    floor, built  cells of floor and of walls
    """
    n = 3  # beyond the picture all is outside
    inside, walls = (np.pad(mask, n) for mask in (floor, built))
    ring = cv2.dilate(inside.astype(np.uint8), np.ones((3, 3), np.uint8))
    _, ways = cv2.connectedComponents((~inside & ~walls).astype(np.uint8), connectivity=8)
    out = ways == ways[0, 0]
    rows = []
    for contour in cv2.findContours(ring, cv2.RETR_LIST, cv2.CHAIN_APPROX_NONE)[0]:
        for run in _runs(contour[:, 0], out):
            line = (cv2.approxPolyDP(run, TOLERANCE, closed=False)[:, 0] - n + 0.5) * cell_m
            for a, b in pairwise(line if len(line) > 1 else [line[0], line[0]]):
                half = 0.5 * float(np.hypot(*(b - a))) + HALF_M
                yaw = float(np.arctan2(b[1] - a[1], b[0] - a[0]))
                rows.append((*(0.5 * (a + b)).tolist(), half, HALF_M, yaw))
    return np.array(rows, dtype=np.float64).reshape(-1, 5)


def _runs(contour: NDArray[np.int32], out: Mask) -> list[NDArray[np.int32]]:
    """The parts of a closed line of cells (column, row) that are ``out``, a little longer."""
    is_out = out[contour[:, 1], contour[:, 0]]
    if is_out.all():
        return [np.vstack([contour, contour[:1]])]
    first = int(np.argmin(is_out))  # begins where a wall is
    contour, is_out = np.roll(contour, -first, axis=0), np.roll(is_out, -first)
    change = np.flatnonzero(np.diff(np.concatenate([is_out, [False]]).astype(np.int8)))
    at = np.arange(len(contour))
    return [
        contour[np.take(at, range(a + 1 - BEYOND, b + 1 + BEYOND), mode="wrap")]
        for a, b in change.reshape(-1, 2).tolist()
    ]

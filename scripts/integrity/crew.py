# SPDX-License-Identifier: Apache-2.0
"""What the kernels of the plane know of the things, of the building, and of the robot."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slam.frames import Float

CHAIR, BOX, BOARD, LEGS, COAT = 0, 1, 2, 3, 4
KEEP_M = 0.35
# columns of what a thing is: half length, radius (m); slow, fast (m/s); longest rest (s); share of
# its ways that it rests; share that it goes with the robot; nearest and farthest it goes there (m)
HALF, RADIUS, SLOW, FAST, REST_S, RESTS, FOLLOWS, NEAR, WIDE = range(9)
TRAITS = WIDE + 1
# columns of what it is about to do: until when (s); goal x, y (m), or distance and bearing from the
# robot; speed (m/s); does it follow; turn (rad or rad/s); the last step of the robot's that it saw,
# -1 for none; is it to be moved
UNTIL, GX, GY, SPEED, WITH, TURN, CRUMB, DUE = range(8)
MINDS = DUE + 1


class Place(NamedTuple):
    """The building: rooms (r, 4), walls (n, 4) and pillars (k, 3), m."""

    rooms: Float
    walls: Float
    pillars: Float


class Crew(NamedTuple):
    """All things: what they are, (m, 3) where they stand, what they are about, their generators."""

    kinds: NDArray[np.int64]
    traits: Float
    at: Float
    minds: Float
    states: NDArray[np.uint64]


class Drive(NamedTuple):
    """The robot: (n, 3) its poses, s between two of them, and what it sees (rad)."""

    path: Float
    dt: float
    fov: float

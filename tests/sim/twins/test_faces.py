# SPDX-License-Identifier: Apache-2.0
"""Faces of walls move to where returns lie; a wall that is askew turns."""

import math

import numpy as np
import pytest

from sim.twins.log import laid

pytestmark = pytest.mark.slow
ANGLES = np.radians(np.arange(-60.0, 61.0))
LASERS = np.array([[0.0, 0.1 * k, 0.0] for k in range(-5, 6)])


def _ranges(tilt: float) -> np.ndarray:
    """To a plane through (3, 0) whose normal is turned by ``tilt`` from -x."""
    normal = np.array([math.cos(tilt), math.sin(tilt)])
    rows = []
    for x, y, heading in LASERS:
        way = np.column_stack([np.cos(heading + ANGLES), np.sin(heading + ANGLES)])
        rows.append((normal @ np.array([3.0 - x, -y])) / (way @ normal))
    return np.array(rows)


def test_a_face_moves_to_its_returns_and_the_other_stays() -> None:
    box = laid(np.array([[3.1, 0.0, 0.2, 5.0, 0.0]]), LASERS, _ranges(0.0), ANGLES)[0][0]
    assert box[0] - box[2] == pytest.approx(3.0, abs=2e-3)
    assert box[0] + box[2] == pytest.approx(3.3, abs=2e-3)


def test_a_wall_and_the_poses_turn_to_each_other() -> None:
    wall = np.array([[3.1, 0.0, 0.1, 5.0, 0.0]])
    boxes, poses = laid(wall, LASERS, _ranges(0.02), ANGLES)
    turned = boxes[0, 4] - (poses - LASERS)[:, 2].mean()
    assert turned == pytest.approx(0.02, abs=4e-3)

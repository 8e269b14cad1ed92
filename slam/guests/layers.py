# SPDX-License-Identifier: Apache-2.0
"""A planar scan for matchers made for 3D scanners."""

from __future__ import annotations

import math

import numpy as np

from slam.frames import Float

SPACING_AT_M = 10.0  # m; there a voxel is as wide as two beams are apart
LEAST_VOXEL_M = 0.10  # m
MOST_VOXEL_M = 0.30  # m


def lifted(pose: Float) -> Float:
    """(4, 4) of a planar pose."""
    c, s = math.cos(float(pose[2])), math.sin(float(pose[2]))
    out = np.eye(4)
    out[:2, :2] = [[c, -s], [s, c]]
    out[:2, 3] = pose[:2]
    return out


def flattened(matrix: Float) -> Float:
    """(3,) planar part of a (4, 4): x m, y m, yaw rad."""
    return np.array([matrix[0, 3], matrix[1, 3], math.atan2(matrix[1, 0], matrix[0, 0])])


def voxel_m(spacing_rad: float) -> float:
    """Edge of a voxel, m: the beams' spacing at ``SPACING_AT_M``, within bounds."""
    return min(max(SPACING_AT_M * spacing_rad, LEAST_VOXEL_M), MOST_VOXEL_M)


def stacked(points: Float, apart_m: float) -> Float:
    """(3 n, 3) m: the points (n, 2) m in three layers, ``apart_m`` above each other.

    The points of one layer lie in one plane, so that every normal would point up. Of three, the
    normals are those of upright walls.
    """
    n = len(points)
    out = np.empty((3 * n, 3))
    for k, z in enumerate((-apart_m, 0.0, apart_m)):
        out[k * n : (k + 1) * n, :2] = points
        out[k * n : (k + 1) * n, 2] = z
    return out

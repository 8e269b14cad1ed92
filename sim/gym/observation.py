# SPDX-License-Identifier: Apache-2.0
"""What an environment tells a policy: its space, and ranges as finite numbers."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from sim.gym.pose_source import PoseSource
from slam._jit import njit
from slam.frames import LaserSpec

_MAX_TICKS = 2**40

Observation = dict[str, Any]  # arrays by name; Gymnasium types Dict spaces so


def space_of(spec: LaserSpec, *, believing: bool, polar: bool = False) -> spaces.Dict:
    """The space of an environment's observations.

    ``believing``: with a ``pose_source``; ``polar``: with range and bearing of the goal.
    """
    n = spec.n_beams
    believed = PoseSource.space(polar=polar) if believing else {}
    return spaces.Dict(
        {
            "ranges": spaces.Box(0.0, np.float32(spec.range_max), (n,), np.float32),
            "valid": spaces.Box(0, 1, (n,), np.uint8),
            "encoders": spaces.Box(-_MAX_TICKS, _MAX_TICKS, (2,), np.int64),
            "time": spaces.Box(0.0, 1e9, (), np.float64),
            **believed,
        }
    )


@njit
def observed(
    ranges: NDArray[np.float32], least: float, most: float
) -> tuple[NDArray[np.float32], NDArray[np.uint8]]:
    """Finite ranges, and which are measurements, as ``Scan.valid``."""
    out, valid = np.empty(ranges.size, np.float32), np.empty(ranges.size, np.uint8)
    for i in range(ranges.size):
        fits = least <= ranges[i] <= most
        valid[i] = fits
        out[i] = ranges[i] if fits else most
    return out, valid

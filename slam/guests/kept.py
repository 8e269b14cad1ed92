# SPDX-License-Identifier: Apache-2.0
"""Which of the kept scans a guest without a map of its own is matched against."""

from __future__ import annotations

import numpy as np

from slam.frames import Float

BASE = 20  # scans, the most that are matched against at once
NEAR_M = 8.0  # m, from the predicted pose; as for Karto's matcher


def nearest(places: list[Float], pose: Float) -> list[int]:
    """The scans kept nearest to a pose (3,), nearest first; the last one where none is near."""
    apart = np.array(places)[:, :2] - pose[:2]
    squares = (apart * apart).sum(axis=1)
    order = np.argsort(squares, kind="stable")[:BASE]
    return [int(k) for k in order if squares[k] < NEAR_M**2] or [len(places) - 1]

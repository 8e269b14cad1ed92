# SPDX-License-Identifier: Apache-2.0
"""What lies between the two surfaces of an edge: nothing, a mixed pixel, or a lost beam.

A mixed pixel is a range where nothing is: the spot lights the edge and what is behind it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from slam.evaluation.scanner.figures import Figures, key_of, ratio
from slam.evaluation.scanner.stretches import Stretch
from slam.frames import Float

SIDE = 3  # beams on either side that lie together
FLAT_M = 0.15  # m between the nearest and the farthest of a side
CLEAR_M = 0.1  # m from both sides, from which a range is of neither
DEPTH_BINS_M = ((0.4, 1.0), (1.0, 2.0), (2.0, 5.0), (5.0, 20.0))  # from side to side
LEAST_EDGES = 30  # below which a bin says nothing


def edges(stretches: Sequence[Stretch]) -> Figures:
    """Of edges with at most one beam between the sides, of all scans that are looked at.

    between    by their depth, the share with a range between the sides
    edge_lost  share with a beam without a return
    """
    found = [np.concatenate([_edges(scan) for scan in part.looked_at()]) for part in stretches]
    lost = [float((e[:, 1] == 2.0).sum()) for e in found]
    figures = {"edge_lost": ratio(lost, [len(e) for e in found])}
    for low, high in DEPTH_BINS_M:
        own = [e[(e[:, 0] >= low) & (e[:, 0] < high)] for e in found]
        made = ratio([float((e[:, 1] == 1.0).sum()) for e in own], [len(e) for e in own])
        figures[key_of("between", low, high)] = made.if_of(LEAST_EDGES)
    return figures


def _edges(ranges: Float) -> Float:
    """(k, 2): depth m of each edge; 0 for clean, 1 with a range between its sides, 2 lost."""
    windows = np.lib.stride_tricks.sliding_window_view(ranges, SIDE)
    low, high = windows.min(axis=1), windows.max(axis=1)  # NaN where one did not return
    flat = high - low <= FLAT_M
    rows = []
    for gap in (0, 1):
        n = len(low) - SIDE - gap
        a, b = np.arange(n), np.arange(n) + SIDE + gap
        near_right = low[a] < low[b]
        near, far = np.where(near_right, high[a], high[b]), np.where(near_right, low[b], low[a])
        depth = far - near
        edge = flat[a] & flat[b] & (depth >= DEPTH_BINS_M[0][0]) & (depth < DEPTH_BINS_M[-1][1])
        depth, near, far = depth[edge], near[edge], far[edge]
        kind = np.zeros(len(depth))
        if gap:
            own = ranges[a[edge] + SIDE]
            kind = np.where(np.isnan(own), 2.0, 0.0)
            kind[(own > near + CLEAR_M) & (own < far - CLEAR_M)] = 1.0
            depth, kind = depth[kind > 0.0], kind[kind > 0.0]
        rows.append(np.stack([depth, kind], axis=1))
    return np.concatenate(rows)

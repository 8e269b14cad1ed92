# SPDX-License-Identifier: Apache-2.0
"""How far poses are off where the robot is back at a place, by the two scans: without a reference.

A revisit is a scan whose pose is near that of one from an earlier visit. The scans are laid on each
other by ICP from the motion that the poses state; how far they move is how far the poses are off.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from slam import se2
from slam.frames import Float, Frame
from slam.scan_points import deskewed

NEAR_M, NEAR_RAD = 0.5, 0.3  # a pose is back
LATER_S, AWAY_M = 20.0, 2.0  # and has been away, so long and so far driven
MOST_PAIRS = 100
ROUNDS, REACH_M = 30, (0.6, 0.1)  # of ICP; how far points may be apart, first and last
LEAST_FIT, LEAST_TIED = (
    0.5,
    0.05,
)  # shares: points that lie on the other scan; of the weak direction
ON_M = 0.05  # so near a point lies on a surface


@dataclass(frozen=True, kw_only=True)
class Revisits:
    """``count`` scans of a place seen before; ``apart_cm`` their median by ICP, None without one.

    Scans that no motion lays on each other count as infinitely far apart.
    """

    count: int
    apart_cm: float | None


def pairs_of(seconds: Float, poses: Float, carried: int | None) -> list[tuple[int, int]]:
    """Scans, each with the nearest one of an earlier visit.

    carried  scan before which all earlier visits are, and from which on all later ones
    """
    way = np.concatenate([[0.0], np.hypot(*np.diff(poses[:, :2], axis=0).T).cumsum()])
    tree, found = cKDTree(poses[:, :2]), []
    for b, near in enumerate(tree.query_ball_point(poses[:, :2], NEAR_M)):
        a = np.array(near)
        turned = np.abs(se2.wrap_array(poses[a, 2] - poses[b, 2]))
        away = (np.abs(seconds[b] - seconds[a]) > LATER_S) & (way[b] - way[a] > AWAY_M)
        if carried is not None:
            away = (a < carried) & (b >= carried)
        a = a[away & (turned < NEAR_RAD)]
        if len(a):
            off = np.hypot(*(poses[a, :2] - poses[b, :2]).T)
            found.append((int(a[off.argmin()]), b))
    return found


def aligned(old: Float, new: Float, T_old_new: Float) -> Float | None:
    """The motion by point-to-line ICP from ``T_old_new``; None where the scans do not tell it."""
    tree = cKDTree(old)
    near = old[tree.query(old, k=5)[1]]
    spread = near - near.mean(axis=1, keepdims=True)
    normals = np.linalg.eigh(np.einsum("nki,nkj->nij", spread, spread))[1][:, :, 0]
    T = np.array(T_old_new)
    for reach in np.geomspace(*REACH_M, ROUNDS):
        here = se2.transform(T, new)
        apart, nearest = tree.query(here)
        kept = apart < reach
        if kept.sum() < 10:
            return None
        n, point = normals[nearest[kept]], here[kept]
        off = ((old[nearest[kept]] - point) * n).sum(axis=1)
        lever = point - T[:2]
        rows = np.column_stack([n, lever[:, 0] * n[:, 1] - lever[:, 1] * n[:, 0]])
        tied = np.linalg.eigvalsh(n.T @ n)[0] / len(n)
        T = T + np.linalg.lstsq(rows, off, rcond=None)[0]
    on = float((np.abs(off) < ON_M).sum()) / len(new)
    return T if on > LEAST_FIT and tied > LEAST_TIED else None


def judged(
    frames: Sequence[Frame], seconds: Float, poses: Float, carried: int | None = None
) -> Revisits:
    """By poses (n, 3) of frames with a scan each; ``carried`` as in ``pairs_of``."""
    pairs, found = pairs_of(seconds, poses, carried), []
    for a, b in pairs[:: max(1, -(-len(pairs) // MOST_PAIRS))]:
        stated = se2.between(poses[a], poses[b])
        old, new = deskewed(frames[a]), deskewed(frames[b])
        seen = aligned(old, new, stated) if min(len(old), len(new)) > 10 else None
        found.append(math.inf if seen is None else math.hypot(*(seen - stated)[:2]))
    return Revisits(count=len(pairs), apart_cm=100.0 * float(np.median(found)) if found else None)

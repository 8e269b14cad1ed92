# SPDX-License-Identifier: Apache-2.0
"""How well observations overlap the map, Eq. (13).

Sub-cell accuracy needs the overlap as a sum of Gaussians over the raw activities: interpolated or
pre-blurred fields pull structure towards cell centres, and a map that is rewritten from its own
poses then creeps. Gradient and curvature of that sum are analytic.
"""

import math
from typing import NamedTuple

from slam._jit import inlined, inner, uncounted
from slam.arrays import Bytes, Float
from slam.frontend.odometry_prior import rotate
from slam.frontend.surfaces import opposite, turned_face
from slam.tracker.cells import MASK, SHIFT, Cells, Field, activity


class Reward(NamedTuple):
    """How overlaps are rewarded; four as in ``MatchingConfig``, the last as in ``StandingConfig``.

    cell        m
    short_term  weight of x in v = y + (1 - y) * short_term * x
    logarithm   Eq. (13) as printed instead of the sum of overlaps
    """

    cell: float
    short_term: float
    logarithm: bool
    matched_overlap: float
    log_floor: float
    tail: float
    tail_cells: float
    young_trace: float


class Seen(NamedTuple):
    """Observations as the kernels see them; fields as in ``Observations``."""

    points: Float
    covariances: Float
    shares: Float
    tangents: Float
    facings: Bytes
    weights: Float


class Bell(NamedTuple):
    """A Gaussian: covariance across rows, precision, reach, and factors from cell to cell.

    ``wide`` and ``high``: how far its cells reach; ``lean``: each row's Gaussian is centred at
    u + lean * dv, with precision ``pa``; ``falling`` from column to column, ``slowing`` from row to
    row; ``norm`` of the density
    """

    d: float
    pa: float
    pb: float
    pd: float
    wide: float
    high: float
    lean: float
    falling: float
    slowing: float
    norm: float


@inner
def _bell(a: float, b: float, d: float, tail: float, tail_cells: float) -> Bell:
    """Of a covariance [[a, b], [b, d]], cells^2."""
    det = a * d - b * b
    if det <= 0.0:  # rounding has left nothing across
        b, det = 0.0, a * d
    pa = d / det
    falling = math.exp(-pa)
    return Bell(
        d, pa, -b / det, a / det, max(tail_cells, tail / math.sqrt(pa)),
        max(tail_cells, tail * math.sqrt(d)), b / d, falling,
        falling if a == d else math.exp(-1.0 / d), 1.0 / (math.pi * math.sqrt(det)),
    )  # fmt: skip


@inlined
def _overlap(  # noqa: C901, PLR0913, PLR0915 (kernel)
    field: Field,
    short_term: float,
    closed: float,
    u: float,
    v: float,
    bell: Bell,
    faced: int,
) -> tuple[float, float, float, float, float, float]:
    """Overlap f of a Gaussian at (u, v) with the map, its gradient and its negative curvature.

    (u, v) and ``bell`` are in cells, cell (i, j) lies at (i, j). f is the sum over
    cells of Gaussian times activity, divided so that a lone landmark scores 1 on itself. Cells
    of a surface that faces away from the observed one (``faced``) do not count. ``short_term``:
    weight of x; ``closed`` of a faint trace y: y (1 - closed (1 - y)).
    Returns f, df/du, df/dv, -d2f/du2, -d2f/dudv, -d2f/dv2.
    """
    d, pa, pb, pd, wide, high, lean, falling, slowing, norm = bell
    j0, j1 = math.ceil(v - high), math.floor(v + high)
    weight = math.exp(-0.5 * (j0 - v) * (j0 - v) / d)  # of a row: exp(-dv^2 / 2 d),
    climb = math.exp(-(j0 - v + 0.5) / d)  # by recurrence: no exp in the loops
    i0, i1, t, first, second, begun = 0, 0, 0.0, 0.0, 0.0, False
    m0 = mu = mv = muu = muv = mvv = 0.0
    rows, columns = field.directory.shape
    for j in range(j0, j1 + 1):
        dv = j - v
        shift = lean * dv
        if j == j0 or lean != 0.0:
            i0, i1 = math.ceil(u + shift - wide), math.floor(u + shift + wide)
            begun = False
        row = (j >> SHIFT) - field.corner[1]
        left, right = 0, -1  # the columns of blocks that live
        if 0 <= row < rows:
            left = max((i0 >> SHIFT) - field.corner[0], 0)
            right = min((i1 >> SHIFT) - field.corner[0], columns - 1)
            while left <= right and field.directory[row, left] < 0:
                left += 1
        if left <= right:
            if not begun:
                t, begun = i0 - u - shift, True
                first, second = math.exp(-0.5 * pa * t * t), math.exp(-pa * (t + 0.5))
            s0 = s1 = s2 = 0.0
            offset, kernel, ratio = t, first, second
            i = i0
            for column in range(left, right + 1):
                start = max((column + field.corner[0]) << SHIFT, i0)
                end = min((column + field.corner[0] + 1) << SHIFT, i1 + 1)
                slot = field.directory[row, column]
                if slot < 0:
                    continue
                while i < start:
                    kernel *= ratio
                    ratio *= falling
                    offset += 1.0
                    i += 1
                while i < end:
                    y = field.y[slot, j & MASK, i & MASK]
                    value = activity(field, short_term, slot, j & MASK, i & MASK)
                    value -= closed * y * (1.0 - y)
                    if opposite(faced, field.facing[slot, j & MASK, i & MASK]):
                        value = 0.0
                    value *= kernel
                    s0 += value
                    value *= offset
                    s1 += value
                    s2 += value * offset
                    kernel *= ratio
                    ratio *= falling
                    offset += 1.0
                    i += 1
            s2 = weight * (s2 + shift * (2.0 * s1 + shift * s0))
            s1 = weight * (s1 + shift * s0)
            s0 *= weight
            m0 += s0
            mu += s1
            mv += s0 * dv
            muu += s2
            muv += s1 * dv
            mvv += s0 * dv * dv
        weight *= climb
        climb *= slowing
    return (
        norm * m0,
        norm * (pa * mu + pb * mv),
        norm * (pb * mu + pd * mv),
        norm * (pa * m0 - (pa * pa * muu + 2.0 * pa * pb * muv + pb * pb * mvv)),
        norm * (pb * m0 - (pa * pb * muu + (pa * pd + pb * pb) * muv + pb * pd * mvv)),
        norm * (pd * m0 - (pb * pb * muu + 2.0 * pb * pd * muv + pd * pd * mvv)),
    )


@inner
def _positive_part(a: float, b: float, d: float) -> tuple[float, float, float]:
    """[[a, b], [b, d]] without its eigenvectors of a negative eigenvalue."""
    mean, half = 0.5 * (a + d), 0.5 * (a - d)
    radius = math.sqrt(half * half + b * b)
    low, high = mean - radius, mean + radius
    if high <= 0.0:
        return 0.0, 0.0, 0.0
    if low < 0.0:
        keep = high / (2.0 * radius)
        return keep * (half + radius), keep * b, keep * (radius - half)
    return a, b, d


@uncounted
def evaluate(  # noqa: PLR0913 (kernel)
    cells: Cells,
    reward: Reward,
    seen: Seen,
    pose: Float,
    gradient: Float,
    along: Float,
    information: Float,
) -> tuple[float, float, float]:
    """``evaluated`` on a map."""
    field = Field(cells.directory, cells.corner, cells.x, cells.y, cells.facing)
    return evaluated(field, reward, seen, pose, gradient, along, information)


@inner
def evaluated(  # noqa: PLR0913, PLR0915 (kernel)
    field: Field,
    reward: Reward,
    seen: Seen,
    pose: Float,
    gradient: Float,
    along: Float,
    information: Float,
) -> tuple[float, float, float]:
    """Sum of rewards of the observations seen from ``pose``, the weight of those matched, and that
    of those unmatched without weight.

    Fills the gradient (3,) by (x, y, theta), the part of it ``along`` the observed surfaces, and
    the information (3, 3): the negative curvature, of each observation only where it is positive,
    so that Newton's step goes uphill.
    """
    gradient[:] = 0.0
    along[:] = 0.0
    information[:] = 0.0
    score, matched, absent = 0.0, 0.0, 0.0
    scale = 1.0 / reward.cell
    c, s = math.cos(pose[2]), math.sin(pose[2])
    # most observations have the covariance of the one before
    alike, bell = (1.0, 0.0, 1.0), _bell(1.0, 0.0, 1.0, reward.tail, reward.tail_cells)
    for k in range(len(seen.points)):
        rx = c * seen.points[k, 0] - s * seen.points[k, 1]
        ry = s * seen.points[k, 0] + c * seen.points[k, 1]
        xx, xy, yy = seen.covariances[k, 0], seen.covariances[k, 1], seen.covariances[k, 2]
        a, b, d = rotate(c, s, xx, xy, yy)
        a, b, d = a * scale * scale, b * scale * scale, d * scale * scale
        if a != alike[0] or b != alike[1] or d != alike[2]:
            alike, bell = (a, b, d), _bell(a, b, d, reward.tail, reward.tail_cells)
        u, v = (rx + pose[0]) * scale - 0.5, (ry + pose[1]) * scale - 0.5
        weight = seen.weights[k]
        closed = reward.young_trace * (1.0 - weight)
        faced = turned_face(seen.facings[k], pose[2])
        f, gx, gy, a, b, d = _overlap(field, reward.short_term * weight, closed, u, v, bell, faced)
        if f > reward.matched_overlap:
            matched += seen.shares[k]
        else:
            absent += seen.shares[k] * (1.0 - weight)
        gx, gy = gx * scale, gy * scale
        a, b, d = a * scale * scale, b * scale * scale, d * scale * scale
        if reward.logarithm:
            inverse = 1.0 / (reward.log_floor + f)
            score += seen.shares[k] * math.log(reward.log_floor + f)
            gx, gy = gx * inverse, gy * inverse
            a, b, d = a * inverse + gx * gx, b * inverse + gx * gy, d * inverse + gy * gy
        else:
            score += seen.shares[k] * f
        a, b, d = _positive_part(a, b, d)
        w = seen.shares[k]
        gx, gy, a, b, d = w * gx, w * gy, w * a, w * b, w * d
        gradient[0] += gx
        gradient[1] += gy
        gradient[2] += gy * rx - gx * ry
        tx = c * seen.tangents[k, 0] - s * seen.tangents[k, 1]
        ty = s * seen.tangents[k, 0] + c * seen.tangents[k, 1]
        slope = gx * tx + gy * ty
        along[0] += slope * tx
        along[1] += slope * ty
        along[2] += slope * (ty * rx - tx * ry)
        information[0, 0] += a
        information[0, 1] += b
        information[1, 1] += d
        information[0, 2] += b * rx - a * ry
        information[1, 2] += d * rx - b * ry
        information[2, 2] += a * ry * ry - 2.0 * b * rx * ry + d * rx * rx
    information[1, 0] = information[0, 1]
    information[2, 0] = information[0, 2]
    information[2, 1] = information[1, 2]
    return score, matched, absent

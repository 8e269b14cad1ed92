# SPDX-License-Identifier: Apache-2.0
"""Which hits of a scan lie on one surface, and which on none."""

import math

from slam._jit import inner
from slam.arrays import Bools, Bytes, Float, Ints
from slam.frontend.polar import bin_of

NEAR_CELLS = 3.0  # cells; neighbouring hits this near are of one surface; set by hand
LONGEST_M = 1.0  # m, longest stretch between two joined hits; set by hand
LINE_HITS = 4  # hits on one line: a surface between distant hits; set by hand
LOST_BEAMS = 1  # beams, most without a valid return between two hits of one surface; set by hand
LIKE_STEPS = 4.0  # ratio of neighbouring steps along a surface, at most; set by hand
SLACK_M = 0.04  # m; a hit may lie this far off its line, along the beam; set by hand
SLACK = 0.15  # the same as a share of the step: the larger of both holds; set by hand
FACE_M = 0.1  # m; a facing is averaged over it, each way, as hits are closer than their noise
OPPOSITE_DEG = 135.0  # surfaces turned by more face away from each other; set by hand
MIXED_M = 1.5  # m; surfaces farther apart are ranged apart; set by hand
# directions distinguished; a facing is FACES_SEEN | direction, 0: unknown
FACES, FACES_SEEN = 128, 0x80
AWAY = int(FACES * OPPOSITE_DEG / 360.0)


@inner
def _one_line(points: Float, beams: Ints, first: int, x: float, y: float) -> bool:
    """True where hits ``first`` .. ``first + 3`` lie as on one straight surface seen from (x, y).

    They must come from neighbouring beams, go one way, and the inner two lie where their beams cut
    the line through the outer two.
    """
    last = first + LINE_HITS - 1
    if beams[last] != beams[first] + LINE_HITS - 1:
        return False
    ax, ay = points[first, 0] - x, points[first, 1] - y
    ex, ey = points[last, 0] - points[first, 0], points[last, 1] - points[first, 1]
    before = 0.0
    for k in range(first, last):
        dx, dy = points[k + 1, 0] - points[k, 0], points[k + 1, 1] - points[k, 1]
        step = math.sqrt(dx * dx + dy * dy)
        if dx * ex + dy * ey <= 0.0 or step > LONGEST_M:
            return False
        if k > first and not before < LIKE_STEPS * step < LIKE_STEPS * LIKE_STEPS * before:
            return False
        before = step
    slack = max(SLACK_M, SLACK * math.sqrt(ex * ex + ey * ey) / (LINE_HITS - 1))
    for k in range(first + 1, last):
        bx, by = points[k, 0] - x, points[k, 1] - y
        cross = bx * ey - by * ex
        if cross == 0.0:
            return False
        share = (ax * ey - ay * ex) / cross  # the line cuts the beam at this share of its range
        if abs(share - 1.0) * math.sqrt(bx * bx + by * by) > slack:
            return False
    return True


@inner
def join(
    points: Float, beams: Ints, origin: Float, near: float, out: Bools, tangents: Float
) -> None:
    """Mark the points whose surface goes on to the next one; fill the tangents.

    Hits of neighbouring beams (of index ``beams``, from a laser at ``origin``) are joined when they
    are within ``near`` m, or when the stretch between them is part of a run of four hits on
    one line. Less evidence will not do: two table legs and the wall behind them often are in line.
    """
    n = len(points)
    out[:] = False
    for k in range(n - 1):
        if beams[k + 1] != beams[k] + 1:
            continue
        dx, dy = points[k + 1, 0] - points[k, 0], points[k + 1, 1] - points[k, 1]
        if dx * dx + dy * dy <= near * near:
            out[k] = True
    for k in range(n - LINE_HITS + 1):
        if not (out[k] and out[k + 1] and out[k + 2]) and _one_line(
            points, beams, k, origin[0], origin[1]
        ):
            out[k], out[k + 1], out[k + 2] = True, True, True
    for k in range(n):
        tangents[k] = 0.0
        if k > 0 and out[k - 1] and out[k]:
            dx, dy = points[k + 1, 0] - points[k - 1, 0], points[k + 1, 1] - points[k - 1, 1]
            d = math.sqrt(dx * dx + dy * dy)
            if d > 0.0:
                tangents[k, 0], tangents[k, 1] = dx / d, dy / d


@inner
def follow_ends(
    points: Float,
    beams: Ints,
    origin: Float,
    joined: Bools,
    sweep: tuple[float, int, float],
    tangents: Float,
) -> None:
    """Fill the tangents where a surface is no longer seen, but need not end.

    An end is one only where the next valid beam, ``LOST_BEAMS`` on at most, sees past it, or where
    there is none and the next beam would meet the surface in range. Behind something nearer, beyond
    the range or the last beam the surface may go on, and its last hit says nothing along it: it
    moves with the robot.
    ``sweep``: rad between beams, how many there are, and the range (m) of their use.
    """
    n = len(points)
    for k in range(n):
        for way in (-1, 1):
            before, after = k - way, k + way
            if before < 0 or before >= n or not joined[min(k, before)]:
                continue
            if 0 <= after < n and joined[min(k, after)]:
                continue
            first = before  # far enough back for a direction
            while apart(points, first, k) < FACE_M:
                further = first - way
                if further < 0 or further >= n or not joined[min(first, further)]:
                    break
                first = further
            length = apart(points, first, k)
            if length < FACE_M:
                continue
            tx, ty = (points[k, 0] - points[first, 0]) / length, points[k, 1] - points[first, 1]
            ty /= length
            gone = beams[k] - beams[before]  # the way that the beams go
            beam = beams[k] + (1 if gone > 0 else -1)
            on = abs(beams[after] - beams[k]) if 0 <= after < n else 0
            near = 0 < on <= 1 + LOST_BEAMS
            ahead = _onward(points, k, origin, tx, ty, sweep[0] * (on if near else 1))
            if near:
                seen = _range(points, after, origin)
                slack = max(SLACK_M, SLACK * (ahead - _range(points, k, origin)))
                ends = seen > ahead + slack
            else:
                ends = 0 <= beam < sweep[1] and ahead < sweep[2]
            if not ends:
                tangents[k, 0], tangents[k, 1] = tx, ty


@inner
def _onward(
    points: Float, k: int, origin: Float, tx: float, ty: float,
    increment: float
) -> float:  # fmt: skip
    """Range (m) at which a beam meets the line through hit ``k`` along (tx, ty); inf: never.

    The one that is turned by ``increment`` to the side to which (tx, ty) leads.
    """
    x, y = points[k, 0] - origin[0], points[k, 1] - origin[1]
    turn = abs(increment) if x * ty - y * tx > 0.0 else -abs(increment)
    c, s = math.cos(turn), math.sin(turn)
    bx, by = c * x - s * y, s * x + c * y
    cross = bx * ty - by * tx
    share = (x * ty - y * tx) / cross if cross != 0.0 else -1.0
    return share * math.sqrt(x * x + y * y) if share > 0.0 else math.inf


@inner
def face(points: Float, origin: Float, joined: Bools, out: Bytes) -> None:
    """The way the surface under each hit faces, in robot axes; 0 for a hit joined to none."""
    n = len(points)
    for k in range(n):
        first, last = k, k
        while first > 0 and joined[first - 1] and apart(points, first, k) < FACE_M:
            first -= 1
        while last < n - 1 and joined[last] and apart(points, last, k) < FACE_M:
            last += 1
        out[k] = 0
        if first == last:
            continue
        nx, ny = points[last, 1] - points[first, 1], points[first, 0] - points[last, 0]
        bx, by = origin[0] - points[k, 0], origin[1] - points[k, 1]
        if nx * bx + ny * by < 0.0:
            nx, ny = -nx, -ny
        out[k] = FACES_SEEN | (bin_of(nx, ny, math.tau / FACES, 0.5) % FACES)


@inner
def turned_face(facing: int, theta: float) -> int:
    """A facing in axes turned by -theta."""
    if facing == 0:
        return 0
    return FACES_SEEN | ((int(facing) + math.floor(theta / math.tau * FACES + 0.5)) % FACES)


@inner
def opposite(one: int, other: int) -> bool:
    """Whether two surfaces face away from each other, by more than 135 degrees; unknown: no.

    The two faces of a thin wall are closer to each other than a wrong heading moves them.
    """
    if one == 0 or other == 0:
        return False
    apart = (int(one) - int(other)) & (FACES - 1)
    return AWAY < apart < FACES - AWAY


@inner
def apart(points: Float, j: int, k: int) -> float:
    """m, between two of the points."""
    dx, dy = points[j, 0] - points[k, 0], points[j, 1] - points[k, 1]
    return math.sqrt(dx * dx + dy * dy)


@inner
def unmixed(
    points: Float,
    beams: Ints,
    origin: Float,
    joined: Bools,
    out: Bytes,
) -> int:
    """Mark the hits that are no mixed pixel, and count them.

    A spot that lies half on an edge and half on what is behind is ranged somewhere between: between
    its neighbours' ranges, and joined to neither of them.
    """
    n, count = len(points), 0
    for k in range(n):
        out[k] = True
        inside = 0 < k < n - 1 and beams[k - 1] == beams[k] - 1 and beams[k + 1] == beams[k] + 1
        if inside and not joined[k - 1] and not joined[k]:
            before, here = _range(points, k - 1, origin), _range(points, k, origin)
            after = _range(points, k + 1, origin)
            between = before < here < after or before > here > after
            out[k] = abs(after - before) > MIXED_M or not between
        if out[k]:
            count += 1
    return count


@inner
def _range(points: Float, k: int, origin: Float) -> float:
    dx, dy = points[k, 0] - origin[0], points[k, 1] - origin[1]
    return math.sqrt(dx * dx + dy * dy)

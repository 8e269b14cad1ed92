# SPDX-License-Identifier: Apache-2.0
"""What earlier scans say about the places of present returns, and the other way round."""

import math
from typing import NamedTuple

from slam._jit import inlined, inner, uncounted
from slam.arrays import Bools, Float, Ints
from slam.frontend.polar import BEARING_OFF, bearing, bin_of
from slam.frontend.surfaces import apart


class Asking(NamedTuple):
    """How places are compared with the free ranges of a scan; the others as in ``StandingConfig``.

    step         rad between bins
    margin       m that all beams within ``spread`` rad of a place went on beyond it
    sure         share of that emptiness that is believed
    """

    step: float
    margin: float
    spread: float
    sure: float
    settled_s: float
    left_m: float
    along_m: float
    thin_m: float


@inner
def _wrapped(k: int, bins: int) -> int:
    """k % bins, of one that lies at most once round from it: a division takes longer than a bin."""
    if k < 0:
        return k + bins
    return k - bins if k >= bins else k


@inner
def _bin(turns: float, of: Asking, x: float, y: float, shift: float) -> int:
    """``bin_of`` (x, y), whose bearing is so many bins round."""
    k, slack = math.floor(turns + shift), BEARING_OFF / of.step
    if slack < turns + shift - k < 1.0 - slack:
        return k
    return math.floor(math.atan2(y, x) / of.step + shift)


@inlined
def _passed(limit: Float, of: Asking, x: float, y: float, r: float, turns: float) -> bool:
    """Whether all beams within the spread went on beyond (x, y) (laser axes) by the margin.

    ``r`` m away, and so many bins round by ``bearing``.
    """
    end = r + of.margin
    bins, wide = len(limit), of.spread / of.step
    # most did not: the middle one shows it
    if wide >= 1.1 and limit[_wrapped(_bin(turns, of, x, y, 0.5), bins)] < end:
        return False
    first, last = _bin(turns, of, x, y, 0.5 - wide), _bin(turns, of, x, y, 0.5 + wide)
    k = first % bins
    for _ in range(last + 1 - first):
        if limit[k] < end:
            return False
        k = k + 1 if k + 1 < bins else 0
    return True


@inlined
def _in_view(limit: Float, of: Asking, r: float, turns: float) -> bool:
    """Whether nothing hid a place ``r`` m away, and a beam came that way.

    The widest of three bins: at a wall that is seen at a grazing angle each falls short of it.
    """
    bins, end = len(limit), r - of.margin
    k = math.floor(turns + 0.5)
    for b in (k - 1, k, k + 1):
        free = limit[_wrapped(b, bins)]
        if free > 0.0 and end < free:
            return True
    return False


@inner
def _polar(
    points: Float, seen_from: tuple[float, float, float, float],
    laser: Float, step: float, polar: Float,
) -> None:  # fmt: skip
    """Where points are about a laser: ``polar`` (4, at least n) x, y, distance, and how many bins
    round by ``bearing``. In a loop of its own, which takes several at once.

    ``seen_from`` a pose: its place, cosine and sine
    """
    px, py, c, s = seen_from
    lx, ly, lc, ls = laser[0], laser[1], math.cos(laser[2]), math.sin(laser[2])
    xs, ys, reach, around = polar[0], polar[1], polar[2], polar[3]
    for k in range(len(points)):
        x = c * points[k, 0] - s * points[k, 1] + px
        y = s * points[k, 0] + c * points[k, 1] + py
        dx, dy = x - lx, y - ly
        u, v = lc * dx + ls * dy, lc * dy - ls * dx
        xs[k], ys[k] = u, v
        reach[k], around[k] = math.sqrt(u * u + v * v), bearing(u, v) / step


@inner
def _emptied(  # noqa: PLR0913 (kernel)
    points: Float,
    pose: Float,
    lasers: Float,
    limits: Float,
    ages: Float,
    of: Asking,
    recent: int,
    polar: Float,
    seen: Float,
    out: Float,
) -> int:
    """Age of the newest scan that saw the place of each point (robot frame) empty, else inf.

    Returns the number of points whose places any of them had in view.

    lasers  (J, 3) in the map, ``limits`` (J, bins) free ranges as in ``View``, newest first, of
    which the first few, ``recent``, are asked; ``polar``, ``seen``: room to work in
    """
    n, in_view = len(points), 0
    seen_from = (pose[0], pose[1], math.cos(pose[2]), math.sin(pose[2]))
    for k in range(n):
        out[k], seen[k] = math.inf, 0.0
    for j in range(recent):
        _polar(points, seen_from, lasers[j], of.step, polar)
        for k in range(n):
            if out[k] < math.inf:
                continue
            r, turns = polar[2, k], polar[3, k]
            if seen[k] == 0.0 and _in_view(limits[j], of, r, turns):
                seen[k] = 1.0
                in_view += 1
            if _passed(limits[j], of, polar[0, k], polar[1, k], r, turns):
                out[k] = ages[j]
    return in_view


@inner
def _indexed(points: Float, T_robot_laser: Float, step: float, first: Ints, last: Ints) -> None:
    """First and last point (robot frame, in order of bearing) of each bin about the laser; -1."""
    c, s = math.cos(T_robot_laser[2]), math.sin(T_robot_laser[2])
    bins = len(first)
    for b in range(bins):
        first[b] = last[b] = -1
    for k in range(len(points)):
        dx, dy = points[k, 0] - T_robot_laser[0], points[k, 1] - T_robot_laser[1]
        b = bin_of(c * dx + s * dy, c * dy - s * dx, step, 0.5) % bins
        if first[b] < 0:
            first[b] = k
        last[b] = k


@inner
def _left(  # noqa: PLR0913 (kernel)
    before: Float,
    age: float,
    points: Float,
    T_map_laser: Float,
    T_robot_laser: Float,
    limit: Float,
    of: Asking,
    first: Ints,
    last: Ints,
    polar: Float,
    out: Float,
) -> None:
    """Lower ``out`` to ``age`` for points within ``left_m`` of a place that was left.

    before  (m, 2) points of an earlier scan, map frame; left if present beams pass them
    points  (n, 2) present ones, robot frame, by bin ``first`` to ``last`` (see ``indexed``)
    limit   (bins,) free ranges of the present scan
    """
    near = of.left_m
    bins = len(limit)
    lc, ls = math.cos(T_robot_laser[2]), math.sin(T_robot_laser[2])
    _polar(before, (0.0, 0.0, 1.0, 0.0), T_map_laser, of.step, polar)
    for i in range(len(before)):
        u, v, r, around = polar[0, i], polar[1, i], polar[2, i], polar[3, i]
        if not _passed(limit, of, u, v, r, around):
            continue
        x, y = lc * u - ls * v + T_robot_laser[0], ls * u + lc * v + T_robot_laser[1]
        middle = _bin(around, of, u, v, 0.5)
        # 1.6 > pi / 2: asin(q) is below 1.6 q for q in [0, 1]
        wide = math.floor(min(near / max(r, near), 1.0) * 1.6 / of.step) + 1
        for b in range(middle - wide, middle + wide + 1):
            at = _wrapped(b, bins)
            if first[at] < 0:
                continue
            for k in range(first[at], last[at] + 1):
                ex, ey = points[k, 0] - x, points[k, 1] - y
                if ex * ex + ey * ey < near * near:
                    out[k] = min(out[k], age)


@inner
def _along(  # noqa: PLR0913 (kernel)
    points: Float, joined: Bools, votes: Float, reach: float, thin: float, before: Float, out: Float
) -> None:
    """Mean of ``votes`` along the surface of each point, up to ``reach`` m each way.

    1 where that stretch is shorter than ``thin`` m: earlier beams may have gone by such a thing.
    ``before`` (n + 1,): room for the sums of the votes before each point.
    """
    n = len(points)
    before[0] = 0.0
    for k in range(n):
        before[k + 1] = before[k] + votes[k]
    first, last = 0, 0
    for k in range(n):
        if k > 0 and not joined[k - 1]:
            first = k
        while apart(points, first, k) >= reach:
            first += 1
        last = max(last, k)
        while last + 1 < n and joined[last] and apart(points, k, last + 1) < reach:
            last += 1
        if apart(points, first, last) >= thin:
            out[k] = min((before[last + 1] - before[first]) / (last + 1 - first), 1.0)
        else:
            out[k] = 1.0


@uncounted
def placed(points: Float, pose: Float, out: Float) -> None:
    """``out`` (n, 2): points of the robot frame in the map."""
    c, s = math.cos(pose[2]), math.sin(pose[2])
    for k in range(len(points)):
        x, y = points[k, 0], points[k, 1]
        out[k, 0], out[k, 1] = c * x - s * y + pose[0], s * x + c * y + pose[1]


@uncounted
def votes(  # noqa: PLR0913 (kernel)
    points: Float,
    joined: Bools,
    limit: Float,
    pose: Float,
    T_map_laser: Float,
    T_robot_laser: Float,
    lasers: Float,
    limits: Float,
    ages: Float,
    before: Float,
    counts: Ints,
    asked: tuple[int, float, float],
    plain: tuple[float, float, float, float, float, float, float, float],
    scratch: Float,
    bins: Ints,
    out: Float,
) -> float:
    """Fill ``out`` (n,) with the vote of each of the points (robot frame), see ``Standing``.

    Returns the share of the points whose places any of the scans asked had in view.

    limit   (bins,) free ranges of the present scan, seen from ``T_map_laser``
    lasers, limits, ages  of the scans asked, newest first, see ``_emptied``
    before  (J, w, 2) points in the map of each scan, of which it has ``counts`` (J,)
    asked   how many scans; s up to which they may have seen a place empty, and things left one
    plain   numbers of ``Asking``
    scratch (6, at least n + 1, and points of any scan before), bins (2, bins): room to work in
    """
    n = len(points)
    of = Asking(
        plain[0], plain[1], plain[2], plain[3], plain[4], plain[5], plain[6], plain[7]
    )  # as a named tuple it would take longer to get here
    stood, own, polar, first, last = scratch[0], scratch[1], scratch[2:], bins[0], bins[1]
    recent, lately = 0, 0  # the first ones: ages rise
    while recent < asked[0] and ages[recent] <= asked[1]:
        recent += 1
    while lately < asked[0] and ages[lately] <= asked[2]:
        lately += 1
    in_view = _emptied(points, pose, lasers, limits, ages, of, recent, polar, own, stood)
    _indexed(points, T_robot_laser, of.step, first, last)
    for j in range(lately):
        _left(
            before[j, : counts[j]], ages[j], points, T_map_laser, T_robot_laser, limit, of,
            first, last, polar, stood,
        )  # fmt: skip
    for k in range(n):
        ratio = of.settled_s / max(stood[k], 1e-300)
        own[k] = 1.0 - of.sure * (1.0 - 1.0 / (1.0 + ratio * ratio))
    _along(points, joined, own, of.along_m, of.thin_m, scratch[2], out)
    return in_view / n

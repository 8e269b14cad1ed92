# SPDX-License-Identifier: Apache-2.0
"""What earlier scans say about the places of present returns, and the other way round."""

import math
from typing import Any, NamedTuple

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
    came_s: float
    left_s: float
    left_m: float
    along_m: float
    thin_m: float


class Present(NamedTuple):
    """The scan of now: ``points`` (n, 2) in the robot frame, ``joined`` (n,), ``limit`` (bins,) as
    in ``View``; where robot and laser are.
    """

    points: Float
    joined: Bools
    limit: Float
    T_map_robot: Float
    T_map_laser: Float
    T_robot_laser: Float


class Asked(NamedTuple):
    """The scans that are asked, newest first.

    lasers  (J, 3) in the map; ``limits`` (J, bins) free ranges as in ``View``; ``ages`` (J,) s
    points  of all scans, in the map, up to ``ends`` (J,) of each
    """

    lasers: Float
    limits: Float
    ages: Float
    points: Float
    ends: Ints


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
def _emptied(now: Present, asked: Asked, of: Asking, polar: Float, seen: Float, out: Float) -> int:
    """Age of the newest scan that saw the place of each point empty, else inf.

    Returns the number of points whose places any of them had in view. ``polar``, ``seen``: room to
    work in.
    """
    n, in_view, pose = len(now.points), 0, now.T_map_robot
    seen_from = (pose[0], pose[1], math.cos(pose[2]), math.sin(pose[2]))
    for k in range(n):
        out[k], seen[k] = math.inf, 0.0
    for j in range(len(asked.ages)):
        if asked.ages[j] > of.came_s:
            break  # ages rise
        _polar(now.points, seen_from, asked.lasers[j], of.step, polar)
        for k in range(n):
            if out[k] < math.inf:
                continue
            r, turns = polar[2, k], polar[3, k]
            if seen[k] == 0.0 and _in_view(asked.limits[j], of, r, turns):
                seen[k] = 1.0
                in_view += 1
            if _passed(asked.limits[j], of, polar[0, k], polar[1, k], r, turns):
                out[k] = asked.ages[j]
    return in_view


@inner
def _indexed(now: Present, step: float, bins: Ints) -> None:
    """First and last point (in order of bearing) of each of ``bins`` about the laser; -1."""
    c, s = math.cos(now.T_robot_laser[2]), math.sin(now.T_robot_laser[2])
    n = bins.shape[1]
    for b in range(n):
        bins[0, b] = bins[1, b] = -1
    for k in range(len(now.points)):
        dx, dy = now.points[k, 0] - now.T_robot_laser[0], now.points[k, 1] - now.T_robot_laser[1]
        b = bin_of(c * dx + s * dy, c * dy - s * dx, step, 0.5) % n
        if bins[0, b] < 0:
            bins[0, b] = k
        bins[1, b] = k


@inner
def _left(  # noqa: PLR0913 (kernel)
    before: Float, age: float, now: Present, of: Asking, bins: Ints, polar: Float, out: Float
) -> None:
    """Lower ``out`` to ``age`` for points within ``left_m`` of a place that was left.

    before  (m, 2) points of an earlier scan, map frame; left if present beams pass them
    bins    (2, bins) first and last point of each, see ``_indexed``
    """
    near, points, laser = of.left_m, now.points, now.T_robot_laser
    lc, ls = math.cos(laser[2]), math.sin(laser[2])
    _polar(before, (0.0, 0.0, 1.0, 0.0), now.T_map_laser, of.step, polar)
    for i in range(len(before)):
        u, v, r, around = polar[0, i], polar[1, i], polar[2, i], polar[3, i]
        if not _passed(now.limit, of, u, v, r, around):
            continue
        x, y = lc * u - ls * v + laser[0], ls * u + lc * v + laser[1]
        middle = _bin(around, of, u, v, 0.5)
        # 1.6 > pi / 2: asin(q) is below 1.6 q for q in [0, 1]
        wide = math.floor(min(near / max(r, near), 1.0) * 1.6 / of.step) + 1
        for b in range(middle - wide, middle + wide + 1):
            at = _wrapped(b, bins.shape[1])
            if bins[0, at] < 0:
                continue
            for k in range(bins[0, at], bins[1, at] + 1):
                ex, ey = points[k, 0] - x, points[k, 1] - y
                if ex * ex + ey * ey < near * near:
                    out[k] = min(out[k], age)


@inner
def _along(now: Present, of: Asking, weights: Float, before: Float, out: Float) -> None:
    """Mean of ``weights`` along the surface of each point, up to ``along_m`` each way.

    1 where that stretch is shorter than ``thin_m``: earlier beams may have gone by such a thing.
    ``before`` (n + 1,): room for the sums of the weights before each point.
    """
    points, joined, n = now.points, now.joined, len(now.points)
    before[0] = 0.0
    for k in range(n):
        before[k + 1] = before[k] + weights[k]
    first, last = 0, 0
    for k in range(n):
        if k > 0 and not joined[k - 1]:
            first = k
        while apart(points, first, k) >= of.along_m:
            first += 1
        last = max(last, k)
        while last + 1 < n and joined[last] and apart(points, k, last + 1) < of.along_m:
            last += 1
        if apart(points, first, last) >= of.thin_m:
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
def weigh(
    present: tuple[Any, ...], earlier: tuple[Any, ...], plain: tuple[Any, ...], scratch: Float,
    bins: Ints, out: Float,
) -> float:  # fmt: skip
    """Fill ``out`` (n,) with the weight of each point of ``Present``, see ``Standing``.

    Returns the share of the points whose places any of the scans asked had in view. ``earlier``
    of ``Asked``, ``plain`` of ``Asking``; ``scratch`` (6, at least n + 1, and points of any scan
    before) and ``bins`` (2, bins): room to work in.
    """
    now, asked, of = Present(*present), Asked(*earlier), Asking(*plain)
    n, stood, own, polar = len(now.points), scratch[0], scratch[1], scratch[2:]
    in_view = _emptied(now, asked, of, polar, own, stood)
    _indexed(now, of.step, bins)
    start = 0
    for j in range(len(asked.ages)):
        if asked.ages[j] <= of.left_s:
            before = asked.points[start : asked.ends[j]]
            _left(before, asked.ages[j], now, of, bins, polar, stood)
        start = asked.ends[j]
    for k in range(n):
        ratio = of.settled_s / max(stood[k], 1e-300)
        own[k] = 1.0 - of.sure * (1.0 - 1.0 / (1.0 + ratio * ratio))
    _along(now, of, own, scratch[2], out)
    return in_view / n

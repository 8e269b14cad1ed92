# SPDX-License-Identifier: Apache-2.0
"""How far the map is off where the robot is, by all that its loops say.

Driving on, the map's error only grows. A robot that is back where it was is off by no more than it
was there the first time, and by what the closure between the two may be off. Of what is known on
both ways the less counts: their errors are not independent. What the pose graph denies of the map
that is still in use is an error of that map.
"""

import math
from collections.abc import Mapping, Sequence
from typing import TypeAlias

import numpy as np

from slam import se2
from slam.arrays import Float
from slam.frontend.odometry_prior import rotated
from slam.posegraph import Edge, Pose
from slam.tracker.tracking.keys import KeyFrame
from slam.tracker.uncertainty.covariances import whole

UPPER = [0, 1, 2, 4, 5, 8]  # of (3, 3), row by row
LEVER_M = 5.0  # an error of the heading counts as what it does to a place so far away

Upper: TypeAlias = tuple[float, float, float, float, float, float]  # of (3, 3), row by row


def map_errors(
    keys: Sequence[KeyFrame],
    graph: Sequence[Float],
    closures: Mapping[tuple[int, int], Edge],
    slack: Float,
    found: Float,
) -> Float:
    """(n, 3, 3) of each key frame: what its pose in the map is off, in the map frame.

    graph     poses (3,) of the key frames by the pose graph
    closures  by their key frames
    slack     (3, 3) that the covariances of steps have too much
    found     (3, 3) by which a robot that was doubted for a while is off in the map afterwards

    In plain numbers: arrays of three take ten times as long.
    """
    ending: dict[int, list[Edge]] = {}
    for pair, edge in sorted(closures.items()):
        ending.setdefault(max(pair), []).append(edge)
    poses: list[Pose] = np.array([key.T_map_robot for key in keys]).tolist()
    solved: list[Pose] = np.array(graph).tolist()
    steps = (np.array([key.covariance for key in keys]) - slack).reshape(-1, 9)[:, UPPER].tolist()
    errors: list[Upper] = [(0.0,) * 6]
    driven, T_map_graph = errors[0], _moved(poses[0], solved[0])
    known, elsewhere = 0, False  # the last key frame that the map took in; found elsewhere since
    for k in range(1, len(keys)):
        before, here = poses[k - 1], poses[k]
        step = _turned(steps[k], before[2])
        driven = _sum(_after(driven, before, here), step)
        torn = _off(here, _composed(T_map_graph, solved[k]))
        elsewhere = elsewhere or keys[k].found
        if keys[k].written:
            if known < k - 1 and not elsewhere:  # in the map again where motion led
                driven = _sum(_after(errors[known], poses[known], here), _upper(found))
            known, elsewhere = k, False
        best = _sum(driven, _square(torn))
        for edge in ending.get(k, ()):
            first = min(edge.a, edge.b)
            closed = _after(errors[first], poses[first], here)
            if _size(closed) >= _size(best):
                continue  # the closure only adds to it
            a, b = poses[edge.a], poses[edge.b]
            measured, own = edge.numbers
            off = _off(b, _composed(a, measured))  # what the map denies of it
            own = _sum(_turned(own, a[2]), _square(off))
            closed = _sum(closed, _after(own, b, here))
            if _size(closed) < _size(best):
                best = driven = closed
                T_map_graph = _moved(here, solved[k])
        errors.append(best)
    return whole(np.array(errors))


def _composed(T: Pose, pose: Pose) -> Pose:
    """``se2.compose``."""
    (ax, ay, at), (bx, by, bt) = T, pose
    c, s = math.cos(at), math.sin(at)
    return ax + c * bx - s * by, ay + s * bx + c * by, se2.wrap(at + bt)


def _moved(T_map_robot: Pose, T_graph_robot: Pose) -> Pose:
    return _composed(T_map_robot, tuple(se2.inverse(T_graph_robot).tolist()))


def _off(pose: Pose, other: Pose) -> Pose:
    """m, m, rad in the map."""
    return pose[0] - other[0], pose[1] - other[1], se2.wrap(pose[2] - other[2])


def _upper(covariance: Float) -> Upper:
    (a, b, c), (_, d, e), (_, _, f) = covariance.tolist()
    return a, b, c, d, e, f


def _sum(one: Upper, other: Upper) -> Upper:
    (a, b, c, d, e, f), (g, h, i, j, k, m) = one, other
    return a + g, b + h, c + i, d + j, e + k, f + m


def _square(off: Pose) -> Upper:
    """Outer product with itself."""
    x, y, t = off
    return x * x, x * y, x * t, y * y, y * t, t * t


def _turned(covariance: Upper, theta: float) -> Upper:
    """``odometry_prior.turned``."""
    c, s = math.cos(theta), math.sin(theta)
    xx, xy, xt, yy, yt, tt = covariance
    a, b, d = rotated(c, s, xx, xy, yy)
    return a, b, c * xt - s * yt, d, s * xt + c * yt, tt


def _after(covariance: Upper, before: Pose, after: Pose) -> Upper:
    """Of a pose after a known motion: ``covariances.carried``."""
    x, y = after[0] - before[0], after[1] - before[1]
    xx, xy, xt, yy, yt, tt = covariance
    e, f = xt - y * tt, yt + x * tt
    return xx - y * xt - y * e, xy - y * yt + x * e, e, yy + x * yt + x * f, f, tt


def _size(covariance: Upper) -> float:
    """One number, m^2, to compare them by."""
    return covariance[0] + covariance[3] + LEVER_M**2 * covariance[5]

# SPDX-License-Identifier: Apache-2.0
"""How far the map is off where the robot is, by all that its loops say.

Driving on, the map's error only grows. A robot that is back where it was is off by no more than it
was there the first time, and by what the closure between the two may be off. Of what is known on
both ways the less counts: their errors are not independent. What the pose graph denies of the map
that is still in use is an error of that map.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from slam import se2
from slam.frames import Float
from slam.frontend.odometry_prior import inverted, turned
from slam.posegraph import Edge
from slam.tracker.tracking.keys import KeyFrame
from slam.tracker.uncertainty.covariances import carried

LEVER_M = 5.0  # an error of the heading counts as what it does to a place so far away


def map_errors(
    keys: Sequence[KeyFrame],
    graph: Sequence[Float],
    closures: Mapping[tuple[int, int], Edge],
    slack: Float,
    found: Float,
) -> list[Float]:
    """(3, 3) of each key frame: what its pose in the map is off, in the map frame.

    graph     poses (3,) of the key frames by the pose graph
    closures  by their key frames
    slack     (3, 3) that the covariances of steps have too much
    found     (3, 3) by which a robot that was doubted for a while is off in the map afterwards
    """
    ending: dict[int, list[Edge]] = {}
    for pair, edge in sorted(closures.items()):
        ending.setdefault(max(pair), []).append(edge)
    errors: list[Float] = [np.zeros((3, 3))]
    driven, T_map_graph = errors[0], _moved(keys[0].T_map_robot, graph[0])
    known, elsewhere = 0, False  # the last key frame that the map took in; found elsewhere since
    for k in range(1, len(keys)):
        before, here = keys[k - 1].T_map_robot, keys[k].T_map_robot
        driven = _after(driven, before, here)
        driven = driven + turned(keys[k].covariance - slack, float(before[2]))
        torn = _off(here, se2.compose(T_map_graph, graph[k]))
        elsewhere = elsewhere or keys[k].found
        if keys[k].written:
            if known < k - 1 and not elsewhere:  # in the map again where motion led
                driven = _after(errors[known], keys[known].T_map_robot, here) + found
            known, elsewhere = k, False
        best = driven + np.outer(torn, torn)
        for edge in ending.get(k, ()):
            a, b = keys[edge.a].T_map_robot, keys[edge.b].T_map_robot
            off = _off(b, se2.compose(a, edge.T_a_b))  # what the map denies of it
            own = turned(inverted(edge.information), float(a[2])) + np.outer(off, off)
            first = min(edge.a, edge.b)
            closed = _after(errors[first], keys[first].T_map_robot, here) + _after(own, b, here)
            if _size(closed) < _size(best):
                best = driven = closed
                T_map_graph = _moved(here, graph[k])
        errors.append(best)
    return errors


def _moved(T_map_robot: Float, T_graph_robot: Float) -> Float:
    return se2.compose(T_map_robot, se2.inverse(T_graph_robot))


def _off(pose: Float, other: Float) -> Float:
    """(3,) m, m, rad in the map."""
    off: Float = pose - other
    off[2] = se2.wrap(float(off[2]))
    return off


def _after(covariance: Float, before: Float, after: Float) -> Float:
    """(3, 3) of a pose after a known motion."""
    out = np.empty((3, 3))
    carried(covariance, after - before, 0.0, 0.0, out)
    return out


def _size(covariance: Float) -> float:
    """One number, m^2, to compare them by."""
    return float(covariance[0, 0] + covariance[1, 1] + LEVER_M**2 * covariance[2, 2])

# SPDX-License-Identifier: Apache-2.0
"""Scores of a drive through Victoria Park: against GPS and the graph, and at loops."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from scripts.paper.runs import statistics
from slam import se2
from slam.frames import Float
from slam.logs.victoria_park import GpsTrack
from slam.trajectory import Trajectory

FIRST_M = 100.0  # the fixes up to here turn and move GPS into the map
FASTEST, SLACK_M, GIVE_UP_S = 8.0, 1.0, 5.0  # m/s: the truck drives 6.6 m/s at most
LOOP_NEAR_M, LOOP_FAR_M = 2.0, 100.0  # the graph is in one place again, after this way


def good_fixes(gps: GpsTrack) -> NDArray[np.bool_]:
    """The fixed rule for outliers: a fix the truck could have driven to from the last good one.

    After ``GIVE_UP_S`` without a good one the next is taken as good.
    """
    good = np.zeros(len(gps.points), dtype=np.bool_)
    last = -1
    for k, (stamp_ns, point) in enumerate(zip(gps.stamps_ns.tolist(), gps.points, strict=True)):
        if last >= 0:
            dt = (stamp_ns - int(gps.stamps_ns[last])) * 1e-9
            away = float(np.hypot(*(point - gps.points[last])))
            if dt < GIVE_UP_S and away > SLACK_M + FASTEST * dt:
                continue
        good[k], last = True, k
    return good


def at_fixes(track: Trajectory, gps: GpsTrack) -> Float:
    """(n, 2) positions of the laser at the fixes' times, linear between frames."""
    return np.stack(
        [np.interp(gps.stamps_ns, track.stamps_ns, track.poses[:, k]) for k in (0, 1)], axis=1
    )


def first_fit(track: Trajectory, gps: GpsTrack) -> Float:
    """T_gps_map from the good fixes of the first ``FIRST_M`` of this track's own way."""
    here = at_fixes(track, gps)
    steps = np.hypot(*np.diff(here, axis=0).T)
    first = good_fixes(gps) & (np.concatenate([[0.0], np.cumsum(steps)]) < FIRST_M)
    return se2.fit(here[first], gps.points[first])


def shape_fit(track: Trajectory, gps: GpsTrack) -> Float:
    """T_gps_map from all good fixes, those beyond three times the median left out."""
    here, good = at_fixes(track, gps), good_fixes(gps)
    T = se2.fit(here[good], gps.points[good])
    for _ in range(30):
        away = np.hypot(*(se2.transform(T, here) - gps.points).T)
        kept = good & (away < 3.0 * np.median(away[good]))
        T = se2.fit(here[kept], gps.points[kept])
    return T


def loops(track: Trajectory) -> list[tuple[int, int]]:
    """Pairs of frames at one place, a long way apart; one for each stretch of 10 m."""
    steps = np.hypot(*np.diff(track.poses[:, :2], axis=0).T)
    along = np.concatenate([[0.0], np.cumsum(steps)])
    chosen = [int(np.searchsorted(along, s)) for s in np.arange(0.0, along[-1], 10.0)]
    out = []
    for k in chosen:
        away = np.hypot(*(track.poses[:, :2] - track.poses[k, :2]).T)
        away[along > along[k] - LOOP_FAR_M] = np.inf
        if away.min() < LOOP_NEAR_M:
            out.append((int(away.argmin()), k))
    return out


def loop_errors(track: Trajectory, graph: Trajectory) -> Float:
    """(n,) m: motion from the earlier to the later frame of a loop, against the graph's."""
    errors = []
    for a, b in loops(graph):
        mine = se2.between(track.poses[a], track.poses[b])
        told = se2.between(graph.poses[a], graph.poses[b])
        errors.append(float(np.hypot(*(mine - told)[:2])))
    return np.array(errors)


def over_graph(track: Trajectory, graph: Trajectory, gps: GpsTrack) -> Float:
    """T_graph_map: both laid over GPS by their own first fixes."""
    return se2.compose(se2.inverse(first_fit(graph, gps)), first_fit(track, gps))


def headings_off(track: Trajectory, graph: Trajectory, gps: GpsTrack) -> Float:
    """(n,) rad: headings against the graph's, turned as the positions are."""
    turn = float(over_graph(track, graph, gps)[2])
    return se2.wrap_array(track.poses[:, 2] + turn - graph.poses[:, 2])


def pose_numbers(track: Trajectory, graph: Trajectory, gps: GpsTrack) -> dict[str, Any]:
    """Errors of a track against GPS and against the graph, by name: m and rad."""
    good, here = good_fixes(gps), at_fixes(track, gps)
    e = (se2.transform(first_fit(track, gps), here) - gps.points)[good]
    shape = (se2.transform(shape_fit(track, gps), here) - gps.points)[good]
    turned = headings_off(track, graph, gps)
    closed = loop_errors(track, graph)
    distance, shape_distance = np.hypot(*e.T), np.hypot(*shape.T)
    return {
        "rmse": float(np.sqrt((distance**2).mean())),
        "median": float(np.median(distance)),
        "p90": float(np.percentile(distance, 90)),
        "shape median": float(np.median(shape_distance)),
        "shape p90": float(np.percentile(shape_distance, 90)),
        "loops": len(closed),
        "loop median": float(np.median(closed)) if len(closed) else float("nan"),
        "loop worst": float(closed.max()) if len(closed) else float("nan"),
        **statistics(e, ("x", "y")),
        **statistics(turned[:, None], ("θ",)),
    }

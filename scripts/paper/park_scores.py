# SPDX-License-Identifier: Apache-2.0
"""Scores of a drive through Victoria Park: against GPS and the graph, at loops, and of landmarks.

Along 4 km a map bends away from the graph by metres, all trunks of a place together. That is an
error of poses, told by loops and by GPS; it deletes nothing. So landmarks are laid over the graph's
place by place: those within ``NEAR_M`` of the laser, by a rigid fit of their own.
"""

from collections.abc import Iterable, Sequence
from itertools import pairwise
from operator import itemgetter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scripts.paper.census import Census, paired
from scripts.paper.runs import Run, statistics
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
    steps = (
        [se2.between(one.poses[a], one.poses[b]) for one in (track, graph)] for a, b in loops(graph)
    )
    return np.array([float(np.hypot(*(mine - told)[:2])) for mine, told in steps])


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


GATE_M = 2.0  # between a landmark, so laid, and the graph's
NEAR_M = 30.0
CLOSING_M = (8.0, 6.0, 4.0, 3.0, GATE_M, GATE_M)  # gates of the rounds of a fit
FEWEST = 4  # pairs that say how a place lies


Laid = tuple[int, Float]
"""How many pairs agree, and T_graph_map: how a place lies over the graph."""
Place = tuple[Float, Float]
"""A stop on the way: where a SLAM thought to be (2,), and T_graph_map if it was right there."""


def near(points: Float, here: Float) -> NDArray[np.bool_]:
    """(n,) which are within ``NEAR_M`` of a place."""
    close: NDArray[np.bool_] = np.hypot(*(points - here).T) < NEAR_M
    return close


def lay(points: Float, trunks: Float, starts: Iterable[Float]) -> Laid:
    """The rigid fit in which the most are paired, from any of these T_graph_map."""
    best: Laid = (-1, np.zeros(3))
    for T in starts:
        for gate in CLOSING_M:
            rows, columns = paired(se2.transform(T, points), trunks, gate)
            if len(rows) < FEWEST:
                break
            T = se2.fit(points[rows], trunks[columns])
        pairs = len(paired(se2.transform(T, points), trunks, GATE_M)[0])
        if pairs > best[0]:
            best = pairs, T
    return best


def unbent(points: Float, trunks: Float, places: Sequence[Place]) -> Float:
    """(n, 2) a whole map over the graph: each landmark by the fit with the most pairs of all
    places near it. A place starts from the poses there, and from the fits of its neighbours on
    the way, since a map moves after it was made, where a loop closes."""
    fits: dict[int, Laid] = {}
    for order in (range(len(places)), range(len(places) - 1, -1, -1)):
        before: list[Float] = []
        for k in order:
            here, T_graph_map = places[k]
            own = points[near(points, here)]
            if len(own) >= FEWEST:
                known = fits.get(k, (0, T_graph_map))
                fits[k] = max(known, lay(own, trunks, [known[1], *before]), key=itemgetter(0))
                before = [fits[k][1]]
    moved = se2.transform(places[-1][1], points)
    most = np.full(len(points), -1)
    for k, (pairs, T) in fits.items():
        better = near(points, places[k][0]) & (most < pairs)
        moved[better] = se2.transform(T, points[better])
        most[better] = pairs
    return moved


def census_of(run: Run, trunks: Float, track: Trajectory, graph: Trajectory) -> Census:
    """What a map held at each stop, near it, and what it holds in the end."""
    census = Census(trunks)
    stops = run.arrays["stops"]
    pairs = zip(track.poses[stops], graph.poses[stops], strict=True)
    places = [(pose[:2], se2.compose(true, se2.inverse(pose))) for pose, true in pairs]
    ends = np.cumsum([0, *run.numbers["sizes"]]).tolist()
    before: list[Float] = []
    points, names = np.zeros((0, 2)), np.zeros(0, dtype=np.int64)
    for (here, T_graph_map), (a, b) in zip(places, pairwise(ends), strict=True):
        points, names = run.arrays["found"][a:b], run.arrays["names"][a:b]
        own = near(points, here)
        if own.sum() >= FEWEST:
            before = [lay(points[own], trunks, [T_graph_map, *before])[1]]
            census.take(se2.transform(before[0], points[own]), names[own], GATE_M)
    census.take(unbent(points, trunks, places), names, GATE_M)
    return census


def landmark_numbers(
    run: Run, graph: Run, track: Trajectory, graph_track: Trajectory, gps: GpsTrack
) -> dict[str, Any]:
    """Counts; errors of the landmarks so paired, in the frame of the positions' errors."""
    out = {"ms": run.numbers["ms"], "not converged": run.numbers["not converged"]}
    if not run.numbers["sizes"]:
        return out
    trunks = in_reach(graph.arrays["found"], graph_track)
    census = census_of(run, trunks, track, graph_track)
    rows, columns = census.pairs
    points = run.arrays["found"][len(run.arrays["found"]) - run.numbers["sizes"][-1] :]
    T = over_graph(track, graph_track, gps)
    census.errors = se2.transform(T, points[rows]) - trunks[columns]
    return out | census.numbers() | {"landmarks": len(points), "trunks": len(trunks)}


def in_reach(landmarks: Float, track: Trajectory) -> Float:
    """Those of the graph that lie within ``NEAR_M`` of the way driven."""
    way = track.poses[::10, :2]
    away = np.hypot(*(landmarks[:, None, :] - way[None, :, :]).transpose(2, 0, 1))
    near: Float = landmarks[away.min(axis=1) < NEAR_M]
    return near

# SPDX-License-Identifier: Apache-2.0
"""Which trunks of Victoria Park a map holds, against the graph's, its drift set aside.

Along 4 km a map bends away from the graph by metres, all trunks of a place together. That is an
error of poses, told by loops and by GPS; it deletes nothing. So landmarks are laid over the graph's
place by place: those within ``NEAR_M`` of the laser, by a rigid fit of their own.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scripts.paper.census import Census, paired
from scripts.paper.park_scores import over_graph
from scripts.paper.runs import Run
from slam import se2
from slam.frames import Float
from slam.logs.victoria_park import GpsTrack
from slam.trajectory import Trajectory

GATE_M = 2.0  # between a landmark, so laid, and the graph's
NEAR_M = 30.0
CLOSING_M = (8.0, 6.0, 4.0, 3.0, GATE_M, GATE_M)  # gates of the rounds of a fit
FEWEST = 4  # pairs that say how a place lies


@dataclass(frozen=True, kw_only=True, eq=False)
class Place:
    """A stop on the way: where a SLAM thought to be, and T_graph_map if it was right there."""

    here: Float
    T_graph_map: Float

    def near(self, points: Float) -> NDArray[np.bool_]:
        """(n,) which are within ``NEAR_M`` of here."""
        away = points - self.here
        close: NDArray[np.bool_] = np.hypot(away[:, 0], away[:, 1]) < NEAR_M
        return close


@dataclass(frozen=True, kw_only=True, eq=False)
class Laid:
    """How a place lies over the graph, and how many pairs agree."""

    T_graph_map: Float
    pairs: int = 0


@dataclass(frozen=True, eq=False)
class Surveyor:
    """Lays landmarks over the graph's ``trunks`` (m, 2)."""

    trunks: Float

    def lay(self, points: Float, starts: Iterable[Laid]) -> Laid:
        """The rigid fit in which the most are paired, from any of these starts."""
        best = Laid(T_graph_map=np.zeros(3), pairs=-1)
        for start in starts:
            T = start.T_graph_map
            for gate in CLOSING_M:
                rows, columns = paired(se2.transform(T, points), self.trunks, gate)
                if len(rows) < FEWEST:
                    break
                T = se2.fit(points[rows], self.trunks[columns])
            pairs = len(paired(se2.transform(T, points), self.trunks, GATE_M)[0])
            if pairs > best.pairs:
                best = Laid(T_graph_map=T, pairs=pairs)
        return best

    def unbent(self, points: Float, places: list[Place]) -> Float:
        """(n, 2) a whole map over the graph: each landmark by the fit with the most pairs of all
        places near it. A place starts from the poses there, and from the fits of its neighbours on
        the way, since a map moves after it was made, where a loop closes."""
        fits: dict[int, Laid] = {}
        for order in (range(len(places)), range(len(places) - 1, -1, -1)):
            before: list[Laid] = []
            for k in order:
                near = places[k].near(points)
                if near.sum() < FEWEST:
                    continue
                known = [fits[k]] if k in fits else [Laid(T_graph_map=places[k].T_graph_map)]
                new = self.lay(points[near], [*known, *before])
                fits[k] = max([*known, new], key=lambda fit: fit.pairs)
                before = [fits[k]]
        moved = se2.transform(places[-1].T_graph_map, points)
        most = np.full(len(points), -1)
        for k, fit in fits.items():
            better = places[k].near(points) & (most < fit.pairs)
            moved[better] = se2.transform(fit.T_graph_map, points[better])
            most[better] = fit.pairs
        return moved


def census_of(run: Run, trunks: Float, track: Trajectory, graph: Trajectory) -> Census:
    """What a map held at each stop, near it, and what it holds in the end."""
    surveyor, census = Surveyor(trunks), Census(trunks)
    places = [
        Place(
            here=track.poses[k, :2],
            T_graph_map=se2.compose(graph.poses[k], se2.inverse(track.poses[k])),
        )
        for k in run.arrays["stops"].tolist()
    ]
    ends = np.cumsum([0, *run.numbers["sizes"]]).tolist()
    before: list[Laid] = []
    points, names = np.zeros((0, 2)), np.zeros(0, dtype=np.int64)
    for place, (a, b) in zip(places, pairwise(ends), strict=True):
        points, names = run.arrays["found"][a:b], run.arrays["names"][a:b]
        near = place.near(points)
        if near.sum() < FEWEST:
            continue
        start = Laid(T_graph_map=place.T_graph_map)
        before = [surveyor.lay(points[near], [start, *before])]
        census.take(se2.transform(before[0].T_graph_map, points[near]), names[near], GATE_M)
    census.take(surveyor.unbent(points, places), names, GATE_M)
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

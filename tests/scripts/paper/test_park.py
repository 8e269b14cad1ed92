# SPDX-License-Identifier: Apache-2.0
"""The rules by which a drive through Victoria Park is scored."""

import math

import numpy as np
import pytest

from scripts.paper import park_scores
from scripts.paper.census import NAMELESS
from scripts.paper.runs import Run
from slam import se2
from slam.logs.victoria_park import GpsTrack
from slam.trajectory import Trajectory


def test_outliers_are_fixes_nobody_could_have_driven_to():
    stamps = np.arange(10, dtype=np.int64) * 200_000_000
    points = np.column_stack([0.5 * np.arange(10), np.zeros(10)])
    points[4] += [0.0, 30.0]
    good = park_scores.good_fixes(GpsTrack(stamps_ns=stamps, points=points))
    assert good.tolist() == [True] * 4 + [False] + [True] * 5
    # after a long gap anything goes
    stamps = stamps + np.where(np.arange(10) >= 4, 10_000_000_000, 0)
    good = park_scores.good_fixes(GpsTrack(stamps_ns=stamps, points=points))
    assert good[4]


def test_loops_are_returns_after_a_long_way():
    t = np.linspace(0.0, 4.0 * math.pi, 400)
    poses = np.column_stack([30.0 * np.cos(t), 30.0 * np.sin(t), t])
    track = Trajectory(stamps_ns=np.arange(400, dtype=np.int64), poses=poses)
    pairs = park_scores.loops(track)
    assert pairs
    for a, b in pairs:
        assert np.hypot(*(poses[a] - poses[b])[:2]) < park_scores.LOOP_NEAR_M
        assert abs(b - a) > 100
    np.testing.assert_allclose(park_scores.loop_errors(track, track), 0.0, atol=1e-9)


def bent_drive(named: bool) -> tuple[Run, np.ndarray, Trajectory, Trajectory]:
    """300 m along which the heading drifts until the map is off by more than 5 m."""
    rng = np.random.default_rng(5)
    graph = np.column_stack([np.arange(301.0), np.zeros((301, 2))])
    bend = 0.04 * np.arange(301) / 300
    mine = [np.zeros(3)]
    for before, after, turn in zip(graph, graph[1:], np.diff(bend), strict=False):
        mine.append(se2.compose(mine[-1], [*se2.between(before, after)[:2], turn]))
    trunks = np.column_stack([rng.uniform(0.0, 300.0, 70), rng.uniform(-25.0, 25.0, 70)])
    where: dict[int, np.ndarray] = {}
    found, names, sizes, stops = [], [], [], list(range(0, 301, 10))
    for k in stops:
        for i in np.flatnonzero(np.hypot(*(trunks - graph[k, :2]).T) < 29.0).tolist():
            seen = se2.transform(se2.inverse(graph[k]), trunks[i])
            where.setdefault(i, se2.transform(mine[k], seen))
        found += where.values()
        names += where if named else [NAMELESS] * len(where)
        sizes.append(len(where))
    arrays = {"found": np.array(found), "names": np.array(names), "stops": np.array(stops)}
    stamps = np.arange(301, dtype=np.int64)
    tracks = [Trajectory(stamps_ns=stamps, poses=np.array(p)) for p in (mine, graph)]
    seen_ones = trunks[sorted(where)]
    return Run(numbers={"sizes": sizes}, arrays=arrays), seen_ones, tracks[0], tracks[1]


@pytest.mark.parametrize("named", [True, False])
def test_a_map_that_has_drifted_has_lost_nothing(named):
    run, trunks, track, graph = bent_drive(named)
    assert np.hypot(*(track.poses[-1] - graph.poses[-1])[:2]) > 5.0
    numbers = park_scores.census_of(run, trunks, track, graph).numbers()
    assert len(trunks) > 60
    counts = [numbers[key] for key in ("misses", "spurious", "gone", "deleted by mistake")]
    assert counts == [0, 0, 0, 0]


def test_what_a_drifted_map_has_lost_is_counted():
    run, trunks, track, graph = bent_drive(named=True)
    found, last = run.arrays["found"], len(run.arrays["found"]) - run.numbers["sizes"][-1]
    run.arrays["names"][last + np.array([7, 30])] = [1000, 1001]  # deleted and not found again
    found[last + np.array([7, 30])] += [0.0, 200.0]
    found[last + 50] += [0.0, 100.0]  # still there by name, at a wrong place
    numbers = park_scores.census_of(run, trunks, track, graph).numbers()
    counts = [numbers[key] for key in ("misses", "spurious", "gone", "deleted by mistake")]
    assert counts == [3, 3, 3, 2]


def test_headings_are_turned_as_positions_are():
    t = np.linspace(0.0, 3.0, 300)
    poses = np.column_stack([60.0 * np.sin(t), 60.0 * (1.0 - np.cos(t)), t])
    stamps = (1e9 * np.arange(300)).astype(np.int64)
    gps = GpsTrack(stamps_ns=stamps, points=poses[:, :2].copy())
    turned = np.array([se2.compose([3.0, -2.0, 0.4], pose) for pose in poses])
    graph, track = (Trajectory(stamps_ns=stamps, poses=p) for p in (poses, turned))
    np.testing.assert_allclose(park_scores.headings_off(track, graph, gps), 0.0, atol=1e-9)
    laid = se2.transform(park_scores.over_graph(track, graph, gps), turned[:, :2])
    np.testing.assert_allclose(laid, poses[:, :2], atol=1e-9)

# SPDX-License-Identifier: Apache-2.0
"""One row a metric: every command takes it from the table, and nobody keeps a list of his own."""

import math
from pathlib import Path

import numpy as np
import pytest

from scripts.comparison import schema, tables
from scripts.comparison.entry import scored
from scripts.metrics import table
from scripts.metrics.judged import Judged
from scripts.metrics.table import METRICS
from scripts.single_run.score import scores
from slam import Estimate, Trajectory, create
from slam.replay import Track
from tests.world2d import Drive, World2D, arena, frames, laser

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def run() -> tuple[Track, Trajectory]:
    drive = Drive((1.0, 0.5, 0.3), ((0.4, 0.8, 8.0),))
    stream = frames(World2D(arena()), drive, rate_hz=10.0, spec=laser(61), seed=4)
    track = Track(name="odometry", system=create("odometry"))
    for frame in stream:
        track.take(frame)
    truth = Trajectory(
        stamps_ns=np.array([f.stamp_ns for f in stream]),
        poses=np.array([f.truth for f in stream]),
    )
    return track, truth


def test_every_metric_is_a_column_with_a_direction_and_words():
    for key, metric in METRICS.items():
        assert metric.label, key
        assert (key in schema.TABLES[schema.RUNS].columns) == metric.column
        assert (key in (*tables.MEDIANS, *tables.SHARES)) == (metric.summary is not None)
        if metric.better is not None:  # the report compares by it, so it must explain it
            assert metric in table.EXPLAINED
            assert metric.name
            assert metric.about
        if metric.in_run:
            assert metric in table.IN_RUN


def test_run_and_compare_compute_the_same_figures(run):
    track, truth = run
    block = scores(track, truth, duration_s=8.0)
    row = scored(track, None, None, truth)
    shared = [m for m in table.IN_RUN if m.column and m.section == "errors"]
    assert len(shared) > 10
    assert {m.key: block[m.in_run] for m in shared} == {m.key: row[m.key] for m in shared}
    assert set(row) <= set(schema.TABLES[schema.RUNS].columns)
    computed = {m.key for m in METRICS.values() if m.column and m.compute is not None}
    assert computed <= set(row)


def test_without_truth_only_what_needs_none_is_there(run):
    block = scores(run[0], None, duration_s=8.0)
    assert set(block) == {"scans"} | {m.in_run for m in table.IN_RUN if m.without_truth}


def judged(errors_m, *, sigma_m: float = 0.01, trusted=None, leap_at: int | None = None) -> Judged:
    """A robot that drives 0.1 m a scan, 5 a second, of which the SLAM is off by so much across."""
    n = len(errors_m)
    stamps = np.arange(n, dtype=np.int64) * 200_000_000
    poses = np.column_stack([0.1 * np.arange(n), np.zeros(n), np.zeros(n)])
    if leap_at is not None:
        poses[leap_at:, 1] += 5.0
    believed = poses + np.column_stack([np.zeros(n), errors_m, np.zeros(n)])
    covariance = np.eye(3) * sigma_m**2
    trusted = [True] * n if trusted is None else trusted
    said = [
        Estimate(stamp_ns=int(s), T_map_robot=p, covariance=covariance, converged=bool(t))
        for s, p, t in zip(stamps, believed, trusted, strict=True)
    ]
    return Judged(
        estimate=Trajectory(stamps_ns=stamps, poses=believed),
        truth=Trajectory(stamps_ns=stamps, poses=poses),
        estimates=said,
        covariances=np.array([covariance] * n),
        steady_s=np.linspace(0.001, 1.0, 1000),
    )


def test_silent_failures_are_far_beyond_what_is_claimed_and_trusted():
    off = np.array([0.0, 0.05, 0.2, 0.2, 0.2])
    share = METRICS["silent_share"].of
    assert share(judged(off)) == pytest.approx(3 / 5)  # 0.05 m is near enough
    assert share(judged(off, trusted=[1, 1, 1, 0, 1])) == pytest.approx(2 / 5)
    assert share(judged(off, sigma_m=0.07)) == 0.0  # within 3 sigma
    assert share(judged(off, sigma_m=0.0)) is None  # no claim


def test_the_error_while_tracking_ends_with_the_loss():
    off = np.array([0.0, *[0.1] * 9, *[3.0] * 10])
    error = METRICS["error_tracking_m"].of
    assert error(judged(off)) == pytest.approx(0.1 * math.sqrt(9 / 10))
    assert error(judged(off[:10])) == pytest.approx(METRICS["ate_unaligned_m"].of(judged(off[:10])))
    assert error(judged(np.zeros(5))) == 0.0
    assert METRICS["ms_per_scan_p999"].of(judged(off)) == pytest.approx(999.0, rel=1e-3)


def test_who_was_carried_away_has_ten_seconds_to_find_itself():
    """50 scans at the wrong place are no loss; 58 of them are, from the end of the time on."""
    found, late = (np.array([*[0.0] * 5, *[2.0] * n, *[0.0] * 20]) for n in (50, 58))
    for off, lost_at_s in ((found, None), (late, pytest.approx(11.0))):
        run = judged(off, leap_at=5)
        assert run.lost_s == lost_at_s
        assert METRICS["error_tracking_m"].of(run) == 0.0
    assert judged(found).lost_s == pytest.approx(1.0)

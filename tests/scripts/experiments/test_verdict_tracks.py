# SPDX-License-Identifier: Apache-2.0
"""Which scans count as lost and which as outdated, and how sure the area under the ROC is."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np

from scripts.experiments.verdict_tracks import (
    AFTER_S,
    CHANGES,
    KIDNAPS,
    MAPPED_S,
    PUSH_M,
    Seen,
    area,
    interval,
    judged,
    markdown,
    moments,
    until_found,
)
from slam.frames import NS_PER_S


def said(error_m: float, p_lost: float, state: str = "tracking", verdict: str = "lost") -> Seen:
    return Seen(error_m=error_m, state=state, verdict=verdict, p_lost=p_lost)


def test_a_push_counts_until_the_pose_is_near_again():
    run = [said(3.0, 0.9), said(0.6, 0.8), said(0.4, 0.1), said(0.7, 0.2)]
    assert until_found(run) == run[:2]
    assert until_found(run[2:]) == []


def test_the_room_has_changed_on_some_tracks_and_the_robot_is_carried_on_others():
    track = [said(0.01, 0.2), said(0.03, 0.0, verdict="blind"), said(0.2, 0.3), said(2.0, 0.4)]
    push = [said(2.0, 1.0), said(2.0, 0.7, state="relocated"), said(0.1, 0.0)]
    room, carried = judged(CHANGES[0], track, [push]), judged(KIDNAPS[0], track, [])
    assert (room["outdated"], room["kidnapped"], room["pushed"]) == ([0.2], [], [1.0, 0.7])
    assert (carried["outdated"], carried["kidnapped"]) == ([], [0.4])
    assert (room["tried"], room["back"], room["wrong"]) == (1, 1, 1)
    assert interval([room, carried], "kidnapped", "pushed") == (1.0, 1.0, 1.0)
    assert "| pose wrong | 0.0 % | 0.0 % | 100.0 % | 0.0 % |" in markdown([room, carried])
    assert math.isnan(interval([carried], "kidnapped")[0])


def test_the_interval_is_as_wide_as_the_streams_differ():
    rows = [
        {"outdated": [0.5] * 50 if k < 4 else [], "kidnapped": [p] * 50 if k >= 4 else []}
        for k, p in enumerate([0.0] * 4 + [0.9, 0.9, 0.9, 0.1])
    ]
    found, low, high = interval(rows, "kidnapped")
    assert found == 0.75
    assert low <= 0.25
    assert high == 1.0


def test_pushes_come_when_a_map_is_there_and_the_end_is_not_near():
    frames = [SimpleNamespace(stamp_ns=round(k * 0.2 * NS_PER_S)) for k in range(300)]
    found = moments(frames, 10, seed=3)  # type: ignore[arg-type]
    assert [k for k, _ in found] == sorted({k for k, _ in found})
    assert all(MAPPED_S <= 0.2 * k <= 59.8 - AFTER_S for k, _ in found)
    far = np.array([math.hypot(by[0], by[1]) for _, by in found])
    assert ((far >= PUSH_M[0]) & (far <= PUSH_M[1])).all()
    again = moments(frames, 10, seed=3)  # type: ignore[arg-type]
    assert all(np.array_equal(a[1], b[1]) for a, b in zip(found, again, strict=True))


def test_the_area_under_a_roc_counts_pairs_and_ties_half():
    assert area(np.array([0.9, 0.8]), np.array([0.1, 0.2])) == 1.0
    assert area(np.array([0.1, 0.5]), np.array([0.5, 0.1])) == 0.5
    assert area(np.array([0.1]), np.array([0.9])) == 0.0

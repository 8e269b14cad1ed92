# SPDX-License-Identifier: Apache-2.0
"""The scripts that tune the EKF and that count its corners."""

from __future__ import annotations

import math

import numpy as np
import pytest

from scripts import corner_recall, tune_ekf
from sim.lidar_config import Lms221Config
from sim.simulation import Simulation
from slam.frames import LaserSpec, Scan


def test_trials_are_scored_on_the_training_seeds(tmp_path, monkeypatch):
    monkeypatch.setattr(tune_ekf, "WORLDS", {"points": ({"moving": 0.0, "n_steps": 15},)})
    results = tune_ekf.tune("points", [0, 1], tmp_path, 1, ["noise_scale"])
    assert [changes for changes, _ in results[:2]] == [{}, {"noise_scale": 0.8}]
    assert all(scores.shape == (2, 1) for _, scores in results)
    assert all((scores < math.log10(0.05)).all() for _, scores in results)
    assert len(list(tmp_path.iterdir())) == 2
    lines = list(tune_ekf.table("points", results))
    assert lines[4].startswith("| noise_scale | 1.25 | 0.8 |")
    assert len(lines) == 4 + len(results) - 1


def test_seeds_that_are_shown_are_never_tuned_on():
    assert max(tune_ekf.TRAINING) < 100


def test_truths_lie_where_the_scene_has_them():
    arena = corner_recall.truths(Simulation("arena", seed=0, dynamism=0.0))
    np.testing.assert_allclose(
        sorted(map(tuple, arena["room corners"])), [(-5, -4), (-5, 4), (5, -4), (5, 4)]
    )
    assert len(arena["chair columns"]) >= 16
    assert (np.abs(arena["chair columns"]) < [5.0, 4.0]).all()
    assert len(arena["door jambs"]) == 0


def test_only_what_stops_a_beam_is_a_chance():
    spec = LaserSpec(n_beams=181, angle_min=-math.pi / 2, angle_increment=math.pi / 180)
    ranges = np.full(181, 4.0, dtype=np.float32)
    ranges[100:120] = 1.0  # something nearer, to the left
    scan = Scan(stamp_ns=0, ranges=ranges, spec=spec)
    left = math.radians(20.0)
    hidden = (4.0 * math.cos(left), 4.0 * math.sin(left))
    points = np.array([[4.0, 0.0], hidden, [3.0, 0.0], [-4.0, 0.0], [0.0, 4.0]])
    np.testing.assert_array_equal(corner_recall.visible(points, scan), points[:1])


def test_a_corner_of_a_room_needs_its_walls():
    spec = LaserSpec(n_beams=181, angle_min=-math.pi / 2, angle_increment=math.pi / 180)
    ranges = np.full(181, 4.0, dtype=np.float32)
    point = np.array([[4.0, 0.0]])
    for beam, seen in ((92, False), (97, True)):  # 2 and 7 degrees beside it, 0.14 and 0.5 m
        ranges[:] = 4.0
        ranges[beam] = 2.0
        scan = Scan(stamp_ns=0, ranges=ranges, spec=spec)
        assert len(corner_recall.visible(point, scan, 0.2)) == seen
        assert len(corner_recall.visible(point, scan)) == 1


def test_in_the_arena_features_lie_at_known_things_and_are_found_again():
    tallies = corner_recall.recall("arena", seed=0, seconds=4.0, laser=Lms221Config())
    assert tallies[corner_recall.KNOWN].recall > 0.8
    assert tallies[corner_recall.AGAIN].recall > 0.6


@pytest.mark.parametrize("kind", ["door jambs"])
def test_most_jambs_of_the_office_are_found(kind):
    tally = corner_recall.recall("office", seed=0, seconds=2.0, laser=Lms221Config())[kind]
    assert tally.seen > 10
    assert tally.recall > 0.4
    assert np.median(tally.errors) < 0.1

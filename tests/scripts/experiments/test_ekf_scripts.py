# SPDX-License-Identifier: Apache-2.0
"""The scripts that tune the EKF, show its bar, measure association and count corners."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.stats import chi2

from scripts.experiments import association_effort, corner_recall, rival_bar, tune_ekf
from sim.simulation import Simulation
from slam.frames import LaserSpec, Scan
from slam.trajectory import Trajectory


def test_trials_are_scored_beside_the_preset(monkeypatch):
    monkeypatch.setattr(tune_ekf, "WORLDS", {"points": ({"moving": 0.0, "n_steps": 15},)})
    case = {"preset": "points", "world": 0, "seconds": 30.0}
    trials = [(tune_ekf.FROZEN, 0), ("noise_scale", 0)]
    rows = [
        {**case, "knob": knob, "value": value, "seed": seed}
        for knob, value in trials
        for seed in (0, 1)
    ]
    rows = [row | tune_ekf.run(row) for row in rows]
    assert all(row["score"] < math.log10(0.05) for row in rows)
    told = tune_ekf.tell(rows).splitlines()
    assert told[0].startswith("Preset points, 2 seeds: score -")
    assert told[-1].startswith("| noise_scale | 1.25 | 0.8 |")


@pytest.mark.parametrize("words", [["--first-seed", "20"], ["--seeds", "21"]])
def test_seeds_that_are_shown_are_never_tuned_on(words, capsys, tmp_path):
    more = ["--folder", str(tmp_path), "--results", str(tmp_path / "r.json")]
    assert tune_ekf.STUDY.main([*words, *more]) == 1
    assert "seeds must lie in 0 to 19, got 20" in capsys.readouterr().err


def test_the_bar_is_judged_on_both_ways_to_associate():
    bars = list(rival_bar.points([0, 1], steps=25))
    assert [bar.met for bar in bars if "ATE" in bar.what] == [True, True]
    assert len(bars) == 4
    assert "true associations" in bars[0].line()
    assert "seeds 0 to 1" in bars[0].line()


def test_nees_bounds_are_those_of_chi_square():
    low, high = rival_bar.nees_bounds(10)
    np.testing.assert_allclose([10 * low, 10 * high], chi2.ppf([0.025, 0.975], 30))


def test_the_score_is_the_error_in_units_of_what_was_said():
    stamps = np.arange(5)
    truth = Trajectory(stamps_ns=stamps, poses=np.zeros((5, 3)))
    poses = np.zeros((5, 3))
    poses[1:, 0] = 0.2
    covariances = np.tile(np.diag([0.01, 0.01, 0.01]), (5, 1, 1))
    covariances[0] = 0.0  # the first pose is exact, and says nothing
    error, nees = rival_bar.scored(Trajectory(stamps_ns=stamps, poses=poses), covariances, truth)
    assert error == pytest.approx(0.2 * math.sqrt(0.8))
    assert nees == pytest.approx(4.0)


def test_loops_that_are_not_closed_are_told_with_their_place():
    errors = np.full(20, 0.5)
    errors[[3, 7, 8]] = [4.0, 14.9, 5.0]
    at = 400 * np.arange(20)
    at[8] = at[7] + 50
    bar = rival_bar.closed(errors, at, 0)
    assert not bar.met
    assert "set after the result was known" in bar.what
    assert "17 of 20 (85%), worst 14.9 m" in bar.value
    assert "frames 1200, 2800 to 2850 (2)" in bar.value
    assert rival_bar.closed(errors[9:], at[9:], 0).met
    assert not rival_bar.closed(errors[9:], at[9:], 1).met


def test_bar_refuses_impossible_numbers_of_seeds(capsys):
    assert rival_bar.main(["--seeds", "0"]) == 1
    assert "--seeds must lie in [1, 100], got 0" in capsys.readouterr().err


def test_effort_of_association_grows_with_clutter_for_jcbb():
    case = {"pairs": 4, "clutter": 0, "seed": 0}
    straight = {m: association_effort.run({**case, "method": m}) for m in ("jcbb", "ipjc")}
    assert [row["nodes"] for row in straight.values()] == [5, 4]  # straight down
    amid = association_effort.run({**case, "clutter": 2, "method": "jcbb"})
    assert amid["nodes"] > 5
    assert amid["ms"] > 0.0
    assert association_effort.cell([amid]).endswith(f"{amid['tests']}")


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


def tallied(scene: str, kind: str, seconds: float) -> tuple[int, list[float]]:
    case = {"scene": scene, "degrees": 0.5, "seed": 0, "seconds": seconds}
    tally = corner_recall.run(case)[kind]
    return tally["seen"], tally["errors"]


@pytest.mark.parametrize(
    ("kind", "least"), [(corner_recall.KNOWN, 0.8), (corner_recall.AGAIN, 0.6)]
)
def test_in_the_arena_features_lie_at_known_things_and_are_found_again(kind, least):
    seen, errors = tallied("arena", kind, 4.0)
    assert len(errors) > least * seen


def test_most_jambs_of_the_office_are_found():
    seen, errors = tallied("office", "door jambs", 2.0)
    assert seen > 10
    assert len(errors) > 0.4 * seen
    assert np.median(errors) < 0.1

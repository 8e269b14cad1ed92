# SPDX-License-Identifier: Apache-2.0
"""Every rate gets the same drive, with all of its odometry, and the tables say what was run."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from scripts.experiments import rates
from scripts.experiments.measured import ended
from sim.simulation import Simulation, tour
from slam.errors import InvalidValueError, UnknownNameError


def test_scans_left_out_leave_their_odometry():
    frames = list(tour(Simulation("arena", seed=0, laser="lms221:noise"), 0.5))
    few = rates.kept(frames, 4)
    assert [f.stamp_ns for f in few] == [f.stamp_ns for f in frames[::4]]
    between = sum(f.odometry.increment_covariance for f in frames[5:9])
    np.testing.assert_allclose(few[2].odometry.increment_covariance, between)
    assert np.array_equal(few[2].odometry.T_odom_robot, frames[8].odometry.T_odom_robot)


def test_a_stream_is_a_scene_or_a_track_at_its_level():
    office = rates.drive("office", 0.5, 3, 20.0)
    assert (office.recipe.dynamism, office.recipe.seconds) == (0.5, 20.0)
    track = rates.drive("rush-hour", 0.5, 3, 20.0)
    assert track.recipe.scene == "station"
    assert track.recipe.options["crowd"] == "streams:35"
    assert track.recipe.seconds == 90.0  # as long as the track
    assert track.name != rates.drive("rush-hour", 0.75, 3, 20.0).name
    with pytest.raises(UnknownNameError, match="rush-our"):
        rates.drive("rush-our", 0.5, 3, 20.0)


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["--every", "0"], "--every must be a whole number >= 1, got 0"),
        (["--streams", "rush-hour", "--level", "7"], "the level of a track must be one of"),
    ],
)
def test_what_cannot_be_run_is_told_in_a_line(tmp_path: Path, capsys, words, says):
    folders = ["--folder", str(tmp_path / "a"), "--results", str(tmp_path / "rates.json")]
    assert rates.main([*words, *folders, "--no-page"]) == 1
    assert capsys.readouterr().err.startswith(says)
    assert not list(tmp_path.iterdir())


def test_an_error_of_ours_ends_an_experiment_in_a_line(capsys: pytest.CaptureFixture):
    def wrong() -> int:
        raise InvalidValueError("motion must be one of 1, 0.75, 0.5, got 0.3")

    assert ended(wrong) == 1
    assert capsys.readouterr().err == "motion must be one of 1, 0.75, 0.5, got 0.3\n"
    assert ended(lambda: None) == 0


def test_a_run_is_recorded_once_replayed_and_told(tmp_path: Path, capsys: pytest.CaptureFixture):
    words = ["--streams", "arena", "--seeds", "1", "--seconds", "3", "--slams", "odometry"]
    words += ["--every", "19", "8", "--folder", str(tmp_path), "--no-page"]
    words += ["--results", str(tmp_path / "rates.json")]
    assert rates.main(words) == 0
    (recording,) = tmp_path.glob("*.npz")
    first, made = capsys.readouterr().out, recording.stat().st_mtime_ns
    assert "| arena | 1.97 |" in first
    assert "| all | 4.69 |" in first
    assert rates.main(words) == 0
    assert capsys.readouterr().out == first
    assert recording.stat().st_mtime_ns == made

# SPDX-License-Identifier: Apache-2.0
"""``--scan`` named more than once: what a run says of each scanner, and what it refuses."""

import logging
from pathlib import Path

import numpy as np
import pytest

from scripts.debugger.recording import case_of
from scripts.film.footage import of_log, of_scene, open_run
from scripts.options import Tour
from scripts.single_run import log_words
from scripts.single_run.run import on_scene
from scripts.single_run.session import Outputs
from slam.errors import InvalidValueError, LogFormatError
from slam.logs.bag_topics import Asked
from tests.slam.logs.two_scanners import bag


def test_a_run_says_where_both_are_and_tests_each(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], caplog: pytest.LogCaptureFixture
) -> None:
    path, topics = bag(tmp_path / "two"), [Asked("/front"), Asked("/rear")]
    log_words.tell(of_log(path, asked=topics), strict=True)
    line = capsys.readouterr().out
    assert "rosbag2, /front; 91 beams" in line
    assert "/rear, 61 beams over 180° (counter-clockwise), up to 30 m, scanner at x -0.3" in line
    assert "turned 180° on the robot, by base_link -> rear of /tf_static" in line
    assert not caplog.text
    ahead = [log_words.mount_of(text) for text in ("0.3,0,0", "-0.3,0,0")]
    with caplog.at_level(logging.WARNING):
        found = log_words.tell(of_log(path, asked=topics, mounts=ahead), strict=False)
    assert "two, /rear: Scans contradict odometry" in caplog.text
    assert "agree under --laser -0.3,0,180 (" in caplog.text
    assert found[0].turned_deg == 180


def test_what_cannot_be_is_refused_with_the_cure(tmp_path: Path) -> None:
    topics, ahead = [Asked("/front"), Asked("/rear")], np.zeros(3)
    unsaid = bag(tmp_path / "unsaid", transforms=False)
    with pytest.raises(InvalidValueError, match="unsaid: nothing says how the scanner of /fr"):
        of_log(unsaid, asked=topics)
    for wrong, options in {
        "once for each": {"asked": topics, "mounts": [ahead]},
        "--flip is about one scanner": {"asked": topics, "flip": True},
    }.items():
        with pytest.raises(InvalidValueError, match=wrong):
            of_log(unsaid, **options)
    text = tmp_path / "a.log"
    text.write_text("")
    with pytest.raises(InvalidValueError, match="--scan and --odometry name topics"):
        of_log(text, asked=topics)


def test_a_simulated_robot_has_two_and_its_run_is_shown_again(tmp_path: Path) -> None:
    settings = Tour(seconds=2.0, also_at=["-0.2,0,180"]).settings("arena")
    assert settings["also_at"] == [{"x_m": -0.2, "y_m": 0.0, "yaw_deg": 180.0}]
    assert "also_at" not in Tour().settings("arena")
    with pytest.raises(InvalidValueError, match="--also-at must be x,y,yaw_deg in m, m, deg"):
        Tour(also_at=["0,0"]).settings("arena")
    run = tmp_path / "run"
    on_scene(["shunting", "kiss-icp"], settings, Outputs(folder=run, command="run", film=False))
    with of_scene(settings, view=None) as made, open_run(run, view=None) as again:
        frames = list(made.stream)
        assert len(frames) == made.stream.length == again.stream.length
        assert frames == list(again.stream)
    rows = (run / "trajectory_kiss-icp.tum").read_text().splitlines()
    assert len(rows) == len(frames)
    with pytest.raises(LogFormatError, match="take one without --also-at"):
        case_of(run, None, 1)

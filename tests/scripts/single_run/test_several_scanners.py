# SPDX-License-Identifier: Apache-2.0
"""``--scan`` named more than once: what a run says of each scanner, and what it refuses."""

import logging
from pathlib import Path

import numpy as np
import pytest

from scripts.film.footage import of_log
from scripts.single_run import log_words
from slam.errors import InvalidValueError
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

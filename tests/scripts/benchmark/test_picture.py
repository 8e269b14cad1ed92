# SPDX-License-Identifier: Apache-2.0
"""The benchmark's pictures: what they average, where names stand, what they refuse."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from scripts.benchmark import picture
from slam.errors import LogFormatError


@pytest.fixture
def board(tmp_path) -> Path:
    levels = [0.0, 0.5, 1.0]
    shares = {
        "a-v1 mine": [0.0, 0.5, 1.0], "a-v1 oracle(shunting)": [0.0, 0.0, 0.0],
        "b-v1 mine": [0.0, 0.0, 0.5], "b-v1 oracle(shunting,moving)": [0.0, 0.0, 0.0],
        "c-v1 mine": [1.0, 1.0, 1.0], "c-v1 oracle(shunting)": [0.5, 0.5, 0.5],
    }  # fmt: skip
    path = tmp_path / "leaderboard.json"
    path.write_text(json.dumps({
        "levels_run": levels, "seeds": [1, 2],
        "tracks": {name: {"counts": name != "c-v1"} for name in ("a-v1", "b-v1", "c-v1")},
        "lost_shares": {key: {"levels": levels, "lost": lost} for key, lost in shares.items()},
    }))  # fmt: skip
    return path


def test_the_mean_is_of_tracks_that_count_and_every_oracle_is_one_line(board):
    lost = picture.read(board)
    assert lost.counting == ["a-v1", "b-v1"]
    assert lost.mean("mine").tolist() == [0.0, 25.0, 75.0]
    assert lost.mean(picture.ORACLE).tolist() == [0.0, 0.0, 0.0]


def test_names_at_the_ends_of_lines_never_overlap():
    for ends in ([0.0] * 12, [100.0] * 12, [3.0, 50.0, 51.0, 52.0, 99.0, 100.0]):
        places = picture.spread(ends)
        assert np.diff(sorted(places)).min() >= picture.APART - 1e-9
        assert max(places) <= 100.0 + 1e-9
    assert picture.spread([10.0, 90.0]) == [10.0, 90.0]


def test_both_pictures_are_drawn(board, tmp_path):
    assert picture.main([str(board), "--out", str(tmp_path / "pictures")]) == 0
    for name in ("benchmark.png", "benchmark_tracks.png"):
        assert cv2.imread(str(tmp_path / "pictures" / name)) is not None


def test_what_is_no_leaderboard_is_refused(tmp_path):
    path = tmp_path / "other.json"
    for text in ("[]", "{}", "no json", '{"tracks": {"a": 1}, "levels_run": [0]}'):
        path.write_text(text)
        with pytest.raises(LogFormatError, match="leaderboard"):
            picture.read(path)
    assert picture.main([str(path)]) == 1

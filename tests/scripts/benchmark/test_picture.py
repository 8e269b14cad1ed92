# SPDX-License-Identifier: Apache-2.0
"""The benchmark's pictures: what they average, where names stand, what they refuse."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from scripts.benchmark import picture, publish
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


def test_what_is_no_leaderboard_is_refused(tmp_path):
    path = tmp_path / "leaderboard.json"
    for text in ("[]", "{}", "no json", '{"tracks": {"a": 1}, "levels_run": [0]}'):
        path.write_text(text)
        with pytest.raises(LogFormatError, match="leaderboard"):
            picture.read(path)
    assert publish.main([str(tmp_path)]) == 1


def test_a_leaderboard_is_published(board, tmp_path):
    data = json.loads(board.read_text())
    row = {"lost_from": "inf", "lost_at_top": 0.25, "error_tracking_m": 0.02, "silent_share": None,
           "spearman": 0.95, "ms_per_scan_p50": 2.0}  # fmt: skip
    data["leaderboard"] = {
        key: dict(zip(("track", "slam"), key.split(" "), strict=True)) | row
        for key in data["lost_shares"]
    }
    data["slams"] = ["mine"]
    data["leaderboard"]["a-v1 mine"] |= {"lost_from": 0.5, "lost_at_top": 0.75}
    board.write_text(json.dumps(data, indent=1))
    (board.parent / "leaderboard.md").write_text("# Leaderboard\n\n## a-v1\n\n| long |\n")
    docs = tmp_path / "docs"
    (docs / "pictures").mkdir(parents=True)
    (docs / "benchmark.md").write_text(
        "".join(
            f"<!-- {mark} -->\n<!-- /{mark} -->\n" for mark in ("tracks", "leaderboard", "shipped")
        )
    )
    words = [str(tmp_path), "--docs", str(docs), "--results", str(docs), "--commit", "abc"]
    assert publish.main(words) == 0
    page = (docs / "benchmark.md").read_text()
    assert "| `mine` | 0.75 | 1 of 2 | 50 | 2.00 | – | 2 of 2 | 2.00 |" in page
    assert page.index("`oracle`") < page.index("`mine`")
    assert "2 tracks that count" in page
    assert "`c-v1`" in page
    assert "`a-v1` 1 of 1, `b-v1` 0 of 1" in page
    assert json.loads((docs / "leaderboard.json").read_text())["commit"] == "abc"
    short = (docs / "leaderboard.md").read_text()
    assert "| long |" not in short
    assert "(results/leaderboard.csv)" in short
    assert (docs / "leaderboard.csv").read_text().startswith("track,counts,slam,")
    assert (docs / "pictures" / "benchmark.png").is_file()

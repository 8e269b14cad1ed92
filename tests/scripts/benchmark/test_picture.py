# SPDX-License-Identifier: Apache-2.0
"""The benchmark's pages: what they count, where names stand in the picture."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from scripts.benchmark import publish, published
from scripts.benchmark.scores import ranking
from scripts.benchmark.tracks import LEVELS
from tests.scripts.benchmark.test_scores import runs

SHIPPED = published.read()


def test_the_shares_of_a_line_are_of_the_runs_that_rank():
    (row,) = ranking({"a-v1": runs("mine", [[0, 0, 0, 0, 1], [0, 0, 0, 1, 1]])}, "mine")
    assert (row["levels"], row["lost_shares"]) == (list(LEVELS), [0.0, 0.0, 0.0, 0.5, 1.0])


def test_names_at_the_ends_of_lines_never_overlap():
    for ends in ([0.0] * 12, [100.0] * 12, [3.0, 50.0, 51.0, 52.0, 99.0, 100.0]):
        places = publish.spread(ends)
        assert np.diff(sorted(places)).min() >= publish.APART - 1e-9
        assert max(places) <= 100.0 + 1e-9
    assert publish.spread([10.0, 90.0]) == [10.0, 90.0]


def test_what_ships_is_published_and_a_folder_without_days_refused(tmp_path: Path):
    assert publish.main([str(tmp_path)]) == 1
    docs = tmp_path / "docs"
    (docs / "pictures").mkdir(parents=True)
    marks = {"benchmark.md": ("tracks", "shipped"), "leaderboard.md": ("top",)}
    for page, named in marks.items():
        (docs / page).write_text("".join(f"<!-- {m} -->\n<!-- /{m} -->\n" for m in named))
    assert publish.main(["--docs", str(docs), "--results", str(docs)]) == 0
    assert publish.shipped(SHIPPED) in (docs / "benchmark.md").read_text()
    assert publish.at_the_top(SHIPPED) in (docs / "leaderboard.md").read_text()
    assert (docs / "pictures" / "benchmark.png").is_file()


def test_lost_at_the_top_counts_the_runs_of_that_level_alone():
    (cells,) = (line.split(" | ") for line in publish.at_the_top(SHIPPED).splitlines()
                if "tour-guide" in line)  # fmt: skip
    heads = publish.at_the_top(SHIPPED).splitlines()[0].split(" | ")
    of = next(rows for name, rows in publish.board_of(SHIPPED).runs.items() if "tour-g" in name)
    own = [r["lost"] for r in of if (r["slam"], r["dynamism"]) == ("shunting", 1.0)]
    assert cells[heads.index("shunting")] == f"{sum(own)} of {len(own)}"

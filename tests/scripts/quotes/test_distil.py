# SPDX-License-Identifier: Apache-2.0
"""A comparison's folder as a results file, by hand: medians, pairs, pairs over the levels."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from scripts.comparison.folder import Compared, write_table
from scripts.comparison.schema import LEVELS, RUNS
from scripts.comparison.tables import levels
from scripts.quotes.distil import distil, main
from scripts.quotes.texts import Comparison
from scripts.result_files import write
from slam.errors import InvalidValueError

DYNAMISM, SEEDS = [0.0, 0.5, 1.0], [100, 101, 102]
SETTINGS = {
    "compare_schema": 1, "slams": ["shunting", "occupancy"], "scenes": ["arena"],
    "levels": DYNAMISM, "seeds": SEEDS, "seconds": 60.0, "every": 8, "scanner": "full",
    "scan_limit_s": 10.0, "lost_rule": "far off",
    "machine": {"processor": "p", "cores": 2, "python": "3.12.0"},
}  # fmt: skip


@pytest.fixture
def compared(tmp_path: Path) -> Compared:
    """Shunting is 1 cm nearer at 0, 2 cm at 0.5, 3 cm at 1; in seed 102 it is as near everywhere.
    Ghosts are there at 1 only, and the grid failed once there."""
    rows = []
    for k, dynamism in enumerate(DYNAMISM):
        for seed in SEEDS:
            head = {"scene": "arena", "dynamism": dynamism, "seed": seed, "lost": 0, "scans": 9}
            head |= {"moving_share_of_returns": 0.01 * k, "outcome": "finished"}
            for slam, further in (("shunting", 0.0), ("occupancy", 0.01 * (k + 1))):
                error = 0.02 + further * (seed != 102)
                rows.append({**head, "slam": slam, "ate_unaligned_m": error})
                if dynamism == 1.0:
                    rows[-1]["ghost_rate"] = 0.1 + further
    failed = rows[-1]
    del failed["ate_unaligned_m"]
    failed |= {"outcome": "nan", "lost": 1}
    recipe = {"command": "compare", "settings": SETTINGS, "versions": {}}
    (tmp_path / "recipe.json").write_text(json.dumps(recipe))
    write_table(tmp_path / RUNS, rows)
    write_table(tmp_path / LEVELS, levels(Compared(tmp_path).runs))
    return Compared(tmp_path)


def test_what_a_results_file_holds(compared: Compared, tmp_path: Path, monkeypatch):
    monkeypatch.setattr("scripts.quotes.distil.commit", lambda *code: "c" * 40)
    head, tables = distil(compared, "mobilia compare")
    assert (head["commit"], head["seeds"], head["scanner"]) == ("c" * 40, SEEDS, "full")
    write(tmp_path / "r.json", head, tables)
    found = Comparison(tmp_path / "r.json")
    grid = "arena", "occupancy"
    assert found.medians(*grid) == pytest.approx([0.03, 0.04, 0.05])
    assert [pair[0] for pair in found.row("paired", *grid)] == pytest.approx([-0.01, -0.02, -0.03])
    assert found.row("paired", *grid, "ghost_rate")[:2] == [None, None]
    over = found.row("over_levels", *grid)
    assert over[0] == pytest.approx(-0.02)  # of seeds 100 and 101, 102: its median is a tie
    assert over[3:] == [2, 1, 0]
    assert found.medians(*grid, "lost")[-1] == pytest.approx(1 / 3, rel=1e-5)
    assert found.row("rank_correlation", *grid) == 1.0


def test_a_folder_that_other_code_made_is_refused(compared: Compared, tmp_path: Path):
    with pytest.raises(InvalidValueError, match="was not made by the code here"):
        main([str(compared.folder), "--command", "c", "--out", str(tmp_path / "r.json")])
    assert not (tmp_path / "r.json").exists()


def test_code_that_is_not_committed_names_no_commit(monkeypatch):
    from scripts import result_files

    monkeypatch.setattr(result_files, "_git", lambda *words: " M slam/se2.py")
    with pytest.raises(InvalidValueError, match=r"slam/se2\.py"):
        result_files.commit()

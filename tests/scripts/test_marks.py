# SPDX-License-Identifier: Apache-2.0
"""Marked places of a page are filled, long tables lie beside it, results say what made them."""

import re
from pathlib import Path

import pytest

from scripts import marks
from scripts.result_files import RESULTS, commit, load, write
from slam.errors import InvalidValueError, LogFormatError

pytestmark = pytest.mark.docs


def test_a_long_table_goes_to_a_file_and_its_sum_stays(tmp_path: Path):
    rows = [f"| way {k} | {k} |" for k in range(marks.MOST_CELLS // 2)] + ["| all | 780 |"]
    count = len(rows)
    (page := tmp_path / "page.md").write_text("<!-- told -->\n<!-- /told -->\n")
    marks.fill_page(page, "told", "\n".join(["Ways:", "", "| way | n |", "| --- | ---: |", *rows]))
    link = f"All {count} rows: [page_told.csv](results/page_told.csv)."
    assert f"| --- | ---: |\n| all | 780 |\n\n{link}\n" in page.read_text()
    assert "way 3" not in page.read_text()
    lines = (tmp_path / "results" / "page_told.csv").read_text().splitlines()
    assert (lines[:2], len(lines)) == (["way,n", "way 0,0"], count + 1)
    marks.fill_page(page, "told", short := "| way | n |\n| --- | ---: |\n| all | 780 |")
    assert short in page.read_text()


def test_results_are_plain_json_and_what_is_none_is_refused(tmp_path: Path):
    write(path := tmp_path / "r.json", {"schema": 1}, {"levels": {"a": [1.23456789, float("inf")]}})
    assert load(path)["levels"] == {"a": [1.23457, "inf"]}
    for content in ("{", "[]", '{"schema": 0}'):
        path.write_text(content)
        with pytest.raises(LogFormatError, match=r"r\.json: no results file"):
            load(path)


def test_code_that_is_not_committed_names_no_commit(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("scripts.result_files._git", lambda *words: " M slam/se2.py")
    with pytest.raises(InvalidValueError, match=r"slam/se2\.py"):
        commit()


@pytest.mark.parametrize("path", sorted(RESULTS.glob("*.json")), ids=lambda path: path.name)
def test_a_results_file_says_what_made_it(path: Path):
    data = load(path)
    assert re.fullmatch(r"[0-9a-f]{40}", data["commit"])
    assert data["seeds"]
    assert data["command"]
    assert {"processor", "cores", "python"} <= data["machine"].keys()
    assert {"mobilia", "mujoco", "numpy", "numba"} <= data["versions"].keys()
    assert path.stat().st_size < 100_000

# SPDX-License-Identifier: Apache-2.0
"""Measured numbers stand on the pages as the results files have them, and nowhere else."""

from __future__ import annotations

import json
import math
import re
import shutil
from pathlib import Path

import pytest

from scripts import marks
from scripts.quotes.__main__ import PAGES, main, quoted
from scripts.quotes.texts import Comparison, interval, shown, texts, verdict
from scripts.result_files import RESULTS, ROOT, load, write
from slam.errors import InvalidValueError, LogFormatError

_COUNT = r"(?:two|three|four|five|six|seven|eight|nine|ten|a dozen|twenty|thirty|sixty|a hundred)"
_UNIT = (
    r"(?:cm|mm|km|ms|µs|s|m|min|minutes?|seconds?|hours?|[KMG]B|%|x|×|times|steps?|Hz|fps|degrees?)"
)
NUMBER = re.compile(
    rf"(?<![\w.:/-])(?:\d+(?:\.\d+)?[  ]?{_UNIT}(?!\w)|\d+\.\d+|{_COUNT}[  ]{_UNIT}(?!\w))"
)
DEFINED = {
    "README.md": {
        "3.11": "version of Python that is needed",
        "3.14": "version of Python that is needed",
    },
    "docs/films.md": {"120 s": "a replay plays in real time up to here"},
    "docs/comparing.md": {
        "4.7 Hz": "a scanner of 37.5 scans a second, one in 8 kept",
        "0.5 m": "threshold of a lost run",
        "20 degrees": "threshold of a lost run",
        "1 s": "threshold of a lost run",
        "5 s": "start of the honest covariance",
        "0.5": "threshold of an occupied cell",
        "0.15 m": "reach of a ghost",
        "2 s": "how long a new thing must stand",
        "6 cm": "reach of a found thing",
        "15 degrees": "threshold of a closed door",
        "95 %": "level of the intervals",
        "2000 times": "draws of a bootstrap",
    },
}


def prose(text: str) -> str:
    """A page without marked places, fenced code, commands, code in a line and link targets."""
    text = re.sub(r"```.*?```", "", marks.without(text), flags=re.DOTALL)
    lines = [re.sub(r"^ {4}.*?(?=  # |$)", "", line) for line in text.splitlines()]
    return re.sub(r"`[^`\n]*`|(?<=\])\([^)\n]*\)", "", "\n".join(lines))


def test_the_pages_say_what_the_results_say(capsys):
    assert main(["--check"]) == 0, capsys.readouterr().out


@pytest.mark.parametrize("page", PAGES)
def test_no_measured_number_stands_outside_a_marked_place(page: str):
    found = set(NUMBER.findall(prose((ROOT / page).read_text())))
    assert sorted(found - DEFINED[page].keys()) == []
    assert sorted(DEFINED[page].keys() - found) == []  # the list holds nothing that is gone


def test_every_text_stands_on_a_page_and_no_mark_is_taken_for_a_line_of_html():
    used = []
    for page in PAGES:
        lines = (ROOT / page).read_text().splitlines()
        used += marks.names("\n".join(lines))
        for line in lines:
            assert not line.lstrip().startswith("<!--") or line.endswith("-->"), line
            assert not line.lstrip().startswith("<!--") or line.count("<!--") == 1, line
    assert sorted(used) == sorted(texts(RESULTS))


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    for page in PAGES:
        (tmp_path / page).parent.mkdir(exist_ok=True)
        shutil.copy(ROOT / page, tmp_path / page)
    shutil.copytree(RESULTS, tmp_path / "results")
    return tmp_path


def test_a_number_changed_by_hand_or_by_a_new_result_is_noticed_and_written(copy: Path, capsys):
    there = ["--root", str(copy), "--results", str(copy / "results")]
    page = copy / "docs" / "films.md"
    before = page.read_text()
    begin = before.index("<!-- films.cost -->")
    page.write_text(before[:begin] + before[begin:].replace("1280", "1281", 1))
    assert main([*there, "--check"]) == 1
    assert capsys.readouterr().out == "docs/films.md: differs: films.cost\n"
    assert main(there) == 0
    assert page.read_text() == before

    path = copy / "results" / "comparison.json"
    data = json.loads(path.read_text())
    data["levels"]["arena shunting ate_unaligned_m"][0][0] *= 2.0
    path.write_text(json.dumps(data))
    assert main([*there, "--check"]) == 1
    told = capsys.readouterr().out
    assert "docs/comparing.md: differs: comparing.errors" in told


def test_a_results_file_that_is_damaged_or_gone_is_named(copy: Path):
    there = ["--root", str(copy), "--results", str(copy / "results"), "--check"]
    path = copy / "results" / "comparison.json"
    data = json.loads(path.read_text())
    del data["paired"]["office ekf ate_unaligned_m"]
    path.write_text(json.dumps(data))
    with pytest.raises(LogFormatError, match="office ekf ate_unaligned_m"):
        main(there)
    for content in ("{", "[]", '{"schema": 0}'):
        path.write_text(content)
        with pytest.raises(LogFormatError, match=r"comparison\.json: no results file"):
            main(there)


def test_a_mark_that_nobody_fills_is_refused():
    with pytest.raises(InvalidValueError, match="page marks c, must be one of a, b"):
        quoted("<!-- c --><!-- /c -->", {"a": "", "b": ""}, "page")


def test_results_read_back_with_what_json_has_no_number_for(tmp_path: Path):
    tables = {
        "levels": {"arena shunting half_life_s": [None, [1.23456789, 1.0, math.inf]]},
        "rank_correlation": {"arena shunting lost": math.nan},
    }
    write(path := tmp_path / "r.json", {"schema": 1, "seeds": [100]}, tables)
    assert len(path.read_text().splitlines()) == 10
    found = Comparison(path)
    cells = found.row("levels", "arena", "shunting", "half_life_s")
    assert [interval(cell, "half_life_s", 2) for cell in cells] == ["–", "1.23 [1.00, ∞]"]
    assert shown(found.row("rank_correlation", "arena", "shunting", "lost"), 1) == "–"
    with pytest.raises(LogFormatError, match="office shunting lost"):
        found.row("levels", "office", "shunting", "lost")


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


def test_verdicts_follow_the_interval_and_which_way_is_better():
    less, neither, more = [-2.0, -3.0, -1.0], [-1.0, -2.0, 0.0], [0.1, 0.05, 0.2]
    assert [verdict(p, "ate_unaligned_m") for p in (less, neither, more, None)] == [1, 0, -1, 0]
    assert [verdict(p, "new_object_recall") for p in (less, neither, more)] == [-1, 0, 1]


@pytest.mark.parametrize("path", sorted(RESULTS.glob("*.json")), ids=lambda path: path.name)
def test_a_results_file_says_what_made_it(path: Path):
    data = load(path)
    assert re.fullmatch(r"[0-9a-f]{40}", data["commit"])
    assert all(row["seeds"] for row in data["costs"].values()) if "costs" in data else data["seeds"]
    assert data["command"]
    assert {"processor", "cores", "python"} <= data["machine"].keys()
    assert {"mobilia", "mujoco", "numpy", "numba"} <= data["versions"].keys()
    assert path.stat().st_size < 100_000

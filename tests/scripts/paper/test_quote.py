# SPDX-License-Identifier: Apache-2.0
"""Results on a page: tables between marks, pictures small and beside it."""

from pathlib import Path

import pytest
from PIL import Image

from scripts.paper.quote import quote
from scripts.paper.report import TABLE_3, Report, new_figure, paper_table
from scripts.paper.runs import Plan
from slam.errors import InvalidValueError

pytestmark = pytest.mark.docs
ROOT = Path(__file__).parents[3]


def test_a_page_quotes_what_was_run_and_keeps_the_rest(tmp_path):
    (tmp_path / "office").mkdir()
    (tmp_path / "office" / "summary.md").write_text("new \\1 numbers\n")
    (folder := tmp_path / "docs").mkdir()
    page = folder / "page.md"
    page.write_text("<!-- office -->\nold\n<!-- /office -->\nby hand\n<!-- chairs -->\nkept\n")
    assert quote(tmp_path, folder) == ["office"]
    told = page.read_text()
    assert told.startswith("<!-- office -->\n\nnew \\1 numbers\n\n<!-- /office -->\nby hand\n")
    assert told.endswith("<!-- chairs -->\nkept\n")
    assert quote(tmp_path, folder) == ["office"]
    assert page.read_text() == told
    (tmp_path / "chairs").mkdir()
    (tmp_path / "chairs" / "summary.md").write_text("more\n")
    with pytest.raises(InvalidValueError, match="/chairs"):
        quote(tmp_path, folder)
    page.write_text(mixed_up := "<!-- /chairs -->\nby hand\n<!-- chairs -->\nthe rest\n")
    (tmp_path / "office" / "summary.md").unlink()
    with pytest.raises(InvalidValueError, match="<!-- chairs --> before <!-- /chairs -->"):
        quote(tmp_path, folder)
    assert page.read_text() == mixed_up


def test_its_figures_come_along_and_those_of_before_go(tmp_path: Path):
    report = Report("office", Plan(out=tmp_path / "out", quick=True))
    figure, axes = new_figure(4.0, 3.0)
    axes[0].plot([0.0, 1.0])
    report.figure("rmse", figure, "RMSE of every seed")
    report.finish("Office")
    (folder := tmp_path / "docs" / "paper").mkdir(parents=True)
    (page := folder / "page.md").write_text("<!-- office -->\n<!-- /office -->\n")
    pictures = tmp_path / "docs" / "pictures" / "paper"
    pictures.mkdir(parents=True)
    for name in ("office-gone.png", "chairs-rmse.png"):
        (pictures / name).write_bytes(b"")
    quote(tmp_path / "out", folder)
    shown = "![RMSE of every seed](../pictures/paper/office-rmse.png)\n\n*RMSE of every seed*\n"
    assert shown in page.read_text()
    names = ["chairs-rmse.png", "office-rmse.png"]
    assert sorted(path.name for path in pictures.iterdir()) == names
    with Image.open(pictures / "office-rmse.png") as small:
        assert small.size == (520, 390)


def test_the_papers_table_stands_beside_ours_in_the_summary(tmp_path: Path):
    report = Report("chairs", Plan(out=tmp_path, quick=True))
    one = {f"{key} {q}": 0.5 for key in ("mean", "var_e", "var_p") for q in ("x", "y", "θ")}
    other = {name: 3.0 * value for name, value in one.items()}
    paper_table(report, "Table 3", TABLE_3, [{"ours": one}, {"ours": other}], ["ours"])
    assert "| x: mean(e), m | -0.2339 | 0.0762 | 0.5 | 1 [0.75, 1.2] |" in report.quoted
    assert "| θ: var(p), rad² | 1.4973 | 0.0592 | 0.5 | 1 [0.75, 1.2] |" in report.quoted

# SPDX-License-Identifier: Apache-2.0
"""The report's section over days: there where there are buildings, and only there."""

import html
import re
from pathlib import Path

import pytest

from scripts.report import page
from scripts.report.study import study
from slam.errors import LogFormatError
from tests.scripts.report import made

pytestmark = pytest.mark.film


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return made.add_days(made.make(tmp_path_factory.mktemp("days") / "compare"))


@pytest.fixture(scope="module")
def text(folder: Path) -> str:
    return page.render(study(folder))


def section(text: str) -> str:
    found = text.partition('<section id="days">')[2].partition("</section>")[0]
    return html.unescape(re.sub(r"<wbr>|&nbsp;", "", found))


def test_it_says_what_the_buildings_show(text: str):
    own = section(text)
    assert "<h3>room, motion 1, change 0.3</h3>" in own
    assert own.count("<caption>6 buildings of 5 sessions</caption>") == 2
    assert (
        "<code>shunting</code>: found 24 of 24 sessions from an unknown start, 24 within 10 s, "
        "never at a wrong place; error 2.75 cm in session 1, 4.25 cm in the last, 3.30 cm in a "
        "map 3 sessions old; ghosts 1.50 % early, 1.50 % late." in own
    )
    assert "<code>ekf</code>: starts anew: cannot load a map; error 2.75 cm" in own
    assert (
        "failed in 6 of 30 sessions, first: <code>scan 3, raised <RuntimeError>: enough</code>"
        in own
    )
    assert "<td>24 of 24<small>86 to 100 %</small></td><td>–</td>" in own
    assert "<td>starts anew<small>cannot load a map</small></td>" in own


def test_only_a_comparison_with_buildings_has_it_in_the_contents_and_the_command(
    text: str, tmp_path: Path
):
    assert '<a href="#days">Over days</a>' in text
    assert "--change 0.3 --sessions 5" in text
    without = page.render(study(made.make(tmp_path / "compare")))
    assert "days" not in without
    assert "sessions" not in without


def test_tables_that_are_not_whole_are_refused(tmp_path: Path):
    folder = made.add_days(made.make(tmp_path / "compare"), buildings=1)
    path = folder / "ages.csv"
    path.write_text(path.read_text().replace("found_soon,", "soon,", 1))
    with pytest.raises(LogFormatError, match="without the column 'found_soon'"):
        page.render(study(folder))
    path.unlink()
    with pytest.raises(LogFormatError, match=r"ages\.csv"):
        page.render(study(folder))

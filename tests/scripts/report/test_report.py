# SPDX-License-Identifier: Apache-2.0
"""The report says who wins where, opens from disk alone, and refuses what is no comparison."""

import json
import math
import re
import sys
from html.parser import HTMLParser
from pathlib import Path

import pytest
from typer.testing import CliRunner

from scripts import cli
from scripts.comparison import folder as files
from scripts.metrics.table import METRICS, digits
from scripts.report import page, tables
from scripts.report.study import study, verdict
from slam.errors import InvalidValueError, LogFormatError
from tests.scripts.report import made
from tests.scripts.report.browser import CHROMIUM, Browser

pytestmark = pytest.mark.film


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return made.make(tmp_path_factory.mktemp("report") / "compare")


@pytest.fixture(scope="module")
def written(folder: Path) -> Path:
    done = CliRunner().invoke(cli.app, ["report", str(folder)], catch_exceptions=False)
    assert done.exit_code == 0
    assert "report.html" in done.output
    return folder / page.REPORT


def test_with_few_runs_nobody_wins(tmp_path: Path):
    few = study(made.make(tmp_path / "few", seeds=(100, 101, 102, 103, 104)))
    cells = [
        cell
        for table in (
            tables.growth(few, "room"),
            *tables.of_levels(few, "room", [METRICS["ate_unaligned_m"], METRICS["lost"]]),
            *tables.of_pairs(few, "room", [METRICS["ate_unaligned_m"]]),
        )
        for row in table.rows
        for cell in row
    ]
    assert not any(" to " in cell.small or cell.mark for cell in cells)  # no interval, no winner
    assert "5 of 5" in [cell.text for cell in cells]  # a count is no share
    text = page.render(few)
    assert text.index("of such runs are lost") < text.index("<nav")


def test_a_pair_reads_the_same_from_both_sides(folder: Path):
    one = study(folder)
    ours = one.pair("room", 0.0, "ate_unaligned_m", "shunting", "ekf")
    theirs = one.pair("room", 0.0, "ate_unaligned_m", "ekf", "shunting")
    assert ours is not None
    assert theirs is not None
    assert ours["median_difference"] == -theirs["median_difference"] > 0.0
    assert (ours["low"], ours["high"]) == (-theirs["high"], -theirs["low"])
    assert (ours["wins"], ours["losses"]) == (theirs["losses"], theirs["wins"]) == (0, 6)
    for less_is_better in (True, False):
        assert verdict(ours, less_is_better) == -verdict(theirs, less_is_better) != 0


@pytest.mark.parametrize(
    ("low", "high", "n", "said"),
    [(0.1, 0.2, 6, -1), (-0.2, -0.1, 6, 1), (-0.1, 0.1, 6, 0), (0.0, 0.1, 6, 0), (0.1, 0.2, 5, 0),
     (None, 0.2, 9, 0), (math.inf, math.inf, 6, -1)],
)  # fmt: skip
def test_a_win_is_an_interval_beside_zero_of_enough_runs(low, high, n, said):
    assert verdict({"low": low, "high": high, "n": n}, less_is_better=True) == said


@pytest.mark.parametrize(
    ("value", "shown"),
    [(0.0, "0"), (1.0, "1.00"), (-0.01234, "−0.0123"), (99.96, "100"), (1234.5, "1234"),
     (9.996, "10.0"), (math.inf, "∞"), (1e-7, "1.0e−07")],
)  # fmt: skip
def test_numbers_are_shown_with_three_digits(value, shown):
    assert digits(value) == shown


def test_tables_show_units_intervals_and_failures(folder: Path):
    one = study(folder)
    (table,) = tables.of_levels(one, "room", [METRICS["ate_unaligned_m"]])
    assert table.caption == "position error (ATE), cm"
    assert [cell.text for cell in table.rows[1]] == ["1", "3.15", "31.5", "∞"]
    assert [cell.mark for cell in table.rows[1]] == ["", "best", "", ""]
    difference = tables.of_pairs(one, "room", [METRICS["ate_unaligned_m"]])[0].rows[0][1]
    assert (difference.text, difference.mark) == ("+1.05", "worse")
    assert difference.small.endswith("0–0–6")
    outcomes = tables.of_outcomes(one)[0].rows[2]
    assert [(cell.text, cell.small) for cell in outcomes[1:]] == [
        ("6 of 6", ""),
        ("0 of 6", "6 hung"),
    ]


def kept(folder: Path, keep) -> None:
    """Rewrite the tables of a comparison with some of its rows alone."""
    rows = [row for row in files.read(folder).runs if keep(row)]
    made.write_tables(folder, rows)
    recipe = json.loads((folder / "recipe.json").read_text())
    recipe["settings"]["slams"] = list(dict.fromkeys(row["slam"] for row in rows))
    recipe["settings"]["levels"] = sorted({row["dynamism"] for row in rows})
    (folder / "recipe.json").write_text(json.dumps(recipe))


def test_the_page_is_about_whom_one_asks(written: Path, tmp_path: Path):
    folder = made.make(tmp_path / "compare")
    with pytest.raises(InvalidValueError, match="--subject must be one of shunting, ekf, own:Hang"):
        study(folder, "karto")
    assert (study(folder).subject, study(folder, "ekf").subject) == ("shunting", "ekf")
    done = CliRunner().invoke(cli.app, ["report", str(folder), "--subject", made.OWN])
    ours, theirs = (path.read_text(encoding="utf-8") for path in (written, folder / page.REPORT))
    for text, slam in ((ours, made.OURS), (theirs, made.OWN)):
        assert f'<p class="answer"><code>{slam}</code>' in text
    assert "mobilia blame FOLDER/runs/room_d1_s105.npz --slam shunting" in ours
    assert (
        "room_d1_s" not in theirs.partition('<section id="maps">')[0]
    )  # it hung: nobody misled it
    failure = "`own:Hanging` hung in 6 of 12 runs, first in room at dynamism 1, seed 100: SLAM "
    assert failure in done.output
    assert "`own:Hanging` failed in room in 0 of 6 at dynamism 0 and 6 of 6 at 1" in done.output


def test_of_the_worst_lost_run_both_debuggers_are_offered(tmp_path: Path):
    folder = made.make(tmp_path / "compare")
    lost = {"outcome": "lost", "lost": 1, "lost_at_s": 1.0}
    rows = [row | (lost if row["slam"] == made.OURS else {}) for row in files.read(folder).runs]
    made.write_tables(folder, rows)
    done = CliRunner().invoke(cli.app, ["report", str(folder)], catch_exceptions=False)
    text = (folder / page.REPORT).read_text(encoding="utf-8")
    for verb in ("blame", "shrink"):
        command = f"mobilia {verb} %s/runs/room_d1_s105.npz --slam shunting"
        assert command % "FOLDER" in text
        assert command % folder in "".join(done.output.splitlines())


class Addresses(HTMLParser):
    """Everything that a page would fetch; and tags left open."""

    def __init__(self) -> None:
        super().__init__()
        self.found: list[str] = []

    def handle_starttag(self, tag, attrs):
        self.found += [f"{tag} {value}" for name, value in attrs
                       if name in ("src", "href", "xlink:href", "srcset", "data", "action")
                       and value and not value.startswith(("#", "data:"))]  # fmt: skip
        assert tag not in ("script", "link", "iframe", "object") or ("href", "data:,") in attrs


def test_the_page_is_one_file_and_the_same_each_time(folder: Path, written: Path):
    text = written.read_text(encoding="utf-8")
    parser = Addresses()
    parser.feed(text)
    assert parser.found == []
    assert not re.search(r"url\((?!#)|@import", text)
    assert "within &lt;10&gt; s" in text  # what a guest says is no HTML
    assert text.count("<svg") == 5 + 2 + 1 + 8  # curves, truth and a map, errors, moments
    assert page.render(study(folder)) == text


def damage(name: str):
    def cut(folder: Path) -> None:
        path = folder / name
        path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])

    return cut


def of_another_schema(folder: Path) -> None:
    recipe = json.loads((folder / "recipe.json").read_text())
    recipe["settings"]["compare_schema"] = 0
    (folder / "recipe.json").write_text(json.dumps(recipe))


@pytest.mark.parametrize(
    ("harm", "says"),
    [
        (
            lambda folder: (folder / "recipe.json").unlink(),
            "recipe.json: cannot be read: No such file",
        ),
        (lambda folder: (folder / "recipe.json").write_text("[1]"), "no recipe: not a JSON object"),
        (damage("recipe.json"), "recipe.json: no recipe: "),
        (of_another_schema, "no comparison of schema 1"),
        (lambda folder: (folder / "runs.csv").unlink(), "runs.csv: cannot be read"),
        (damage("runs/room_d1_s102.npz"), "room_d1_s102.npz: no whole NumPy archive"),
    ],
)
def test_what_is_no_comparison_is_told_in_a_line(tmp_path: Path, harm, says, monkeypatch, capsys):
    folder = made.make(tmp_path / "compare")
    harm(folder)
    monkeypatch.setattr(sys, "argv", ["mobilia", "report", str(folder)])
    with pytest.raises(SystemExit) as done:
        cli.main()
    assert done.value.code == 1
    told = capsys.readouterr().err
    assert says in told
    assert told.count("\n") == 1
    assert not (folder / page.REPORT).exists()
    with pytest.raises(LogFormatError):
        page.write(study(folder))


@pytest.mark.skipif(CHROMIUM is None, reason="no Chromium here (apt-get install chromium)")
def test_a_browser_shows_it_on_a_phone_and_on_a_desk(written: Path, tmp_path: Path):
    with Browser(tmp_path) as browser:
        for width in (390, 1280):
            browser.open(written, width)
            assert browser.evaluate("document.documentElement.scrollWidth") == width
            boxes = "[...document.querySelectorAll('.scroll, figure, p, h1, h2, h3, pre, dl')]"
            edge = f"Math.max(...{boxes}.map(box => box.getBoundingClientRect().right))"
            assert browser.evaluate(edge) <= width
            assert browser.evaluate("document.querySelectorAll('svg text').length") > 50
            boxes = "[...document.querySelectorAll('.scroll')]"
            hidden = f"{boxes}.filter(box => box.scrollWidth > box.clientWidth)"
            layers = "getComputedStyle(box).backgroundImage.split('gradient').length - 1"
            counts = browser.evaluate(f"{hidden}.map(box => {layers})")
            assert set(counts) <= {4}  # what scrolls sideways has shadows that say so
            assert counts or width > 390
        assert browser.console == []
        asked = {address for address in browser.requests if not address.startswith("data:")}
        assert asked == {written.as_uri()}
        assert browser.printed().startswith(b"%PDF")
        browser.call("Emulation.setEmulatedMedia", media="print")
        browser.open(written, 688)  # A4 without its margins
        edge = edge.replace(".scroll, figure", "table, svg")
        assert browser.evaluate(edge) <= 688


def other_folder(tmp_path: Path, kind: str) -> Path:
    folder = tmp_path / kind
    folder.mkdir()
    if kind == "dataset":
        (folder / "dataset.json").write_text("{}")
    elif kind == "episode":
        (folder / "recipe.json").write_text('{"recipe": {}}')
    elif kind != "empty":
        (folder / "recipe.json").write_text(json.dumps({"command": kind}))
    if kind == "drive":
        (folder / "runs.csv").write_text("scene\n")
    return folder


@pytest.mark.parametrize(
    ("kind", "says"),
    [
        ("run", "is of mobilia run: a report is about a comparison, mobilia compare --slam"),
        ("dataset", "is a dataset of mobilia generate"),
        ("episode", "is an episode of mobilia generate"),
        ("drive", "index.html there is its page"),
        ("benchmark", "index.html there is its page"),
        ("compare", "is unfinished: the same mobilia compare again goes on"),
        ("empty", "holds no comparison: mobilia compare --slam A B --out DIR"),
    ],
)
def test_another_folder_is_told_which_verb_is_missing(tmp_path: Path, kind: str, says: str):
    folder = other_folder(tmp_path, kind)
    with pytest.raises(LogFormatError, match=re.escape(says)) as told:
        CliRunner().invoke(cli.app, ["report", str(folder)], catch_exceptions=False)
    assert str(folder) in str(told.value)

# SPDX-License-Identifier: Apache-2.0
"""The leaderboard's section over days: what it runs, what it says, how it gets into the docs."""

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from scripts.benchmark import days, picture, publish
from scripts.benchmark.runs_file import read
from scripts.benchmark.tracks import TEST
from scripts.cli import app
from scripts.days import scores
from scripts.days.buildings import identity, name_of
from scripts.results import check
from slam.errors import LogFormatError
from tests.scripts.report.made import OURS, OWN, session_of

pytestmark = pytest.mark.slow
PAGE = Path(__file__).resolve().parents[3] / "docs" / "leaderboard.md"


def rows(seeds=6):
    """Six buildings of five sessions at each share of change; the guest fails in one of each."""
    found = []
    for change in days.CHANGES:
        for slam in (OURS, OWN):
            for seed in TEST[:seeds]:
                of = {"scene": "r", "motion": 0.0, "change": change, "seed": seed, "slam": slam}
                own = [session_of(slam, k, 0) for k in range(5)]
                found.append(
                    scores.of_building(of, own, (), "it `raised`" if slam == OWN else None)
                )
    return found


def test_it_is_eleven_sessions_at_two_shares_of_change_and_a_quick_one_begins_it():
    whole = days.buildings(["shunting", "odometry"], TEST[:2])
    assert whole.slams == ("shunting", "odometry")
    assert whole.sessions == 11
    assert [name_of(r) for r in whole.recipes] == [
        "random-rooms_m0_c0.3_s720", "random-rooms_m0_c0.3_s721",
        "random-rooms_m0_c0.6_s720", "random-rooms_m0_c0.6_s721",
    ]  # fmt: skip
    assert identity(whole.recipes[0])["motion"] == 0.0
    quick = days.buildings(["shunting"], TEST[:1], quick=True)
    (own,) = quick.recordings().values()
    its = whole.recordings()["random-rooms_m0_c0.3_s720"]
    assert [job.file_name() for job in own] == [job.file_name() for job in its[:4]]


def test_what_is_written_is_read_back_and_makes_the_same_section(tmp_path):
    days.write(tmp_path, {"schema": 1}, rows())
    back = days.read(tmp_path / "days.json")
    assert [row["slam"] for row in back] == [row["slam"] for row in rows()]
    assert back[0]["rmse_session1_m"] == pytest.approx(0.025)
    assert back[0]["rmse_age10_m"] is None
    assert days.section(back) == days.section(rows())
    text = days.section(back)
    assert text.startswith("## Over days\n")
    assert "### r, motion 0, change 0.6: 6 buildings of 5 sessions" in text
    assert "- `shunting`: found 24 of 24 sessions from an unknown start" in text
    assert "| map | loaded [in each session] | starts anew [cannot load a map] |" in text
    assert "failed in 6 of 30 sessions, first: `it 'raised'`." in text
    assert days.summary(back)["0.3 shunting"]["found_share"]["n"] == 24


@pytest.mark.parametrize(
    "text", ["{", '{"schema": 2}', '{"schema": 1}', '{"schema": 1, "rows": {"a": {"slam": "b"}}}']
)
def test_what_is_no_section_is_refused(tmp_path, text):
    (tmp_path / "days.json").write_text(text)
    with pytest.raises(LogFormatError):
        days.read(tmp_path / "days.json")
    assert publish.main([str(tmp_path), "--docs", str(tmp_path / "docs")]) == 1


def test_it_is_published_alone_and_in_place_of_an_older_one(tmp_path):
    docs = tmp_path / "docs"
    (docs / "pictures").mkdir(parents=True)
    for page, mark, _ in publish.blocks(read(), rows()):
        with (docs / page).open("a") as file:
            file.write(f"<!-- {mark} -->\n<!-- /{mark} -->\n")
    (tmp_path / "out").mkdir()
    told = {"schema": 1, "slams": ["shunting"], "seeds": [720, 721]}
    days.write(tmp_path / "out", told, rows())
    words = [str(tmp_path / "out"), "--docs", str(docs), "--results", str(docs), "--commit", "abc"]
    for _ in range(2):
        assert publish.main(words) == 0
    page = (docs / "leaderboard.md").read_text()
    assert page.count(f"<!-- days -->\n\n{days.section(rows(), tables=False)}\n") == 1
    for name, mark, told in publish.blocks(read(), rows()):
        assert f"<!-- {mark} -->\n\n{told}\n\n<!-- /{mark} -->" in (docs / name).read_text()
    assert {path.name for path in (docs / "pictures").iterdir()} == set(picture.NAMES)
    assert (docs / "days.csv").read_text().startswith("scene,motion,change,slam,metric,")
    copied = json.loads((docs / "days.json").read_text())
    command = "python -m scripts.benchmark.days out/days --slam shunting --seeds 2"
    assert (copied["commit"], copied["command"]) == ("abc", command)


def test_a_second_call_makes_nothing_again_and_adds_the_section_of_days(tmp_path, monkeypatch):
    monkeypatch.setattr(days, "QUICK_SESSIONS", 2)
    words = (
        f"benchmark --slam odometry --tracks busy-chairs --quick --seeds 1 --seconds 1.2 "
        f"--out {tmp_path / 'out'}"
    ).split()
    done = CliRunner().invoke(app, words)
    assert done.exit_code == 0, (done.output, done.exception)
    before = (tmp_path / "out/leaderboard.md").read_text()
    table = (tmp_path / "out/leaderboard.csv").read_bytes()
    assert not (tmp_path / "out/days.csv").exists()
    jobs = (file for kind in ("recordings", "entries") for file in tmp_path.rglob(f"{kind}/*.npz"))
    made = {file: file.stat().st_mtime_ns for file in jobs}
    assert len(made) == 12  # three recordings; the control and two oracles on each
    done = CliRunner().invoke(app, [*words, "--days"])
    assert done.exit_code == 0, (done.output, done.exception)
    assert "`odometry`: starts anew: cannot load a map" in " ".join(done.output.split())
    assert {file: file.stat().st_mtime_ns for file in made} == made
    text = (tmp_path / "out/leaderboard.md").read_text()
    assert text == f"{before}\n{days.section(days.read(tmp_path / 'out/days.json'))}\n"
    assert (tmp_path / "out/leaderboard.csv").read_bytes() == table
    board = json.loads((tmp_path / "out/leaderboard.json").read_text())
    assert list(board["days"]) == ["0.3 odometry"]
    assert {finding.verdict + finding.why for finding in check(tmp_path / "out")} == {"whole"}


def test_the_page_is_made_from_the_results():
    results = PAGE.parent / "results" / "days.json"
    if results.exists():
        assert f"\n{days.section(days.read(results), tables=False)}\n" in PAGE.read_text()
    else:
        assert days.HEADING not in PAGE.read_text()

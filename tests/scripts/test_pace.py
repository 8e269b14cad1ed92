# SPDX-License-Identifier: Apache-2.0
"""Estimates come from what work took before, in a cache that nobody has to have."""

import pytest

from scripts import pace
from scripts.pace import Work

SLOWER = pace.slower


@pytest.fixture(autouse=True)
def cache(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr(pace, "slower", lambda processes: 1.0)


def test_what_ran_before_tells_how_long_it_takes(capsys):
    works = [Work("run a", 10.0), Work("run a", 30.0)]
    assert pace.estimate(works) is None
    pace.announce("two runs", works)
    assert "not known yet" in capsys.readouterr().out
    pace.learn([(Work("run a", 5.0), 10.0)])
    assert pace.estimate(works) == pytest.approx(80.0)
    assert pace.estimate(works, processes=2) == pytest.approx(60.0)  # the longer one alone
    assert pace.estimate([Work("run b", 1.0)]) == pytest.approx(2.0)  # like the others
    assert pace.estimate([Work("walk a")]) is None
    pace.learn([(Work("run a", 5.0), 15.0)])  # a slower one counts in part
    assert pace.rates()["run a"] == pytest.approx(0.6 * 2.0 + 0.4 * 3.0)
    pace.learn([(Work("run a", 5.0), 8.0)])  # a faster one at once
    pace.announce("two runs", works)
    assert capsys.readouterr().out == "Ahead: two runs; about 65 s.\n"
    pace.learn([(Work("run b", 1.0), 1.0), (Work("run c", 1.0), 9.0)])
    assert pace.estimate([Work("run d", 1.0)]) == pytest.approx(1.6)
    assert pace.estimate([]) == 0.0


def test_a_busy_machine_takes_longer(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("os.cpu_count", lambda: 2)
    for text, times in (("3.00 1 1 6/99 7", 2.0), ("3.00 1 1 1/99 7", 1.0), ("", 1.0)):
        (tmp_path / "loadavg").write_text(text)
        assert SLOWER(1, tmp_path / "loadavg") == times
    assert SLOWER(1, tmp_path / "none") == 1.0
    monkeypatch.setattr(pace, "slower", lambda processes: 2.0)
    pace.learn([(Work("run a"), 20.0)])
    assert pace.estimate([Work("run a")]) == 10.0  # alone
    pace.announce("a run", [Work("run a")])
    assert capsys.readouterr().out == "Ahead: a run; about 20 s beside what else runs here.\n"


@pytest.mark.parametrize("text", ["", "[]", "{", '{"run a": "x"}', '{"run a": Infinity}', "\x00"])
def test_a_damaged_cache_is_none(text):
    pace.state().parent.mkdir(parents=True)
    pace.state().write_text(text)
    assert pace.estimate([Work("run a")]) is None
    pace.learn([(Work("run a"), 2.0)])
    assert pace.estimate([Work("run a")]) == 2.0


def test_a_cache_that_cannot_be_written_is_left(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    pace.learn([(Work("run a"), 2.0)])
    with pytest.raises(ValueError, match="it failed"), pace.timed(Work("run a")):
        raise ValueError("it failed")
    assert pace.rates() == {}

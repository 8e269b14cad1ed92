# SPDX-License-Identifier: Apache-2.0
"""Jobs: whole files or none, and what is there is not made again."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import pytest

from scripts import jobs
from scripts.jobs import Job, run_jobs
from slam.errors import InvalidValueError, SlamFailedError


def write(path: Path, *, text: str) -> None:
    path.write_text(text)


def write_half_and_fail(path: Path, *, text: str) -> None:
    path.write_text(text[: len(text) // 2])
    raise RuntimeError("half")


def a_job(name: str, text: str, call=write) -> Job:
    return Job(name=name, call=call, arguments={"text": text}, suffix=".txt")


def test_what_is_there_is_not_made_again(tmp_path):
    first = run_jobs([a_job("a", "one"), a_job("b", "two")], tmp_path)
    assert {name: file.read_text() for name, file in first.items()} == {"a": "one", "b": "two"}
    before = first["a"].stat().st_mtime_ns
    again = run_jobs([a_job("a", "one")], tmp_path)
    assert again["a"].stat().st_mtime_ns == before


def cut(file: Path) -> None:
    file.write_text(file.read_text()[:-1])


def flip(file: Path) -> None:
    file.write_text("x" + file.read_text()[1:])


@pytest.mark.parametrize("damage", [cut, flip, Path.unlink])
@pytest.mark.parametrize("which", ["", ".sha256"])
def test_a_damaged_result_is_named_and_made_again(tmp_path, capsys, damage, which):
    (file,) = run_jobs([a_job("a", "one")], tmp_path).values()
    capsys.readouterr()
    damage(file.with_name(file.name + which))
    (again,) = run_jobs([a_job("a", "one")], tmp_path).values()
    told = capsys.readouterr().out.replace("\n", "")
    if damage is not Path.unlink or which:
        assert "made again" in told
        assert file.name in told
    assert (again, again.read_text()) == (file, "one")
    run_jobs([a_job("a", "one")], tmp_path)
    assert "made again" not in capsys.readouterr().out


def test_other_arguments_code_data_and_versions_are_other_files(tmp_path, monkeypatch):
    (package := tmp_path / "package" / "parts").mkdir(parents=True)
    (package / "code.py").write_text("1")
    (package / "part.xml").write_text("<a/>")

    def name(text: str = "one") -> str:
        jobs._digest.cache_clear()
        jobs._versions.cache_clear()
        return replace(a_job("a", text), code=[tmp_path / "package"]).file_name()

    names = [name(), name("two"), a_job("a", "one").file_name()]
    for neither in ("__pycache__", ".hidden"):
        (package / neither).mkdir()
        (package / neither / "code.bin").write_text("2")
    assert name() == names[0]
    (package / "part.xml").write_text("<b/>")
    names.append(name())
    (package / "part.xml").rename(package / "moved.xml")
    names.append(name())
    monkeypatch.setattr(jobs, "_versions", cache(lambda: {"numpy": "9.9"}))
    assert len({*names, name()}) == 6


def test_a_failing_job_is_named_and_leaves_nothing(tmp_path):
    jobs = [a_job("good", "one"), a_job("bad", "two", write_half_and_fail)]
    with pytest.raises(SlamFailedError, match="bad: RuntimeError: half"):
        run_jobs(jobs, tmp_path)
    assert {file.name.partition("-")[0] for file in tmp_path.iterdir()} == {"good"}


def test_names_are_unique_and_plain(tmp_path):
    with pytest.raises(InvalidValueError, match="two jobs are called 'a'"):
        run_jobs([a_job("a", "one"), a_job("a", "two")], tmp_path)
    with pytest.raises(InvalidValueError, match="name"):
        a_job("a/b", "one")
    with pytest.raises(InvalidValueError, match="processes"):
        run_jobs([a_job("a", "one")], tmp_path, processes=0)

# SPDX-License-Identifier: Apache-2.0
"""Jobs: whole files or none, what is there is not made again, and a killed run goes on."""

import os
import signal
import subprocess
import sys
import time
from functools import cache
from pathlib import Path

import pytest

from scripts import jobs
from scripts.jobs import Job, run_jobs
from slam.errors import InvalidValueError, SlamFailedError

REPO = Path(__file__).resolve().parents[2]


def write(path: Path, *, text: str) -> None:
    path.write_text(text)


def write_half_and_fail(path: Path, *, text: str) -> None:
    path.write_text(text[: len(text) // 2])
    raise RuntimeError("half")


def write_slowly(path: Path, *, k: int) -> None:
    path.write_text("half")
    time.sleep(0.1)
    path.write_text(f"whole {k}")


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


def test_other_arguments_and_other_code_are_other_files(tmp_path):
    source = tmp_path / "source.py"
    source.write_text("1")
    plain, other = a_job("a", "one"), a_job("a", "two")
    coded = Job(name="a", call=write, arguments={"text": "one"}, suffix=".txt", code=[source])
    assert len({job.file_name() for job in (plain, other, coded)}) == 3
    assert plain.file_name() == a_job("a", "one").file_name()


def test_other_data_and_other_versions_are_other_files(tmp_path, monkeypatch):
    (package := tmp_path / "package" / "parts").mkdir(parents=True)
    (package / "code.py").write_text("1")
    (package / "part.xml").write_text("<a/>")

    def name() -> str:
        jobs._digest.cache_clear()
        jobs._versions.cache_clear()
        code = [tmp_path / "package"]
        return Job(name="a", call=write, arguments={}, code=code).file_name()

    before = name()
    for neither in ("__pycache__", ".hidden"):
        (package / neither).mkdir()
        (package / neither / "code.bin").write_text("2")
    assert name() == before
    (package / "part.xml").write_text("<b/>")
    assert (other := name()) != before
    (package / "part.xml").rename(package / "moved.xml")
    assert (moved := name()) not in (before, other)
    monkeypatch.setattr(jobs, "_versions", cache(lambda: {"numpy": "9.9"}))
    assert name() not in (before, other, moved)


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


def slow_jobs() -> list[Job]:
    return [
        Job(name=f"j{k}", call=write_slowly, arguments={"k": k}, suffix=".txt") for k in range(8)
    ]


def test_killed_and_resumed(tmp_path):
    """Kill -9 in the middle: every file there is whole; the next call makes the others."""
    script = (
        "from pathlib import Path; from scripts.jobs import run_jobs; "
        "from tests.scripts.test_jobs import slow_jobs; "
        f"run_jobs(slow_jobs(), Path({str(tmp_path)!r}))"
    )
    process = subprocess.Popen([sys.executable, "-c", script], cwd=REPO)
    while len(list(tmp_path.glob("j*.txt"))) < 2 and process.poll() is None:
        time.sleep(0.02)
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    there = sorted(tmp_path.glob("j*.txt"))
    assert 2 <= len(there) < 8
    assert all(file.read_text().startswith("whole") for file in there)
    before = {file.name: file.stat().st_mtime_ns for file in there}
    files = run_jobs(slow_jobs(), tmp_path, processes=2)
    assert [files[f"j{k}"].read_text() for k in range(8)] == [f"whole {k}" for k in range(8)]
    assert {name: (tmp_path / name).stat().st_mtime_ns for name in before} == before
    assert not list(tmp_path.glob(".*"))

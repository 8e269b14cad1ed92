# SPDX-License-Identifier: Apache-2.0
"""A study: stage by stage, resumed after a kill, tables whole or as they were."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from scripts.engine import Stage, Study, carry_out
from scripts.jobs import Job
from slam.errors import InvalidValueError, SlamFailedError, UnknownNameError
from slam.files import write_text

REPO = Path(__file__).resolve().parents[2]


def drawn(path: Path, *, k: int, wait_s: float) -> None:
    time.sleep(wait_s)
    path.write_text(str(10 * k))


def doubled(path: Path, *, of: str) -> None:
    """Reads what the stage before has made."""
    path.write_text(str(2 * int((path.parents[1] / "drawn" / of).read_text())))


def job(name: str, call, **arguments) -> Job:
    return Job(name=name, call=call, arguments=arguments, suffix=".txt")


def study(*, wait_s: float = 0.0, broken: bool = False, **names) -> Study[list[int]]:
    """Three numbers, drawn and then doubled; the table has a line for each."""
    first = [
        Job(name=f"n{k}", call=drawn, arguments={"k": k, "wait_s": wait_s}, suffix=".txt")
        for k in range(3)
    ]
    second = [
        Job(
            name=f"{job.name}_twice", call=doubled, arguments={"of": job.file_name()}, suffix=".txt"
        )
        for job in first
    ]

    def write(folder: Path, files) -> list[int]:
        found = [int(files[one.name].read_text()) for one in second]
        write_text(folder / "runs.csv", "\n".join(map(str, found)))
        if broken:
            raise SlamFailedError("no picture")
        return found

    return Study(
        command="count", settings={"n": 3}, slams=names.get("slams", ()),
        scenes=names.get("scenes", ()), write=write,
        stages=[
            Stage(title="drawing", folder="drawn", jobs=first),
            Stage(title="doubling", folder="doubled", jobs=second),
        ],
    )  # fmt: skip


def test_it_is_made_stage_by_stage_and_what_is_there_stays(tmp_path):
    out, wanted = tmp_path / "out", study()
    assert [len(stage.missing(out)) for stage in wanted.stages] == [3, 3]
    assert carry_out(wanted, out, jobs=2) == [0, 20, 40]
    assert [len(stage.missing(out)) for stage in wanted.stages] == [0, 0]
    assert (out / "runs.csv").read_text().split() == ["0", "20", "40"]
    recipe = json.loads((out / "recipe.json").read_text())
    assert (recipe["command"], recipe["settings"]["n"]) == ("count", 3)
    assert "processor" in recipe["settings"]["machine"]
    made = {file: file.stat().st_mtime_ns for file in out.glob("d*/*.txt")}
    (gone,) = out.glob("doubled/n1_*.txt")
    gone.unlink()
    assert carry_out(wanted, out) == [0, 20, 40]
    again = {file: file.stat().st_mtime_ns for file in made}
    assert {file for file in made if made[file] != again[file]} == {gone}


def test_tables_that_cannot_be_written_leave_those_of_before(tmp_path):
    out = tmp_path / "out"
    carry_out(study(), out)
    before = {file.name: file.read_bytes() for file in out.iterdir() if file.is_file()}
    (out / "runs.csv").write_text("mine")
    with pytest.raises(SlamFailedError, match="no picture"):
        carry_out(study(broken=True), out)
    assert (out / "runs.csv").read_text() == "mine"
    carry_out(study(), out)
    assert {file.name: file.read_bytes() for file in out.iterdir() if file.is_file()} == before


@pytest.mark.parametrize(
    "wrong",
    [
        {"slams": ["nobody"]}, {"slams": ["shunting{nothing=1}"]}, {"slams": ["no_module:Slam"]},
        {"slams": ["oracle(nobody)"]}, {"scenes": ["nowhere"]}, {"scenes": ["no_module:room"]},
    ],
)  # fmt: skip
def test_wrong_names_are_told_before_anything_starts(tmp_path, wrong):
    with pytest.raises((UnknownNameError, InvalidValueError, SlamFailedError)):
        carry_out(study(**wrong), tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_killed_it_goes_on(tmp_path):
    """Kill -9 on the way: what is there is kept, and the tables are those of a run in one go."""
    command = (
        "from pathlib import Path; from scripts.engine import carry_out; from tests.scripts "
        f"import test_engine as t; carry_out(t.study(wait_s=0.2), Path({str(tmp_path / 'a')!r}))"
    )
    process = subprocess.Popen([sys.executable, "-c", command], cwd=REPO)
    while not list(tmp_path.glob("a/drawn/n*.txt")) and process.poll() is None:
        time.sleep(0.02)
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    kept = {file: file.stat().st_mtime_ns for file in tmp_path.glob("a/d*/n*.txt")}
    assert 0 < len(kept) < 6
    assert not (tmp_path / "a" / "runs.csv").exists()
    for name in ("a", "b"):
        carry_out(study(wait_s=0.2), tmp_path / name, jobs=3)
    assert {file: file.stat().st_mtime_ns for file in kept} == kept
    told = [
        {f.relative_to(tmp_path / name): f.read_bytes() for f in (tmp_path / name).rglob("*.*")}
        for name in ("a", "b")
    ]
    assert told[0] == told[1]

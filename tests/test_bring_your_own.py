# SPDX-License-Identifier: Apache-2.0
"""docs/bring_your_own.md and docs/jobs/my_slam.md do what they say, in an empty folder."""

import csv
import json
import os
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from scripts.cli import app
from slam import create
from slam.guests.pipe import Limits
from slam.replay import Track
from tests.world2d import World2D, arena, frames, laser, wander

pytestmark = pytest.mark.docs
REPO = Path(__file__).resolve().parents[1]
EXAMPLES = REPO / "docs" / "examples"
PAGE = (REPO / "docs" / "bring_your_own.md").read_text()
JOB = (REPO / "docs" / "jobs" / "my_slam.md").read_text()


def run(*command: str, cwd: Path) -> str:
    environment = {**os.environ, "PYTHONPATH": str(REPO), "COLUMNS": "200"}
    done = subprocess.run(
        command, capture_output=True, text=True, cwd=cwd, env=environment, check=False, timeout=120
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def blocks(page: str) -> list[tuple[str, str]]:
    """The blocks of a page: language, text."""
    return re.findall(r"```(\w+)\n(.*?)```", page, flags=re.DOTALL)


def mobilia(line: str) -> str:
    """What the command prints, in one line."""
    done = CliRunner().invoke(app, shlex.split(line)[1:], catch_exceptions=False)
    assert done.exit_code == 0, done.output
    return " ".join(done.output.split())


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """An empty folder to stand in, whose modules can be imported."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    sys.modules.pop("my_slam", None)  # of another test
    yield tmp_path
    sys.modules.pop("my_slam", None)


def test_the_class_of_the_job_says_what_the_page_says(folder: Path):
    """Its first two runs, as printed; ``blame`` takes a minute, and has tests of its own."""
    (_, code), (_, run_it), (_, printed), (_, in_a_crowd), (_, in_the_crowd) = blocks(JOB)[:5]
    (folder / "my_slam.py").write_text(code)
    assert printed.strip() in mobilia(run_it)
    assert in_the_crowd.strip() in mobilia(in_a_crowd)


def test_the_page_runs_from_top_to_bottom(folder: Path):
    (folder / "docs").symlink_to(REPO / "docs")
    languages = [language for language, _ in blocks(PAGE)]
    assert languages == ["python", "sh", "python", "sh", "sh", "json"]
    printed = ""
    for language, block in blocks(PAGE):
        named = re.match(r"# (\w+\.py)\n", block)
        if named:
            (folder / named[1]).write_text(block)
        elif language == "python":
            exec(block, {})
        elif block.startswith(".venv/bin/mobilia"):
            mobilia(block)
        elif language == "sh":
            printed = run("sh", "-ec", block, cwd=folder)
        else:
            assert printed == block
    assert json.loads((folder / "out/mine/results.json").read_text())["slams"]["my_slam:MySlam"]
    rows = list(csv.DictReader((folder / "out/compare/runs.csv").read_text().splitlines()))
    assert {row["outcome"] for row in rows} == {"finished"}
    assert len({row["ate_unaligned_m"][:9] for row in rows}) == 1  # all believe the wheels


def test_the_page_states_the_limits_that_hold():
    limits = Limits()
    assert f"{limits.scan_s:g} s for a scan; {limits.first_s:g} s for the start" in PAGE


@pytest.mark.skipif(shutil.which("g++") is None, reason="no C++ compiler here")
def test_the_program_in_cpp_believes_the_wheels(tmp_path: Path):
    program = tmp_path / "pipe_slam"
    source = EXAMPLES / "pipe_slam.cpp"
    run("g++", "-std=c++17", "-Wall", "-Wextra", "-Werror", str(source), "-o", str(program),
        cwd=tmp_path)  # fmt: skip
    stream = frames(World2D(arena()), wander(4.0), rate_hz=5.0, spec=laser(181), seed=4)[:12]
    told, wheels = Track("cpp", create(f"pipe:{program}")), Track("here", create("odometry"))
    assert (told.survive(stream), wheels.survive(stream)) == (None, None)
    np.testing.assert_allclose(told.online().poses, wheels.online().poses, atol=1e-12)
    assert told.map() is None
    told.system.reset()
    np.testing.assert_array_equal(told.system.update(stream[5]).T_map_robot, 0.0)

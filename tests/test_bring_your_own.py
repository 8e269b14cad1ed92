# SPDX-License-Identifier: Apache-2.0
"""docs/bring_your_own.md does what it says: its blocks are run in order, in an empty folder."""

import csv
import json
import os
import re
import shlex
import shutil
import subprocess
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
BLOCKS = re.findall(r"```(\w+)\n(.*?)```", PAGE, flags=re.DOTALL)


def run(*command: str, cwd: Path) -> str:
    environment = {**os.environ, "PYTHONPATH": str(REPO), "COLUMNS": "200"}
    done = subprocess.run(
        command, capture_output=True, text=True, cwd=cwd, env=environment, check=False, timeout=120
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_the_page_runs_from_top_to_bottom(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    (tmp_path / "docs").symlink_to(REPO / "docs")
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    languages = [language for language, _ in BLOCKS]
    assert languages == ["python", "sh", "python", "python", "sh", "sh", "json"]
    printed = ""
    for language, block in BLOCKS:
        named = re.match(r"# (\w+\.py)\n", block)
        if named:
            (tmp_path / named[1]).write_text(block)
        elif language == "python":
            exec(block, {})
        elif block.startswith(".venv/bin/mobilia"):
            done = CliRunner().invoke(app, shlex.split(block)[1:], catch_exceptions=False)
            assert done.exit_code == 0, done.output
        elif language == "sh":
            printed = run("sh", "-ec", block, cwd=tmp_path)
        else:
            assert printed == block
    assert json.loads((tmp_path / "out/mine/results.json").read_text())["slams"]["my_slam:MySlam"]
    rows = list(csv.DictReader((tmp_path / "out/compare/runs.csv").read_text().splitlines()))
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

# SPDX-License-Identifier: Apache-2.0
"""The README does what it says: every Python block runs, and the two commands come early."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

REPO = Path(__file__).resolve().parents[1]
README = (REPO / "README.md").read_text()
BLOCKS = re.findall(r"```python\n(.*?)```", README, flags=re.DOTALL)


def run(*command: str, cwd: Path = REPO) -> str:
    environment = {**os.environ, "PYTHONPATH": str(REPO), "COLUMNS": "200"}
    done = subprocess.run(
        [sys.executable, *command], capture_output=True, text=True, cwd=cwd, env=environment,
        check=False, timeout=120,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_the_two_commands_come_within_forty_lines():
    lines = README.splitlines()[:40]
    assert any("make demo" in line for line in lines)
    assert any("make test" in line for line in lines)


def test_the_environment_example_runs():
    run("-c", next(block for block in BLOCKS if "gymnasium.make" in block))


def test_the_stream_example_ends_near_the_truth():
    printed = run("-c", next(block for block in BLOCKS if "sim.simulation" in block))
    numbers = [float(word) for word in re.findall(r"-?\d+\.?\d*(?:e[-+]?\d+)?", printed)]
    assert max(abs(a - b) for a, b in zip(numbers[:3], numbers[3:], strict=True)) < 0.05


def test_a_slam_of_twenty_lines_plugs_in(tmp_path: Path):
    block = next(block for block in BLOCKS if "class MySlam" in block)
    code = [line for line in block.splitlines() if line.strip()]
    assert len(code) <= 20
    (tmp_path / "my_slam.py").write_text(block)
    printed = run(
        "-m", "scripts", "run", "my_slam:MySlam", "--scene", "arena", "--seconds", "1",
        "--no-film", "--out", "out", cwd=tmp_path,
    )  # fmt: skip
    assert "my_slam:MySlam" in printed


def test_slam_needs_no_simulator():
    forbidden = "('mujoco', 'gymnasium', 'sim', 'scenes')"
    code = (
        "import importlib, pkgutil, sys, slam\n"
        "for m in pkgutil.walk_packages(slam.__path__, 'slam.'): importlib.import_module(m.name)\n"
        f"print([name for name in {forbidden} if name in sys.modules])"
    )
    assert run("-c", code).strip() == "[]"


def test_every_dependency_is_explained():
    import tomllib

    project = tomllib.loads((REPO / "pyproject.toml").read_text())["project"]
    section = README.split("## Why each dependency")[1].split("##")[0]
    for requirement in project["dependencies"]:
        assert f"`{re.split('[<>=]', requirement)[0]}`" in section


@pytest.mark.parametrize("page", [REPO / "README.md", *sorted((REPO / "docs").glob("*.md"))])
def test_every_link_leads_somewhere(page: Path):
    for target in re.findall(r"\]\(([^)#]+)", page.read_text()):
        if "://" not in target:
            assert (page.parent / target).exists(), f"{page.name} links to {target}"


def test_the_dataset_commands_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """As printed, but shorter episodes and no film."""
    from typer.testing import CliRunner

    from scripts.cli import app

    section = README.split("## Make a dataset")[1].split("\n## ")[0]
    assert len(section.strip().splitlines()) <= 10
    commands = re.findall(r"\.venv/bin/mobilia ([^#\n]+)", section)
    assert [command.split()[0] for command in commands] == ["generate", "verify", "export", "run"]
    monkeypatch.chdir(tmp_path)
    for command in commands:
        short = command.replace("--seconds 20", "--seconds 1").replace(
            "--episodes 4", "--episodes 2"
        )
        words = short.split()
        words += ["--no-film"] if words[0] == "run" else []
        done = CliRunner().invoke(app, words, catch_exceptions=False)
        assert done.exit_code == 0, done.output
    assert (tmp_path / "out" / "office" / "SHA256SUMS").exists()
    assert (tmp_path / "out" / "office" / "office-d0.5-s0001.log.gz").exists()

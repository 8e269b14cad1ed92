# SPDX-License-Identifier: Apache-2.0
"""docs/benchmark.md does what it says, followed from a folder outside, with a SLAM of one's own."""

import json
import re
import shlex
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from typer.testing import CliRunner

from scripts.benchmark.make import Wanted
from scripts.cli import app
from scripts.comparison import again
from scripts.comparison.folder import read
from slam.errors import InvalidValueError

pytestmark = pytest.mark.slow
DOCS = Path(__file__).resolve().parents[3] / "docs"
SHORT = "--tracks busy-chairs --quick --seeds 1 --seconds 1.2"  # the same words, but minutes less
MOST_LINES = 15


@pytest.fixture
def outside(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A folder with nothing in it but the class of docs/bring_your_own.md."""
    page = (DOCS / "bring_your_own.md").read_text()
    block = next(b for b in re.findall(r"```python\n(.*?)```", page, re.DOTALL) if "MySlam:" in b)
    (tmp_path / "my_slam.py").write_text(block)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [*sys.path, str(tmp_path)])
    yield tmp_path
    sys.modules.pop("my_slam", None)


def call(line: str) -> str:
    done = CliRunner().invoke(app, shlex.split(line)[1:])
    assert done.exit_code == 0, (done.output, done.exception)
    return " ".join(done.output.split())


def test_submit_verify_and_merge(outside: Path):
    section = (DOCS / "benchmark.md").read_text().split("## Submit a result")[1].split("\n## ")[0]
    assert len(section.strip().splitlines()) <= MOST_LINES
    (block,) = re.findall(r"```sh\n(.*?)```", section, re.DOTALL)
    submit, verify, merge = block.strip().splitlines()

    printed = call(f"{submit} {SHORT}")
    assert "`my_slam:MySlam` was lost in" in printed
    file = outside / "out/benchmark/submission_my_slam.json"
    data = json.loads(file.read_text())
    assert data["submitted"]["slam"] == "my_slam:MySlam"
    assert len(data["runs"]) == 3

    printed = call(verify)
    assert "same bytes" in printed
    assert "recordings of 1 of its runs are right; the results are the submitter's word" in printed
    assert "all well" not in printed
    assert "all well" in call("mobilia verify out/benchmark")

    printed = call(f"{merge} {SHORT}")
    assert "my_slam was submitted, as SLAM my_slam:MySlam" in printed
    table = json.loads((outside / "out/board/leaderboard.json").read_text())["leaderboard"]
    mine, wheels = (table[f"busy-chairs-v1 {name}"] for name in ("my_slam", "odometry"))
    assert mine["error_tracking_m"] == pytest.approx(wheels["error_tracking_m"], abs=1e-6)
    assert mine["silent_share"] is None  # it claims no covariance, and the page says so
    assert "without a covariance: `my_slam`" in (outside / "out/board/leaderboard.md").read_text()
    assert mine["ms_per_scan_p50"] is None
    assert wheels["ms_per_scan_p50"] is not None
    board = json.loads((outside / "out/board/leaderboard.json").read_text())
    assert board["merged"]["my_slam"]["slam"] == "my_slam:MySlam"

    compared = read(outside / "out/benchmark/busy-chairs-v1")
    assert compared.axis == "level"
    run = again.run_of(compared.folder / "runs" / "apartment_l0.5_s720.npz")
    assert run.settings["moving_share"] == 0.5

    wrong = json.loads(file.read_text().replace(data["sha256"], "0" * 64))
    file.write_text(json.dumps(wrong))
    done = CliRunner().invoke(app, ["verify", str(file)])
    assert done.exit_code == 1
    assert "damaged" in done.output


def test_numbers_may_be_set_of_the_subject_alone(monkeypatch: pytest.MonkeyPatch):
    asked = []

    def stop(wanted: Wanted, *_: object, **__: object) -> None:
        asked.append((wanted.subject, wanted.slams))
        raise InvalidValueError("enough")

    monkeypatch.setattr("scripts.benchmark.make.carry_out", stop)
    line = "benchmark --quick --subject ekf --set noise_scale=2"
    for more in ("", " --slam ekf"):
        CliRunner().invoke(app, shlex.split(line + more))
    assert asked == [("ekf{noise_scale=2}", ("ekf{noise_scale=2}",))] * 2

# SPDX-License-Identifier: Apache-2.0
"""``mobilia run --log``: formats, one warning, ``--strict``, what it cost, what it films."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from scripts.cli import app
from slam.errors import LogFormatError

pytestmark = pytest.mark.slow
ROVER = """
[time]
column = 1
[odometry]
x = 2
y = 3
theta = 4
[scan]
first = 5
start_deg = -90
step_deg = 1
range_max = 20
"""


def scan(x: float) -> str:
    """181 ranges of a robot in a room 8 m long and 6 m wide, heading along it."""
    angles = np.radians(np.arange(-90, 91))
    with np.errstate(divide="ignore"):
        ahead = np.abs((6.0 - x) / np.cos(angles))
        aside = np.abs(3.0 / np.sin(angles))
    return " ".join(f"{r:.3f}" for r in np.minimum(ahead, aside))


@pytest.fixture
def rover(tmp_path: Path) -> tuple[Path, Path]:
    """A log of 80 s, longer than a film, and its description."""
    (tmp_path / "rover.toml").write_text(ROVER)
    rows = [f"{2 * k} {0.05 * k:.3f} 0 0 {scan(0.05 * k)}\n" for k in range(40)]
    (tmp_path / "rover.txt").write_text("".join(rows) + "80 2.0 0")
    return tmp_path / "rover.txt", tmp_path / "rover.toml"


def invoke(*words: str | Path):
    done = CliRunner().invoke(app, ["run", *map(str, words)])
    if done.exception is not None and not isinstance(done.exception, SystemExit):
        raise done.exception
    return done.output


def test_a_described_log_runs_with_one_warning_and_says_what_it_cost(rover, tmp_path, caplog):
    log, toml = rover
    out = tmp_path / "out"
    said = invoke("shunting", "--log", log, "--format", toml, "--out", out, "--no-film")
    warnings = [record.getMessage() for record in caplog.records]
    assert len(warnings) == 1
    assert "1 torn end" in warnings[0]
    assert "of SLAM" in said
    results = json.loads((out / "results.json").read_text())
    cost = results["cost"]
    assert set(cost) == {"slam_s", "rest_s", "memory_mb"}
    assert cost["memory_mb"] > 50
    recipe = json.loads((out / "recipe.json").read_text())
    assert recipe["settings"]["log_facts"]["torn_last_line"] == 1
    assert not (out / "film.mp4").exists()
    with pytest.raises(LogFormatError, match="refused by --strict"):
        invoke("odometry", "--log", log, "--format", toml, "--strict", "--out", out, "--overwrite")


def test_the_film_of_a_long_log_is_a_time_lapse(rover, tmp_path):
    import cv2

    log, toml = rover
    out = tmp_path / "out"
    invoke("odometry", "--log", log, "--format", toml, "--out", out)
    film = cv2.VideoCapture(str(out / "film.mp4"))
    assert film.get(cv2.CAP_PROP_FPS) == 10.0
    assert math.isclose(film.get(cv2.CAP_PROP_FRAME_COUNT), 60, abs_tol=2)

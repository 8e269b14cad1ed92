# SPDX-License-Identifier: Apache-2.0
"""The command line as people meet it: the whole run, and every wrong input as one clear line."""

import json
import subprocess
from importlib.metadata import version
from pathlib import Path

import pytest

from tests.processes import python

pytestmark = pytest.mark.slow
REPO = Path(__file__).resolve().parents[3]


def mobilia(*words: str | Path, **environment: str) -> subprocess.CompletedProcess[str]:
    """The command as a process of its own, which takes seconds to start."""
    return python("-m", "scripts", *words, check=False, **environment)


@pytest.fixture(scope="module")
def finished(tmp_path_factory) -> tuple[Path, str]:
    out = tmp_path_factory.mktemp("demo") / "run"
    done = mobilia("demo", "--seconds", "3", "--seed", "3", "--out", out)
    assert done.returncode == 0, done.stderr
    return out, done.stdout


def test_the_demo_leaves_everything_it_promises(finished):
    out, printed = finished
    promised = {
        "film.mp4", "replay.html", "map.png", "map.pgm", "map.yaml", "trajectories.png",
        "errors.png",
        "trajectory_shunting.tum", "trajectory_odometry.tum", "trajectory_truth.tum",
        "recipe.json", "results.json", "index.html", "map.npz",
    }  # fmt: skip
    assert promised <= {p.name for p in out.iterdir()}
    assert all(p.stat().st_size > 0 for p in out.iterdir())
    assert "index.html first" in printed.replace("\n", " ")
    assert "ATE, unaligned" in printed
    results = json.loads((out / "results.json").read_text())
    keys = {"ate_unaligned_m", "ate_se2_m", "heading_rmse_rad", "ms_per_scan_p50",
            "mean_e_x", "var_e_x", "var_p_theta", "real_time_factor"}  # fmt: skip
    assert keys <= set(results["slams"]["shunting"]) & set(results["slams"]["odometry"])
    assert results["slams"]["shunting"]["ate_unaligned_m"] < 0.05
    recipe = json.loads((out / "recipe.json").read_text())
    assert (recipe["settings"]["scene"], recipe["settings"]["seed"]) == ("office", 3)
    assert {"mujoco", "numpy", "numba", "python"} <= set(recipe["versions"])


def test_a_damaged_log_is_named_and_nothing_is_written(tmp_path: Path, called):
    line = "FLASER 3 1.0 1.0 1.0 0 0 0 0 0 0 1.0 host 1.0"
    (tmp_path / "torn.log").write_text(f"{line}\nFLASER 3 1.\n{line}\n")
    (tmp_path / "noise.log").write_bytes(bytes(range(256)) * 20)
    before = sorted(p.name for p in tmp_path.iterdir())
    for name in ("torn.log", "noise.log"):
        done = called("run", "shunting", "--log", tmp_path / name, "--out", tmp_path / "out")
        assert done.returncode == 1
        assert name in done.stderr
    assert sorted(p.name for p in tmp_path.iterdir()) == before


def test_without_ffmpeg_it_says_so_before_it_starts(tmp_path: Path, called, monkeypatch):
    monkeypatch.setenv("IMAGEIO_FFMPEG_EXE", "/nonexistent")
    done = called("demo", "--out", tmp_path / "out")
    assert done.returncode == 1
    assert "no ffmpeg was found" in done.stderr
    assert list(tmp_path.iterdir()) == []


def test_an_unusable_mujoco_gl_is_one_line_and_no_obstacle(tmp_path: Path):
    out = tmp_path / "a [b] c" / "out"
    done = mobilia("run", "odometry", "--scene", "arena", "--seconds", "0.2", "--no-film",
                   "--out", out, MUJOCO_GL="nonsense")  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert "MUJOCO_GL=nonsense is ignored" in done.stdout
    page = (out / "index.html").read_text()
    assert 'src="trajectories.png"' in page
    assert "map.yaml" not in page  # odometry has none
    assert (out / "results.json").exists()


def test_a_log_of_one_scan_is_a_run(tmp_path: Path, called):
    beams = " ".join(["2.5"] * 180)
    log = tmp_path / "one.log"
    log.write_text(f"FLASER 180 {beams} 0 0 0 0 0 0 1.0 host 1.0\n")
    done = called("run", "shunting", "--log", log, "--out", tmp_path / "out")
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "out" / "film.mp4").exists()


def test_a_failing_slam_is_one_line(tmp_path: Path, called, monkeypatch):
    (tmp_path / "bad_slam.py").write_text("1/0\n")
    monkeypatch.chdir(tmp_path)
    done = called("run", "bad_slam:Slam", "--scene", "arena")
    assert done.returncode == 1
    assert "ZeroDivisionError: division by zero (bad_slam.py:1)" in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1


def test_the_version_is_told():
    done = mobilia("--version")
    assert (done.returncode, done.stdout) == (0, f"mobilia {version('mobilia')}\n")

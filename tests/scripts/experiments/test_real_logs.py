# SPDX-License-Identifier: Apache-2.0
"""The judge of real logs: a log of known motion, and what each of its columns is worth."""

import csv
import math
from pathlib import Path

import numpy as np
import pytest

from scripts.experiments import judging, real_logs
from scripts.experiments.judging import Log, Run
from slam import se2
from tests.world2d import Drive, World2D, laser, rectangle

pytestmark = pytest.mark.slow
REPO = Path(__file__).resolve().parents[3]
ROOM = World2D(np.vstack([rectangle(-3.0, -2.0, 5.0, 6.0), rectangle(1.5, 1.0, 2.2, 2.0)]))
ROUND = Drive((0.0, 0.0, 0.0), ((0.5, 0.25, 2.0 * math.tau * 2.0),))  # one circle of 2 m
STEP_S = 0.5


def poses_of(drive: Drive, count: int) -> np.ndarray:
    return np.array([drive.at(STEP_S * k)[0] for k in range(count)])


def a_run(online: np.ndarray, **more: np.ndarray) -> Run:
    n = len(online)
    given = {
        "stamps_ns": (np.arange(n) * STEP_S * 1e9).astype(np.int64),
        "online": online, "final": online, "odometry": online, "reference": online,
        "covariance": np.tile(np.eye(3) * 1e-4, (n, 1, 1)), "converged": np.ones(n, bool),
        "spent_ms": np.ones(n),
    }  # fmt: skip
    return Run(**{**given, **more})


def carmen_line(kind: str, values: list[float], pose: np.ndarray, time: float) -> str:
    at = " ".join(f"{v:.6f}" for v in pose)
    words = [kind, *(f"{v:.3f}" for v in values), at]
    return " ".join([*words, at if kind.startswith("FLASER") else "0 0 0", f"{time:g} x {time:g}"])


def log_at(path: Path, count: int) -> np.ndarray:
    """A sparse log as a particle filter writes it: poses of the circle, odometry 10 % short."""
    spec, poses = laser(91), poses_of(ROUND, count)
    lines = []
    for k, pose in enumerate(poses):
        if k:
            step = se2.between(poses[k - 1], pose) * [0.9, 0.9, 1.0]
            lines.append(carmen_line("ODOM", [], se2.compose(poses[k - 1], step), STEP_S * k))
        at = np.tile(pose, (91, 1))
        ranges = ROOM.ranges(0.0, at, np.asarray(spec.angles), 30.0)
        lines.append(carmen_line("FLASER 91", list(ranges), pose, STEP_S * k))
        lines.append(carmen_line("ODOM", [], pose, STEP_S * k))
    path.write_text("\n".join(lines) + "\n")
    return poses


def test_a_log_is_run_in_its_checkout_and_judged(tmp_path, monkeypatch, capsys):
    poses = log_at(tmp_path / "a.log", 50)
    (tmp_path / "r").write_text("102.25 107.5 " + " ".join(f"{v:.6f}" for v in np.insert(
        se2.between(ROUND.at(2.25)[0], ROUND.at(7.5)[0]), 2, [0.0] * 3)))  # fmt: skip
    monkeypatch.setattr(real_logs, "LOGS", {"a": Log(file="a.log", relations=("r", 100.0))})
    page = tmp_path / "page.md"
    page.write_text("<!-- real_logs -->\n<!-- /real_logs -->\n")
    words = ["--data", str(tmp_path), "--code", str(REPO), "--slam", "odometry"]
    words += ["--out", str(tmp_path / "out"), "--page", str(page)]
    for more in ([], ["--backwards", "--every", "2"]):
        assert real_logs.main([*words, *more]) == 0, capsys.readouterr()
    with (tmp_path / "out" / "real_logs.csv").open() as file:
        row, back = csv.DictReader(file)
    shorter = judging.errors(0.9 * poses, poses, slice(None))[:, :2]  # of the same circle
    assert float(row["online_m"]) == pytest.approx(math.sqrt((shorter**2).sum(1).mean()), abs=0.005)
    assert (row["log"], row["scans"], row["trusted"]) == ("a", "50", "1.000")
    assert (row["jump_m"], row["jumps"], row["revisits"], row["found_s"]) == ("0.00", "0", "", "")
    assert 0.1 < float(row["relations_online_m"]) < 0.4  # 0.9 of 2.6 m
    assert (back["log"], back["scans"]) == ("a, every 2, backwards", "25")
    assert float(back["online_m"]) == pytest.approx(float(row["online_m"]), abs=0.05)
    assert "| odometry | " in page.read_text()


def test_errors_are_those_beyond_a_rigid_motion():
    truth = poses_of(ROUND, 60)
    T = np.array([3.0, -1.0, 0.7])
    moved = np.array([se2.compose(T, pose) for pose in truth])
    assert np.abs(judging.errors(moved, truth, slice(0, 20))).max() < 1e-9
    moved[30:, 0] += 2.0
    off = judging.errors(moved, truth, slice(0, 20))
    assert np.hypot(*off[:30, :2].T).max() < 1e-9
    assert np.hypot(*off[30:, :2].T) == pytest.approx(2.0)


def test_jumps_are_beyond_odometry():
    odometry = poses_of(ROUND, 40)
    online = odometry.copy()
    online[20:] = [se2.compose([0.6, 0.0, 0.0], pose) for pose in online[20:]]
    beyond = np.hypot(*judging.beyond_odometry(a_run(online, odometry=odometry))[:, :2].T)
    assert beyond[19] == pytest.approx(0.6)
    assert np.delete(beyond, 19).max() < 1e-9


def test_who_is_found_stands_right_from_then_on():
    wrong = np.zeros(20, bool)
    wrong[[3, 8, 11]] = True
    run = a_run(np.zeros((20, 3)))
    at = judging.found_at(wrong, 7)
    assert at == 12
    assert judging.found(run, at, 7) == {"found_s": 2.5, "hazard": 5 / 20}
    assert judging.found_at(wrong, 12) == 12
    wrong[-1] = True
    assert judging.found(run, judging.found_at(wrong, 7), 7)["found_s"] == math.inf
    off = np.array([[0.6, 0.0, 0.0], [0.0, 0.0, 0.3], [0.1, 0.1, 0.1]])
    assert judging.large(off).tolist() == [True, True, False]


def test_nees_is_that_of_its_covariance():
    rng = np.random.default_rng(1)
    truth = np.zeros((4000, 3))
    truth[:, 0] = np.linspace(0.0, 50.0, 4000)
    online = truth + rng.normal(0.0, 0.05, truth.shape)
    covariance = np.tile(np.diag([0.04**2] * 3), (4000, 1, 1))
    assert judging.nees(online, covariance, truth, 0.03) == pytest.approx(1.386, abs=0.08)

# SPDX-License-Identifier: Apache-2.0
"""The experiments end to end, as short as they can be, and the rules by which they score."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

from scripts.paper.runs import Plan
from scripts.spec import command
from scripts.verbs.reproduce import EXPERIMENTS, Reproduce, experiment
from slam import se2
from slam.errors import InvalidValueError, LogFormatError, UnknownNameError
from slam.logs.victoria_graph import read_graph, stamped
from slam.logs.victoria_park import read_victoria_park, twist_of

pytestmark = pytest.mark.slow
DT = 0.025


def write_park(folder: Path, duration_s: float = 36.0) -> None:
    """A truck that circles among trees: detections, GPS, and the graph of what was seen."""
    rng = np.random.default_rng(1)
    times = 10.0 + DT * np.arange(round(duration_s / DT) + 1)
    speed, steering = np.full(len(times), 4.0), np.full(len(times), 0.25)
    trees = rng.uniform(-30.0, 40.0, (60, 2))
    poses = [np.zeros(3)]
    for v, a in zip(speed[:-1], steering[:-1], strict=True):
        poses.append(se2.compose(poses[-1], se2.exp(twist_of(v, a), DT)))
    scans = np.arange(0, len(times), 8)
    cells = np.empty((1, len(scans)), dtype=object)
    rear = se2.inverse([3.78, 0.5, 0.0])
    lines, seen, before = [], {}, None
    for k, at in enumerate(scans):
        x, y = se2.transform(se2.inverse(poses[at]), trees).T
        near = np.flatnonzero((np.hypot(x, y) < 25.0) & (np.abs(np.arctan2(y, x)) < 1.5))
        bearings = np.arctan2(y[near], x[near]) + math.pi / 2.0
        cells[0, k] = np.stack([np.hypot(x[near], y[near]), bearings, 0.3 * np.ones(len(near))])
        axle = se2.compose(poses[at], rear)
        if before is not None:
            step = se2.between(before, axle)
            numbers = " ".join(f"{v:.9f}" for v in step)
            lines.append(f"ODOMETRY p{k - 1} p{k} {numbers} 1e-4 0 0 4e-6 0 4e-6")
            for i in near[:3].tolist():
                dx, dy = se2.transform(se2.inverse(axle), trees[i])
                seen[i] = trees[i]
                lines.append(f"LANDMARK p{k} l{i} {dx:.6f} {dy:.6f} 0.4 0 0.4")
        before = axle
    u = np.vstack([speed, steering])
    park = {"TLsr": times[scans], "zt": cells, "time": times, "u": u}
    savemat(folder / "features_trees.mat", park)
    fixes = np.array([poses[k][:2] for k in scans]) + rng.normal(0.0, 0.3, (len(scans), 2))
    fixes[20] += 50.0
    gps = {"timeGps": 1000.0 * times[scans], "Lo_m": fixes[:, 0], "La_m": fixes[:, 1]}
    savemat(folder / "aa3_gpsx.mat", gps)
    (folder / "graph_known_association.txt").write_text("\n".join(lines) + "\n")


@pytest.fixture(scope="module")
def park(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("park")
    write_park(folder)
    return folder


def test_quick_leaves_pages_figures_and_recipes_of_all_and_closes_the_synthetic_park(
    tmp_path, park, capsys
):
    command(Reproduce)(["all"], quick=True, data=park, out=tmp_path, jobs=1)
    for name in EXPERIMENTS:
        whole(tmp_path / name)
    assert "theory" in capsys.readouterr().out
    page = (tmp_path / "victoria-park" / "README.md").read_text()
    assert "1 of them outliers" in page
    rmse = {}
    for row in page.partition("## Table 1")[0].splitlines():
        cells = [cell.strip() for cell in row.split("|")]
        if len(cells) > 5 and cells[2][0].isdigit():
            rmse[cells[1]] = float(cells[2])
    assert {"odometry", "EKF", "shunting", "graph"} <= set(rmse)
    assert max(rmse.values()) < 1.0


def whole(folder: Path) -> str:
    """The page of an experiment that left all it promises."""
    page = (folder / "README.md").read_text()
    pictures = sorted(path.stem for path in folder.glob("*.png"))
    assert pictures == sorted(path.stem for path in folder.glob("*.svg"))
    assert all(f"({name}.png)" in page for name in pictures)
    summary = (folder / "summary.md").read_text().strip().splitlines()
    assert set(summary) <= set(page.splitlines())
    recipe = json.loads((folder / "recipe.json").read_text())
    assert recipe["settings"]["plan"]["quick"] is True
    assert recipe["settings"]["plan"]["seeds"] == [200]
    assert "machine" in recipe["settings"]
    return page


def test_without_the_data_it_says_where_to_get_it(tmp_path):
    with pytest.raises(InvalidValueError, match=r"aa3_gpsx\.mat"):
        experiment("victoria-park")(Plan(out=tmp_path))
    with pytest.raises(LogFormatError, match="no Victoria Park here"):
        experiment("victoria-park")(Plan(out=tmp_path, data=tmp_path))
    with pytest.raises(InvalidValueError, match="--data must be the folder"):
        Plan(out=tmp_path, data=tmp_path / "features_trees.mat")
    with pytest.raises(UnknownNameError, match="no experiment is called 'nonsense'"):
        command(Reproduce)(["nonsense"], out=tmp_path)


def test_the_graph_is_stamped_by_the_distance_driven(park):
    frames = list(read_victoria_park(park))
    graph = read_graph(park)
    track = stamped(graph, frames)
    truth = np.array([frame.odometry.T_odom_robot for frame in frames])
    np.testing.assert_allclose(track.poses[:, :2], truth[:, :2], atol=0.02)
    np.testing.assert_allclose(se2.wrap_array(track.poses[:, 2] - truth[:, 2]), 0.0, atol=0.005)
    again = graph.optimised()
    np.testing.assert_allclose(again.poses, graph.poses, atol=1e-3)

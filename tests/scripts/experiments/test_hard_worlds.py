# SPDX-License-Identifier: Apache-2.0
"""The scripts that measure what is seen of a level, and at which level SLAMs break."""

from __future__ import annotations

import json
import math
from pathlib import Path
from types import SimpleNamespace

import mujoco
import numpy as np
import pytest

from scripts.comparison import folder
from scripts.comparison.plan import Plan
from scripts.experiments import breaking_point, penetration, share_seen
from scripts.knobs import Axis
from sim.core.dynamism import Dynamism
from sim.simulation import Simulation
from slam import system
from slam.errors import InvalidValueError
from slam.estimate import Estimate
from slam.frames import BeamClass, Frame
from slam.odometry import OdometrySlam

N, S, SEMI, M = (int(kind) for kind in BeamClass)


def test_a_level_sets_both_axes_or_one():
    at = Axis(name="motion").at(0.5)
    rates = Dynamism.of(**at)
    assert (rates.crowd, rates.change) == (0.5, 0.0)
    rates = Dynamism.of(**Axis(name="change").at(0.5))
    assert (rates.crowd, rates.change) == (0.0, 0.5)
    rates = Dynamism.of(**Axis().at(0.5))
    assert (rates.crowd, rates.change) == (0.5, 0.5)
    with pytest.raises(InvalidValueError, match="axis must be one of dynamism, motion, change"):
        Axis(name="speed")
    with pytest.raises(InvalidValueError, match="axis must be one of"):
        Plan(slams=("odometry",), scenes=("arena",), levels=(1.0,), seeds=(7,), axis="speed")


def test_shares_are_of_the_beams_that_met_something():
    kinds = np.zeros((3, 4), dtype=np.int64)
    kinds[0, [N, S, SEMI, M]] = 5, 2, 1, 1  # a quarter moves, half can move
    kinds[1, N] = 9  # nothing met: no share
    kinds[2, S] = 3
    found = share_seen.shares(kinds)
    assert found["moving"] == pytest.approx(0.125)
    assert found["movable"] == pytest.approx(0.25)
    assert found["moving_p90"] == pytest.approx(0.225)
    assert math.isnan(share_seen.shares(kinds[1:2])["moving"])


class Room:
    """A robot (body 0), a chair (1), a person (2) and a door of 1 m (3), where a test puts them."""

    def __init__(self) -> None:
        kinds = ("robot", "chair", "person", "door")
        movers = [SimpleNamespace(kind=kind, radius=1.0) for kind in kinds]
        self.scene = SimpleNamespace(movers=movers)
        self.bodies = SimpleNamespace(mover_of_body=np.arange(4))
        self.poses, self.time_ns = np.zeros((4, 3)), 0

    def mover_poses(self) -> np.ndarray:
        return self.poses

    def look(self, count: share_seen.Resightings, seconds: float, *bodies: int) -> tuple[int, int]:
        """Two beams on each of ``bodies``, one on the chair as well: too few to see it."""
        self.time_ns = round(seconds * 1e9)
        labels = SimpleNamespace(body=np.array([*bodies, *bodies, 1, -1], dtype=np.int32))
        count.look(SimpleNamespace(labels=labels))  # type: ignore[arg-type]
        return count.again, count.elsewhere


def test_change_is_counted_when_a_thing_comes_back_into_view():
    room = Room()
    count = share_seen.Resightings(room, away_s=5.0)  # type: ignore[arg-type]
    assert room.look(count, 0.0, 1, 2, 3) == (0, 0)  # seen for the first time
    room.poses[1:, 0] = 0.2
    assert room.look(count, 4.0, 1) == (0, 0)  # away for too short a time, but a sighting
    assert room.look(count, 9.5, 1) == (1, 0)  # there since
    room.poses[1, 0] = 0.35
    assert room.look(count, 15.0) == (1, 0)  # one beam is no sighting
    assert room.look(count, 16.0, 1) == (2, 1)
    room.poses[3] = 0.0, 0.0, 0.3  # the door turned: its leaf is 0.15 m off
    assert room.look(count, 20.0, 2, 3) == (3, 2)  # the person does not count


def test_what_is_seen_goes_into_the_results_and_the_page(tmp_path: Path):
    page, out = tmp_path / "page.md", tmp_path / "seen.json"
    page.write_text("Seen:\n\n<!-- share_seen -->\n<!-- /share_seen -->\nend\n")
    words = ["--scenes", "arena", "--levels", "0", "1", "--seeds", "1", "--seconds", "2"]
    words += ["--scanner", "scanner(fov_deg=180,beams=31,rate_hz=5,sigma_m=0.01)"]
    assert share_seen.main([*words, "--results", str(out), "--page", str(page)]) == 0
    data = json.loads(out.read_text())
    assert data["seeds"] == [500]
    assert data["commit"] is None
    assert data["command"].startswith("python -m scripts.experiments.share_seen --scenes arena")
    still, busy = data["seen"]["arena 0"], data["seen"]["arena 1"]
    assert still["moving"] == [0.0]
    assert 0.0 < still["movable"][0] < 1.0
    assert busy["moving_p90"][0] >= busy["moving"][0] > 0.0
    assert busy["driven_m"][0] > 0.1
    assert busy["elsewhere"] == [None]
    text = page.read_text()
    assert "| arena | 0 | 0.0 (0.0) |" in text
    assert text.endswith("<!-- /share_seen -->\nend\n")


@pytest.mark.parametrize("scene", ["arena", "corridor"])
def test_what_is_seen_grows_in_a_line_with_the_motion(scene: str):
    seen = []
    for level in (0.5, 1.0):
        cases = [
            share_seen.Case(
                scene=scene, level=level, seed=seed, axis="motion", seconds=16.0,
                scanner="scanner(fov_deg=180,beams=61,rate_hz=2.5,sigma_m=0.01)", away_s=5.0,
            )
            for seed in (500, 501, 502)
        ]  # fmt: skip
        rows = [share_seen.measure(case) for case in cases]
        seen.append(np.mean([row["moving"] for row in rows]))
        assert np.mean([row["blocked"] for row in rows]) < 0.15
    assert seen[1] > 0.3
    assert abs(seen[0] - 0.5 * seen[1]) < 0.2 * seen[1]


def test_a_page_without_the_mark_is_left_and_nothing_is_run(tmp_path: Path, capsys):
    (page := tmp_path / "page.md").write_text("nothing")
    words = ["--page", str(page), "--results", str(tmp_path / "r.json")]
    for script in (share_seen, breaking_point):
        assert script.main(words) == 1
        assert "page.md must have one <!-- " in capsys.readouterr().err
        assert script.main([*words[2:], "--page", str(tmp_path / "none.md")]) == 1
        assert "none.md" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["page.md"]


def test_who_stands_in_whom_is_named_with_the_depth():
    simulation = Simulation("arena", seed=1, dynamism=0.0, crowd="escorts:2", n_chairs=0)
    world, depths = simulation.world, penetration.Depths(simulation)
    depths.look()
    assert depths.worst == {}
    (one, two), _ = world.bodies.addresses(["escort0", "escort1"])
    world.data.qpos[one : one + 2] = world.data.qpos[two : two + 2]
    world.data.qpos[one] += 0.4
    mujoco.mj_forward(world.model, world.data)
    depths.look()
    ((pair, (depth, at_s, *names)),) = depths.worst.items()
    assert pair == ("person_coat", "person_coat")
    assert depth == pytest.approx(0.1, abs=1e-6)  # two hulls of 0.25 m, 0.4 m apart
    assert (at_s, sorted(names)) == (0.0, ["escort0", "escort1"])


class Sure(OdometrySlam):
    """Odometry that claims 1 cm in x and in y, always."""

    def update(self, frame: Frame) -> Estimate:
        pose = super().update(frame).T_map_robot
        return Estimate(
            stamp_ns=frame.stamp_ns, T_map_robot=pose, covariance=np.diag([1e-4, 1e-4, 0.0])
        )


class Raises(OdometrySlam):
    """Fails at once."""

    def update(self, frame: Frame) -> Estimate:
        raise RuntimeError("enough")


def test_the_breaking_point_of_a_tiny_plan(tmp_path: Path, capsys, monkeypatch):
    for name, kind in (("sure", Sure), ("raises", Raises)):
        monkeypatch.setitem(system._registry, name, kind)
    words = ["--slams", "sure", "raises", "oracle(odometry)", "--scenes", "arena"]
    words += ["--axis", "dynamism"]
    words += ["--levels", "0", "1", "--seeds", "1", "--seconds", "1.6", "--no-page"]
    files = {name: str(tmp_path / name) for name in ("out", "results.json", "picture.png")}
    words += ["--out", files["out"], "--results", files["results.json"]]
    words += ["--picture", files["picture.png"]]
    assert breaking_point.main(words) == 0
    printed = capsys.readouterr().out
    assert "| dynamism, arena | 0 | 0.0 |" in printed
    assert "failed (1)" in printed
    assert (tmp_path / "picture.png").stat().st_size > 10_000
    data = json.loads((tmp_path / "results.json").read_text())
    assert data["levels"] == [0.0, 1.0]
    cells = data["broken"]
    assert set(cells) == {
        f"dynamism arena {slam}" for slam in ("sure", "raises", "oracle(odometry)")
    }
    sure, raises = cells["dynamism arena sure"], cells["dynamism arena raises"]
    assert sure["claimed_m"] == pytest.approx([math.sqrt(2e-4)] * 2, rel=1e-5)
    assert sure["error_m"] == pytest.approx(sure["ate_median_m"], rel=1e-5)
    assert sure["lost"] == [0, 0]
    assert raises["lost"] == [1, 1]
    assert raises["ate_median_m"] == ["inf", "inf"]
    assert raises["claimed_m"] == [None, None]
    kept = {p: p.stat().st_mtime_ns for p in (tmp_path / "out").glob("dynamism/*/arena*-*.npz")}
    assert len(kept) == 8
    assert breaking_point.main(words) == 0
    assert {p: p.stat().st_mtime_ns for p in kept} == kept
    assert folder.read(tmp_path / "out" / "dynamism").recipe["settings"]["axis"] == "dynamism"


def test_what_cannot_be_planned_is_one_line(tmp_path: Path, capsys):
    words = ["--scenes", "arenna", "--axis", "dynamism", "--no-page", "--out", str(tmp_path)]
    words += ["--results", str(tmp_path / "r.json")]
    assert breaking_point.main(words) == 1
    assert "Did you mean 'arena'" in capsys.readouterr().err

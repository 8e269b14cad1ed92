# SPDX-License-Identifier: Apache-2.0
"""An oracle in a comparison: labels reach it through the recording, and nobody else."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import typer
from typer.testing import CliRunner

import slam
from scripts.comparison import entry, folder, make
from scripts.comparison.plan import Plan, source_of
from scripts.comparison.recording import load
from scripts.many import ManyValues
from scripts.names import file_name
from scripts.output import slams_of
from scripts.verbs import compare as verb
from sim.simulation import Simulation, tour
from slam import system
from slam.frames import BeamClass, Frame
from slam.odometry import OdometrySlam
from slam.replay import Replay

PLAN = {"scenes": ("arena",), "levels": (1.0,), "seeds": (7,), "seconds": 1.6}
SEEN: list[list[Frame]] = []


class Watcher(OdometrySlam):
    """Odometry that keeps what it was shown."""

    def __init__(self) -> None:
        super().__init__()
        SEEN.append([])

    def update(self, frame: Frame) -> slam.Estimate:
        SEEN[-1].append(frame)
        return super().update(frame)


def test_each_slam_of_a_comparison_sees_what_it_may(tmp_path: Path, monkeypatch):
    """Two-sided: the oracles see no return of their kinds and all others, the SLAM sees all."""
    monkeypatch.setitem(system._registry, "watcher", Watcher)
    slams = ("watcher", "oracle(watcher)", "oracle(watcher,moving)")
    monkeypatch.setattr(entry, "_warm", set(slams))
    make.carry_out(Plan(slams=slams, **PLAN), tmp_path)
    drive = load(next((tmp_path / "recordings").glob("arena*.npz")))
    gone = ((), (BeamClass.SEMI_STATIC, BeamClass.MOVING), (BeamClass.MOVING,))
    taken = [0, 0, 0]
    for k, (kinds, run) in enumerate(zip(gone, filter(None, SEEN), strict=True)):
        for frame, seen in zip(drive.frames, run, strict=True):
            assert frame.labels is not None
            assert frame.scan is not None
            assert seen.scan is not None
            assert seen.labels is None
            out = np.isin(frame.labels.kind, kinds)
            taken[k] += int(out.sum())
            assert np.isnan(seen.scan.ranges[out]).all()
            assert np.array_equal(seen.scan.ranges[~out], frame.scan.ranges[~out], equal_nan=True)
    assert 0 == taken[0] < taken[2] < taken[1]
    compared = folder.read(tmp_path)
    assert [row["slam"] for row in compared.runs] == list(slams)
    assert {row["slam"] for row in compared.levels} == set(slams)
    run = compared.run("arena", 1.0, 7)
    assert np.array_equal(run.believed(slams[2]).stamps_ns, run.stamps_ns)
    assert slams_of(tmp_path / "recipe.json", compared.recipe["settings"]) == list(slams)


def test_an_oracle_joins_a_comparison_and_nothing_is_made_again(tmp_path: Path):
    plan = Plan(slams=("odometry",), **PLAN)
    make.carry_out(plan, tmp_path)
    before = {file: file.stat().st_mtime_ns for file in tmp_path.glob("*/arena*-*.npz")}
    assert len(before) == 2
    more = Plan(slams=("odometry", "oracle(odometry)"), **PLAN)
    rows = make.carry_out(more, tmp_path)
    assert {file: file.stat().st_mtime_ns for file in before} == before
    assert rows[0]["ate_unaligned_m"] == rows[1]["ate_unaligned_m"]
    after = {file: file.stat().st_mtime_ns for file in tmp_path.glob("*/arena*-*.npz")}
    make.carry_out(more, tmp_path)
    assert {file: file.stat().st_mtime_ns for file in after} == after


def test_in_a_room_without_movers_the_oracle_is_the_slam():
    """Dynamism 0 and nothing that could move: byte for byte."""
    simulation = Simulation("arena", seed=3, dynamism=0.0, n_chairs=0, n_people=0, labels=True)
    names = ("occupancy", "oracle(occupancy)", "oracle(occupancy,moving)")
    replay = Replay.of({name: slam.create(name) for name in names})
    frames = [f for k, f in enumerate(tour(simulation, 1.0)) if k % 4 == 0]
    list(replay.run(frames))
    for frame in frames:
        assert frame.labels is not None
        assert not np.isin(frame.labels.kind, (BeamClass.SEMI_STATIC, BeamClass.MOVING)).any()
    first, *others = (
        [e.T_map_robot.tobytes() for e in t.estimates] for t in replay.tracks.values()
    )
    assert all(other == first for other in others)


def test_the_option_names_them_beside_the_slams(monkeypatch):
    seen: dict[str, Plan] = {}
    app = typer.Typer()
    app.command(cls=ManyValues)(verb.compare)
    monkeypatch.setattr(make, "carry_out", lambda plan, out, **ways: seen.update(plan=plan) or [])
    monkeypatch.setattr(verb, "tell", lambda *_: None)
    line = "--slam shunting,oracle(ekf,moving),ekf --oracle shunting karto,moving --scene arena"
    words = [*line.split(), "--set", "shunting.reward=7", "--out", "there"]
    result = CliRunner().invoke(app, words)
    assert result.exit_code == 0, result.output
    assert seen["plan"].slams == (
        "shunting{reward=7}", "oracle(ekf,moving)", "ekf", "oracle(shunting{reward=7})",
        "oracle(karto,moving)",
    )  # fmt: skip


def test_names_of_files_and_code_within():
    assert file_name("oracle(shunting,moving)") == "oracle-shunting-moving-"
    names = {
        file_name(name) for name in ("shunting", "oracle(shunting)", "oracle(shunting,moving)")
    }
    assert len(names) == 3
    assert source_of("oracle(tests.slam.guests.misbehaving:Any,moving)") == source_of(
        "tests.slam.guests.misbehaving:Any"
    )

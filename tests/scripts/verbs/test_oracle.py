# SPDX-License-Identifier: Apache-2.0
"""``mobilia run --oracle``: on a scene beside the SLAM, on a log an error that says why not."""

import json
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import pytest

from scripts.debugger.recording import Case, Checkpoint, record
from sim.simulation import stream
from slam.logs.carmen import write_carmen

pytestmark = pytest.mark.slow


def test_a_run_has_the_oracle_beside_the_slam(
    tmp_path: Path, called: Callable[..., SimpleNamespace]
):
    out = tmp_path / "run"
    done = called(
        "run", "occupancy", "--oracle", "occupancy", "--oracle", "odometry,moving", "--scene",
        "arena", "--dynamism", "1", "--seconds", "1", "--no-film", "--out", out,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    names = ["occupancy", "oracle(occupancy)", "oracle(odometry,moving)", "odometry"]
    assert list(json.loads((out / "results.json").read_text())["slams"]) == sorted(names)
    recipe = json.loads((out / "recipe.json").read_text())
    assert recipe["settings"]["slams"] == names
    assert recipe["configs"]["oracle(occupancy)"] == recipe["configs"]["occupancy"]
    ours, oracles = (
        (out / f"trajectory_{name}.tum").read_text() for name in ("occupancy", "oracle-occupancy-")
    )
    assert ours != oracles
    assert called("verify", out).returncode == 0


def test_a_log_has_no_labels(tmp_path: Path, called: Callable[..., SimpleNamespace]):
    log = tmp_path / "it.log"
    write_carmen(log, stream("arena", seconds=0.5, n_chairs=2))
    words = ("run", "odometry", "--oracle", "shunting", "--log", log, "--out", tmp_path / "out")
    done = called(*words, "--no-film")
    assert done.returncode == 2
    said = " ".join(done.stderr.split())
    assert "oracle(shunting): it.log has no labels" in said
    assert "--scene" in said
    assert not (tmp_path / "out").exists()


def test_blame_can_go_back_into_an_oracles_run():
    """Its frames keep their labels on tape, so that a re-run is the original."""
    settings = {"scene": "arena", "dynamism": 1.0, "seed": 2}
    case = Case(settings=settings, seconds=2.0, slam="oracle(occupancy)", every=8)
    tape = record(case)
    assert all(frame.labels is not None for frame in tape.strip.frames)
    Checkpoint(tape, max(tape.states)).verify(len(tape.strip.frames) - 1)

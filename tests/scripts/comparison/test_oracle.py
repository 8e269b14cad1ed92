# SPDX-License-Identifier: Apache-2.0
"""An oracle in a comparison: labels reach it through the recording, and nobody else."""

from pathlib import Path

import numpy as np
import pytest

import slam
from scripts.comparison import entry, folder, make
from scripts.comparison.plan import Plan
from scripts.comparison.recording import load
from scripts.output import slams_of
from slam import system
from slam.frames import BeamClass, Frame
from slam.odometry import OdometrySlam

pytestmark = pytest.mark.slow
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


def test_by_the_map_it_gets_the_map_and_no_labels(tmp_path: Path):
    """In a room with people, of which it is told nothing, it is nearer than odometry."""
    plan = Plan(
        slams=("oracle(map)", "odometry"), scenes=("arena",), levels=(1.0,), seeds=(7,),
        seconds=4.0, scanner="noise", odometry="probabilistic_robotics", judge_maps=False,
    )  # fmt: skip
    mine, wheels = make.carry_out(plan, tmp_path)
    assert (mine["outcome"], mine["lost"]) == ("finished", 0)
    assert mine["ate_unaligned_m"] < 0.02 < wheels["ate_unaligned_m"]

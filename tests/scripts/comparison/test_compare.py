# SPDX-License-Identifier: Apache-2.0
"""A comparison as a whole: same frames for all, resumed to the same numbers, failures scored."""

from collections.abc import Iterator

import numpy as np
import pytest
import typer
from typer.testing import CliRunner

from scripts import engine
from scripts.comparison import folder, make
from scripts.comparison.plan import Plan
from scripts.option_names import Verb
from scripts.spec import command
from scripts.verbs import compare as verb
from slam import Estimate, Trajectory, se2, system

pytestmark = pytest.mark.slow
SECONDS = 1.6
PLAN = {
    "scenes": ("arena",), "levels": (1.0,), "seeds": (7,), "seconds": SECONDS, "change": 0.0,
    "crowd": "none",
}  # fmt: skip
OF_THE_MACHINE = ("ms_per_scan_p50", "ms_per_scan_p99", "ms_per_scan_p999", "peak_memory_mb")


class Wheels:
    """Odometry by hand, so that what it gets can be compared with what is on file."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        self.first, self.stamps, self.poses = None, [], []

    def map(self) -> None:
        return None

    def update(self, frame) -> Estimate:
        here = frame.odometry.T_odom_robot
        self.first = here if self.first is None else self.first
        self.stamps.append(frame.stamp_ns)
        self.poses.append(se2.between(self.first, here))
        return Estimate(
            stamp_ns=frame.stamp_ns, T_map_robot=self.poses[-1], covariance=np.eye(3) * 1e-4
        )

    def trajectory(self) -> Trajectory:
        return Trajectory(stamps_ns=np.array(self.stamps), poses=np.array(self.poses))


class Raises(Wheels):
    """Fails at its fourth scan."""

    def update(self, frame) -> Estimate:
        if len(self.stamps) == 3:
            raise RuntimeError("enough")
        return super().update(frame)


class Drifts(Wheels):
    """Answers a NaN."""

    def update(self, frame) -> Estimate:
        pose = super().update(frame).T_map_robot * np.nan
        return Estimate(stamp_ns=frame.stamp_ns, T_map_robot=pose, covariance=np.eye(3))


@pytest.fixture(scope="module")
def compared(tmp_path_factory) -> Iterator[folder.Compared]:
    """Ours and three by hand; those from outside, in processes of their own, are tested apart."""
    out = tmp_path_factory.mktemp("compare") / "out"
    by_hand = {"wheels": Wheels, "raises": Raises, "drifts": Drifts}
    with pytest.MonkeyPatch.context() as patch:
        for name, factory in by_hand.items():
            patch.setitem(system._registry, name, factory)
        make.carry_out(Plan(slams=("odometry", "occupancy", *by_hand), **PLAN), out)
        yield folder.read(out)


def rows_of(compared, slam):
    return [row for row in compared.runs if row["slam"] == slam]


def test_everybody_gets_the_same_frames(compared):
    """What adds up the odometry by hand believes what ours believes, scan by scan."""
    run = compared.run("arena", 1.0, 7)
    ours, theirs = run.believed("odometry"), run.believed("wheels")
    assert np.array_equal(ours.stamps_ns, run.stamps_ns)
    assert np.allclose(ours.poses, theirs.poses, atol=1e-12)
    assert run.believed("occupancy").map is not None
    a, b = (rows_of(compared, slam)[0] for slam in ("odometry", "wheels"))
    assert a["ate_unaligned_m"] == pytest.approx(b["ate_unaligned_m"], abs=1e-9)


def test_failures_are_scored_and_take_nothing_down(compared):
    raised, drifted = rows_of(compared, "raises"), rows_of(compared, "drifts")
    assert [row["outcome"] for row in raised] == ["raised"]
    assert [row["outcome"] for row in drifted] == ["nan"]
    assert "enough" in raised[0]["failure"]
    assert all(row["lost"] == 1 and row["ate_unaligned_m"] is None for row in raised + drifted)
    assert raised[0]["scans"] == 3
    pair = next(
        row
        for row in compared.paired
        if row["metric"] == "ate_unaligned_m"
        and (row["slam_a"], row["slam_b"]) == ("odometry", "raises")
    )
    assert (pair["wins"], pair["losses"]) == (1, 0)  # its errors count as infinite


def test_who_failed_is_told_with_the_line_and_nothing_is_claimed_of_one_run(compared, capsys):
    plan = Plan(slams=("raises", "odometry", "occupancy", "wheels", "drifts"), **PLAN)
    verb.tell(plan, compared.runs)
    told = " ".join(capsys.readouterr().out.split())
    line = Raises.update.__code__.co_firstlineno + 2
    failure = "`raises` raised or ended in 1 of 1 runs, first in arena at dynamism 1, seed 7: SLAM "
    assert (
        f"{failure}'raises', scan 3, raised RuntimeError: enough (test_compare.py:{line})" in told
    )
    assert "`drifts` gave a pose that is not finite in 1 of 1 runs" in told
    assert "failed (1)" in told
    assert "`raises` failed in 1 of 1 runs in arena at dynamism 1; so at least 21 % of" in told


def without_timings(rows):
    return [{key: row[key] for key in row if key not in OF_THE_MACHINE} for row in rows]


def test_resumed_to_the_same_numbers_and_of_one_slam_more_only_that_runs(tmp_path):
    plan = Plan(slams=("odometry", "occupancy"), **PLAN)
    first = make.carry_out(plan, tmp_path)
    for file in tmp_path.glob("*/arena*odometry*.npz"):
        file.unlink()
    made = {file: file.stat().st_mtime_ns for file in tmp_path.glob("[er]*s/arena*-*.npz")}
    rows = make.carry_out(Plan(slams=("odometry", "occupancy", "ekf"), **PLAN), tmp_path)
    assert {file: file.stat().st_mtime_ns for file in made} == made
    assert [row["slam"] for row in rows] == ["odometry", "occupancy", "ekf"]
    assert repr(without_timings(rows[:2])) == repr(without_timings(first))


def test_the_command_line_of_the_readme(monkeypatch):
    seen = {}
    app = typer.Typer()
    app.command(cls=Verb)(command(verb.Compare))

    def carry_out(plan, out, **ways):
        seen.update(plan=plan, out=out, ways=ways)
        return []

    monkeypatch.setattr(make, "study", lambda plan, *_: plan)
    monkeypatch.setattr(engine, "carry_out", carry_out)
    monkeypatch.setattr(engine, "refuse", lambda *_: None)
    monkeypatch.setattr(verb, "tell", lambda *_: None)
    line = (
        "--slam shunting,oracle(ekf,moving) ekf my_pkg:MySlam --oracle shunting karto,moving "
        "--scene arena office --dynamism 0:1:0.25 --seeds 10 --set shunting.reward=7 "
        "--jobs 2 --out there"
    )
    result = CliRunner().invoke(app, line.split())
    assert result.exit_code == 0, result.output
    plan = seen["plan"]
    assert plan.slams == (
        "shunting{reward=7}", "oracle(ekf,moving)", "ekf", "my_pkg:MySlam",
        "oracle(shunting{reward=7})", "oracle(karto,moving)",
    )  # fmt: skip
    assert plan.scenes == ("arena", "office")
    assert plan.levels == (0.0, 0.25, 0.5, 0.75, 1.0)
    assert plan.seeds == tuple(range(100, 110))
    assert seen["ways"] == {"jobs": 2, "cluster": None}

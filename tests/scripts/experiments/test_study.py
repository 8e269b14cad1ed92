# SPDX-License-Identifier: Apache-2.0
"""Studies: what is run once, what is pooled, and what each of them declares."""

from __future__ import annotations

import importlib
import math
from pathlib import Path

import numpy as np
import pytest

from scripts.benchmark.tracks import TRACKS
from scripts.comparison.recording import Recording
from scripts.console import ended
from scripts.experiments import ablation, shared, study, uncertainty
from scripts.experiments.shared import of, on_stream, share, world_1
from scripts.experiments.study import Study
from sim.core.dynamism import Dynamism
from sim.recording.recipe import Recipe
from sim.simulation import Simulation, tour
from slam.errors import InvalidValueError, UnknownNameError
from slam.frames import LaserSpec, Scan
from slam.system import create

NAMES = ("ablation", "logs", "rates", "scanners", "share_seen", "uncertainty")
STUDIES = {name: importlib.import_module(f"scripts.experiments.{name}").STUDY for name in NAMES}


@pytest.mark.parametrize("name", NAMES)
def test_what_is_declared_can_be_run(name: str):
    one = STUDIES[name]
    assert one.name == name
    assert one.page is None or f"<!-- {name} -->" in one.page.read_text(encoding="utf-8")
    cases = one.cases(one._parser().parse_args([]))
    assert cases
    if drive := one.drive(cases[-1]):
        assert study.recorded(drive).file_name()
    for slam in {case["slam"] for case in cases if "slam" in case}:
        create(slam)


def counted(case: shared.Row) -> shared.Row:
    """A run that leaves a trace of itself."""
    with Path(case["log"]).open("a") as log:
        log.write("x")
    return {"n": case["seed"], "part": 1, "all": 4}


def test_a_study_goes_on_and_pools(tmp_path: Path, capsys: pytest.CaptureFixture):
    log = str(tmp_path / "log")
    page = tmp_path / "page.md"
    page.write_text("<!-- made -->\n<!-- /made -->\n")
    made = Study(
        name="made", axes={"log": (log,), "scene": ("a", "b"), "slam": ("s", "t")}, run=counted,
        fits=lambda case: case["scene"] == "a" or case["slam"] == "s",
        lines=("scene",), pooled=("scene",), across="slam", cell=lambda rows: str(len(rows)),
        columns={"n": of("n", np.max, form="{:.0f}"), "share": share("part", "all")}, page=page,
    )  # fmt: skip
    words = ["--seeds", "2", "--first-seed", "3", "--folder", str(tmp_path / "out")]
    words += ["--results", str(tmp_path / "r.json"), "--page", str(page)]
    for runs in (6, 6):
        assert made.main(words) == 0
        assert Path(log).read_text() == "x" * runs
    text = page.read_text()
    assert "| scene | s | t | n | share |" in text
    assert "| a | 2 | 2 | 4 | 25 % |" in text
    assert "| b | 2 | – | 4 | 25 % |" in text
    assert "| all | 4 | 2 | 4 | 25 % |" in text
    assert '"commit": null' in (tmp_path / "r.json").read_text()
    page.write_text("nothing")
    assert made.main(words) == 1
    assert "page.md must have one <!-- made -->" in capsys.readouterr().err


def test_scans_left_out_leave_their_odometry():
    frames = list(tour(Simulation("arena", seed=0, laser="lms221:noise"), 0.5))
    few = shared.kept(frames, 4)
    assert [f.stamp_ns for f in few] == [f.stamp_ns for f in frames[::4]]
    between = sum(f.odometry.increment_covariance for f in frames[5:9])
    np.testing.assert_allclose(few[2].odometry.increment_covariance, between)
    assert np.array_equal(few[2].odometry.T_odom_robot, frames[8].odometry.T_odom_robot)


def test_a_stream_is_a_scene_or_a_track_at_its_level():
    office, track = (on_stream(name, 0.5, 3, 20.0) for name in ("office", "rush-hour"))
    assert (office["dynamism"], office["seconds"]) == (0.5, 20.0)
    assert (track["scene"], track["seconds"]) == ("station", 90.0)  # as long as the track
    assert track["options"]["crowd"] == "streams:35"
    with pytest.raises(UnknownNameError, match="rush-our"):
        on_stream("rush-our", 0.5, 3, 20.0)


def test_each_value_of_a_scanner_is_another_drive():
    for name in ("scanners", "uncertainty"):
        one = STUDIES[name]
        cases = one.cases(one._parser().parse_args([]))
        wanted = {case["scanner"] for case in cases}
        assert {one.drive(case)["scanner"] for case in cases} == wanted


def test_world_1_is_without_crowd_and_change():
    recipe = Recipe(**world_1({"scene": "office", "level": 0.5, "seed": 0, "seconds": 1.0}))
    assert recipe.simulation()["crowd"] == "none"
    assert Dynamism.of(0.5, change=0.0).change == Dynamism.world_1(0.5).change == 0.0


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["--every", "0"], "--every must be a whole number >= 1, got"),
        (["--stream", "rush-hour", "--level", "7"], "the level of a track must be one of"),
    ],
)
def test_what_cannot_be_run_is_told_in_a_line(tmp_path: Path, capsys, words, says):
    more = ["--folder", str(tmp_path / "a"), "--results", str(tmp_path / "r.json"), "--no-page"]
    assert STUDIES["rates"].main([*words, *more]) == 1
    assert capsys.readouterr().err.startswith(says)
    assert not list(tmp_path.iterdir())


def test_an_error_of_ours_ends_an_experiment_in_a_line(capsys: pytest.CaptureFixture):
    @ended
    def wrong() -> int:
        raise InvalidValueError("motion must be one of 1, 0.75, 0.5, got 0.3")

    assert wrong() == 1
    assert capsys.readouterr().err == "motion must be one of 1, 0.75, 0.5, got 0.3\n"
    assert ended(lambda: None)() == 0


def test_a_run_that_fails_counts_as_lost(monkeypatch: pytest.MonkeyPatch):
    from slam.odometry import OdometrySlam

    class Failing(OdometrySlam):
        def update(self, frame):
            raise RuntimeError("no")

    frames = list(tour(Simulation("arena", seed=0, laser="lms221:noise", labels=True), 1.0))
    drive = Recording.__new__(Recording)
    object.__setattr__(drive, "frames", frames)
    fine = shared.judged({"slam": "odometry"}, drive)
    monkeypatch.setattr(shared, "create", lambda name: Failing())
    lost = shared.judged({"slam": "odometry"}, drive)
    assert (fine["lost"], lost["lost"]) == (0, 1)
    assert lost["error_m"] == math.inf
    assert of("ate_unaligned_m", np.max)([fine, lost]) == "inf"
    assert shared.losses([fine, lost]) == "1 of 2"


def test_cells_of_tracks_are_geometric_means_and_losses_are_counted():
    tracks = ["tour-guide-v1", "no-walls-v1"]
    rows = [
        {"track": track, "slam": slam, "rpe_m_per_m": drift, "lost": int(drift > 0.03),
         "outcome": "finished", "seed": 0}
        for track in tracks
        for slam in ("shunting", TRACKS[track].oracle)
        for drift in ((0.01, 0.04) if track == tracks[0] else (0.01,))
    ]  # fmt: skip
    head, _, whole, *_ = ablation.STUDY.markdown(rows).splitlines()
    assert head == "| slam | tour-guide-v1 | no-walls-v1 | all |"
    assert whole == "| shunting | 2.00, 1 of 2 | 1.00, 0 of 1 | 1.41 |"


def test_beams_of_a_poorer_scanner_keep_direction_time_and_range():
    spec = LaserSpec(
        n_beams=361, angle_min=-math.pi / 2, angle_increment=math.radians(0.5),
        beam_time_offsets=np.arange(361) * 1e-5,
    )  # fmt: skip
    whole = Scan(stamp_ns=0, ranges=(1.0 + 0.02 * np.arange(361)).astype(np.float32), spec=spec)
    less = uncertainty.poorer(whole, every=2, fov_deg=90.0, range_m=4.0)
    assert (less.spec.n_beams, less.spec.range_max) == (91, 4.0)
    kept = np.flatnonzero(np.isin(np.round(spec.angles, 9), np.round(less.spec.angles, 9)))
    np.testing.assert_allclose(np.degrees(less.spec.angles[[0, -1]]), [-45.0, 45.0])
    np.testing.assert_array_equal(less.spec.beam_time_offsets, spec.beam_time_offsets[kept])
    expected = whole.ranges[kept].copy()
    expected[expected > 4.0] = np.inf
    np.testing.assert_array_equal(less.ranges, expected)

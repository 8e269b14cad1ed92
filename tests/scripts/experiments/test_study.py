# SPDX-License-Identifier: Apache-2.0
"""Studies: what is run once, what is pooled, and what each of them declares."""

import importlib
from pathlib import Path

import numpy as np
import pytest

from scripts.benchmark.tracks import TRACKS
from scripts.comparison.recording import Recording
from scripts.experiments import ablation, study
from scripts.experiments.study import Study, of, on_track
from sim.simulation import Simulation, tour
from slam.errors import UnknownNameError
from slam.system import create

NAMES = ("ablation",)
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


def counted(case: study.Row) -> study.Row:
    """A run that leaves a trace of itself."""
    with Path(case["log"]).open("a") as log:
        log.write("x")
    return {"n": case["seed"]}


def test_a_study_goes_on(tmp_path: Path, capsys: pytest.CaptureFixture):
    log = str(tmp_path / "log")
    page = tmp_path / "page.md"
    page.write_text("<!-- made -->\n<!-- /made -->\n")
    made = Study(
        name="made", axes={"log": (log,), "scene": ("a", "b"), "slam": ("s", "t")}, run=counted,
        fits=lambda case: case["scene"] == "a" or case["slam"] == "s",
        lines=("scene",), across="slam", cell=lambda rows: str(len(rows)),
        columns={"n": of("n", np.max, form="{:.0f}")}, page=page,
    )  # fmt: skip
    words = ["--seeds", "2", "--first-seed", "3", "--folder", str(tmp_path / "out")]
    words += ["--results", str(tmp_path / "r.json"), "--page", str(page)]
    for runs in (6, 6):
        assert made.main(words) == 0
        assert Path(log).read_text() == "x" * runs
    text = page.read_text()
    assert "| scene | s | t | n |" in text
    assert "| a | 2 | 2 | 4 |" in text
    assert "| b | 2 | – | 4 |" in text
    assert '"commit": null' in (tmp_path / "r.json").read_text()
    page.write_text("nothing")
    assert made.main(words) == 1
    assert "page.md must have one <!-- made -->" in capsys.readouterr().err


def test_a_drive_of_a_track_is_that_of_its_level():
    track = on_track("rush-hour", 0.5, 3)
    assert (track["scene"], track["seconds"]) == ("station", 90.0)  # as long as the track
    assert track["options"]["crowd"] == "streams:35"
    with pytest.raises(UnknownNameError, match="rush-our"):
        on_track("rush-our", 0.5, 3)


def test_what_cannot_be_run_is_told_in_a_line(tmp_path: Path, capsys):
    more = ["--folder", str(tmp_path / "a"), "--results", str(tmp_path / "r.json"), "--no-page"]
    for words, says in (("--level 7", "the level of a track"), ("--track rush-our", "no track")):
        assert STUDIES["ablation"].main([*words.split(), *more]) == 1
        assert capsys.readouterr().err.startswith(says)
    assert not list(tmp_path.iterdir())


def test_a_run_that_fails_counts_as_lost(monkeypatch: pytest.MonkeyPatch):
    from slam.odometry import OdometrySlam

    class Failing(OdometrySlam):
        def update(self, frame):
            raise RuntimeError("no")

    frames = list(tour(Simulation("arena", seed=0, laser="lms221:noise", labels=True), 1.0))
    drive = Recording.__new__(Recording)
    object.__setattr__(drive, "frames", frames)
    fine = study.judged({"slam": "odometry"}, drive)
    monkeypatch.setattr(study, "create", lambda name: Failing())
    lost = study.judged({"slam": "odometry"}, drive)
    assert (fine["lost"], lost["lost"]) == (0, 1)
    assert of("ate_unaligned_m", np.max)([fine, lost]) == "inf"
    assert study.losses([fine, lost]) == "1 of 2"


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

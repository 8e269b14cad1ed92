# SPDX-License-Identifier: Apache-2.0
"""A search as a whole, of a SLAM whose one number is how far it is off."""

import json
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from scripts.benchmark import tracks
from scripts.cli import app
from scripts.comparison.tables import Row
from scripts.results import check
from scripts.tuning import make, run
from scripts.tuning.make import Tuned, carry_out
from scripts.tuning.search import Search, Task
from scripts.tuning.space import read
from slam import system
from slam.errors import OutputError
from slam.estimate import Estimate
from slam.odometry import OdometrySlam
from slam.settings import Settings, number
from tests.commands import of_page, read_by

pytest.importorskip("optuna")
pytestmark = pytest.mark.slow
TRACK = replace(
    tracks.TRACKS["tour-guide-v1"], name="tiny-v1", scene="arena", sets=({"motion": 0.0},) * 5,
    seconds=2.5, train=(0, 1, 2), test=tuple(range(10, 17)),
)  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Off(Settings):
    """How far it says that it is from where it is."""

    off_m: float = number(1.0, "m", "to the left", high=10.0)
    idle: float = number(1.0, "1", "nothing")


class OffSlam(OdometrySlam):
    """Odometry, some way to the left."""

    config_class = Off

    def __init__(self, config: dict[str, float] | None = None) -> None:
        self.config = Off().changed(config or {})
        super().__init__()

    def update(self, frame) -> Estimate:
        told = super().update(frame)
        aside = np.array([0.0, self.config.off_m, 0.0])
        return replace(told, T_map_robot=told.T_map_robot + aside)


@pytest.fixture(scope="module")
def out(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Where all of it goes: runs that are there are not made again."""
    with pytest.MonkeyPatch.context() as patched:
        patched.setitem(system._registry, "off", OffSlam)
        patched.setitem(tracks.TRACKS, TRACK.name, TRACK)
        folder = tmp_path_factory.mktemp("tuned")
        (folder / "off.toml").write_text("[numbers]\noff_m = {low = 0.01, high = 2, log = true}\n")
        (folder / "idle.toml").write_text("[numbers]\nidle = {choices = [1, 2, 3]}\n")
        yield folder


def task(out: Path, space: str = "off", **more) -> Task:
    named = {"slam": "off", "track": TRACK, "level": 0.5, "seeds": 3, "trials": 8, **more}
    return Task(space=read(out / f"{space}.toml", named["slam"]), **named)


def test_what_matters_is_found_and_fresh_seeds_confirm_it(out: Path):
    found = carry_out(task(out), out / "tune")
    assert found.trials[0].lost == 3
    assert found.best.lost == 0
    assert found.best.numbers["off_m"] < 0.3
    assert found.verdict is not None
    assert (found.verdict.gain, found.verdict.lost) == ("lost", (7, 0))
    told = json.loads((out / "tune" / "tune.json").read_text())
    assert told["best"] == f"off{{off_m={found.best.numbers['off_m']}}}"
    assert [finding.why for finding in check(out / "tune") if not finding.ok] == []


def test_a_search_that_was_stopped_asks_the_same_again(out: Path, monkeypatch: pytest.MonkeyPatch):
    whole = carry_out(task(out), out / "tune")
    made = {path: path.stat().st_mtime_ns for path in (out / "tune" / "search").iterdir()}

    def stop(plan, folder, jobs) -> list[Row]:
        raise OutputError("stopped")

    with monkeypatch.context() as patched:
        patched.setattr(make.comparison, "carry_out", stop)
        with pytest.raises(OutputError, match="stopped"):
            carry_out(task(out), out / "tune")
    assert carry_out(task(out), out / "tune").trials == whole.trials
    assert {p: p.stat().st_mtime_ns for p in (out / "tune" / "search").iterdir()} == made


def test_time_that_is_over_ends_it_and_more_time_goes_on(out: Path):
    search = Search(task(out, minutes=0.0, trials=None), out / "tune", 1)
    search.go_on()
    assert 9 <= len(search.trials) < 40  # those that are on file
    (out / "tune" / "spent.json").unlink()


def test_what_does_not_matter_is_no_gain(out: Path):
    found = carry_out(task(out, "idle", slam="off{off_m=0.1}", trials=None), out / "tune")
    assert len(found.trials) < 5  # the space has no others: it ends by itself
    assert found.verdict is None
    assert found.said[0] == "No gain: no trial was better on the training seeds."


def test_a_trial_stops_where_it_cannot_win_any_more(out: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("scripts.tuning.search.SIDE_BY_SIDE", 1)
    found = carry_out(task(out, slam="off{off_m=0.1}"), out / "tune")
    assert any(one.stopped for one in found.trials)
    best = 1e9
    for one in found.trials:
        total = sum(one.scores.values())
        assert one.stopped == (len(one.scores) < 3)
        assert total >= best or not one.stopped
        best = best if one.stopped else min(best, total)


def test_the_score_falls_from_failed_over_lost_to_held(tmp_path: Path, out: Path):
    recording = next((out / "tune" / "recordings").glob("*.npz"))

    def score(slam: str) -> float:
        (tmp_path / "search").mkdir(exist_ok=True)
        path = tmp_path / "search" / "run.npz"
        run.run(path, recording=str(recording), slam=slam)
        return float(np.load(path)["score"])

    assert score("shunting{decay_per_s=0.1,lateral_sum=0.9}") == run.FAILED  # not together
    assert run.FAILED == score("nothing:Here") >= score("off") > 1.0 > score("off{off_m=0.2}")
    assert score("off{off_m=0.2}") == pytest.approx(0.2, abs=0.05)


def test_the_verb_says_it_and_leaves_a_page(out: Path, monkeypatch: pytest.MonkeyPatch):
    space = out / "off.toml"
    words = f"tune off --space {space} --track tiny --seeds 3 --trials 8 --out {out / 'tune'}"
    done = CliRunner().invoke(app, words.split())
    assert done.exit_code == 0, done.output
    assert "Lost in 0 (95 %: 0 to 35 %) of 7 fresh runs instead of 7" in done.output
    lines, read = of_page(out / "tune" / "index.html"), read_by(monkeypatch)
    assert [line.split()[1] for line in lines] == ["report", "benchmark"]
    for line in lines:
        read(line)
    assert (out / "tune" / "judged" / "paired.csv").exists()


def test_it_says_so_where_no_trial_fitted(out: Path):
    none = Search(task(out), out / "tune", 1).first
    said = Tuned(task=task(out), trials=[none], best=none, verdict=None).said
    assert said == ["No gain: no trial fitted into the time."]

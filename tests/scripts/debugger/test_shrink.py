# SPDX-License-Identifier: Apache-2.0
"""A lost run is shrunk to what loses it, on SLAMs whose weakness is known by construction."""

import json
import subprocess
import sys
from hashlib import sha256
from pathlib import Path

import pytest
from typer.testing import CliRunner

from scripts.cli import app
from scripts.debugger import shrinking
from scripts.debugger.recording import Case
from scripts.debugger.shrinking import Shrinking, minimal
from scripts.debugger.shrunk import carry_out, shrunk
from scripts.film.footage import of_scene
from slam.errors import InvalidValueError, SlamFailedError
from tests.scripts.debugger.test_debugger import ROOM, SKITTISH

pytestmark = pytest.mark.slow
FAILING = """
class Failing(Skittish):
    '''Raises.'''

    def update(self, frame):
        raise ValueError("no")
"""
AGAIN = """
import sys
from hashlib import sha256
from pathlib import Path
from scripts.comparison.again import again
from scripts.debugger.shrinking import lost_row
from scripts.film.footage import of_scene
sys.path.insert(0, sys.argv[2])
frames = list(of_scene(again(Path(sys.argv[1])).told(), view=None).stream)
told = b"".join(f.scan.ranges.tobytes() + f.odometry.T_odom_robot.tobytes() for f in frames)
print(sha256(told).hexdigest(), lost_row("skittish_to_shrink:Skittish", frames) is not None)
"""


@pytest.fixture(scope="module", autouse=True)
def slams(tmp_path_factory):
    folder = tmp_path_factory.mktemp("slams")
    (folder / "skittish_to_shrink.py").write_text(SKITTISH + FAILING)
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(folder)
        yield folder


def case(name: str, **changes) -> Case:
    settings = {**ROOM, "seed": 6, "laser": "noise", **changes}
    return Case(settings=settings, seconds=6.0, slam=f"skittish_to_shrink:{name}", every=4)


@pytest.mark.parametrize("needed", [(), (5,), (0, 7), (2, 3, 6)])
def test_what_is_minimal_is_what_is_needed(needed):
    assert minimal(range(8), lambda kept: set(needed) <= set(kept)) == list(needed)


def test_none_can_be_left_out_where_any_two_will_do():
    assert len(minimal("abcdef", lambda kept: len(kept) > 1)) == 2


@pytest.fixture(scope="module")
def left(tmp_path_factory):
    out = tmp_path_factory.mktemp("shrink") / "out"
    return carry_out(case("Skittish"), out, overwrite=False, filmed=False), out


def test_the_one_who_startles_it_is_left(left):
    found, _ = left
    assert found.world["cut"]["keep"] == ("chair2",)
    assert found.sizes["movers"] == (3, 1)
    assert found.sizes["seconds"][1] < 2.5  # it is lost when it is off for a second
    assert found.sizes["beams"][1] < 100
    assert not found.stopped


def test_another_process_replays_the_same_bytes(left, slams: Path):
    found, out = left
    assert (out / "recipe.json").stat().st_size <= 1024
    words = [sys.executable, "-c", AGAIN, str(out), str(slams)]
    ran = subprocess.run(words, capture_output=True, text=True, check=True, cwd=Path.cwd())
    with of_scene(found.world, view=None) as footage:
        frames = list(footage.stream)
    told = b"".join(f.scan.ranges.tobytes() + f.odometry.T_odom_robot.tobytes() for f in frames)
    assert ran.stdout.split()[-2:] == [sha256(told).hexdigest(), "True"]


def test_a_run_of_it_is_of_that_part_and_is_not_shrunk_again(left, tmp_path: Path):
    found, out = left
    words = ["run", "odometry", "--recipe", str(out), "--no-film", "--out", str(tmp_path / "run")]
    assert CliRunner().invoke(app, words).exit_code == 0
    results = json.loads((tmp_path / "run" / "results.json").read_text())
    assert results["slams"]["odometry"]["scans"] == found.sizes["scans"][1]
    told = CliRunner().invoke(app, ["shrink", str(tmp_path / "run")])
    assert "is part of a run, which cannot be changed" in str(told.exception)


def test_events_that_need_not_be_are_left_out():
    events = [{"at_s": 1.0, "push": "chair1"}, {"at_s": 2.0, "push": "chair2"}]
    search = Shrinking(case("Skittish", events=events))
    search.smallest()
    assert search.case.settings["events"] == []


def test_a_run_that_is_not_lost_is_told_in_a_line():
    calm = case("Skittish", n_chairs=0, crowd="none", walls="none")
    with pytest.raises(InvalidValueError, match=r"is not lost in this run, .* 0\.01 m off at most"):
        shrunk(calm)
    with pytest.raises(SlamFailedError, match="no"):
        shrunk(case("Failing"))


def test_a_search_that_is_long_stops_with_what_it_has(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(shrinking, "MOST_S", 1.0)
    monkeypatch.setattr("scripts.debugger.shrunk.MOST_S", 1.0)
    found = shrunk(case("Skittish"))
    assert found.stopped
    assert found.sizes["movers"] == (3, 3)

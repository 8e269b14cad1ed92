# SPDX-License-Identifier: Apache-2.0
"""Opening somebody's data never runs code: hostile folders for every verb that opens anything.

``ROWS`` is the list of what is covered; docs/trust.md says it in words.
"""

import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from scripts.cli import app, main
from sim.core import state
from sim.recording.episode import record
from sim.recording.recipe import Recipe, read_recipe
from sim.simulation import Simulation
from sim.view import gl
from slam import create
from slam.errors import InvalidValueError, LogFormatError, UntrustedNameError
from slam.maps import read_map
from slam.names import NameFromFile
from slam.shunting import ShuntingSlam
from tests.hostile.folders import SCENE, SLAM, Hostile
from tests.processes import python

pytestmark = pytest.mark.fuzz
REPO = Path(__file__).resolve().parents[2]
STRIP = ["--strip", "s.png", "--at", "0.1"]
REFUSED = "pass --trust"
# what they are given is ours or typed, or goes through the readers of run --log
OPEN_NOTHING = {
    "demo", "list", "config", "bench", "doctor", "sensor-card", "live", "twin", "score",
    "reproduce", "tune",
}  # fmt: skip
Words = list[str]


@dataclass(frozen=True)
class Row:
    """A verb, what it opens, how the folder is made; ``says`` where it must refuse."""

    verb: str
    opens: str
    words: Callable[[Hostile], Words]
    says: str = ""


def _drive_run(h: Hostile) -> Words:
    return [str(h.run(scene="arena", slam=h.pipe)), *STRIP]


def _bag_run(h: Hostile) -> Words:
    return ["odometry", "--log", str(h.bag()), "--no-film", "--out", "out"]


def _map_run(h: Hostile) -> Words:
    names = ("header", "places", "x", "y", "age", "facing", "day_cells")
    there = h.pickled(h.path / "m.npz", *names)
    log = h.episode("arena")
    return ["shunting", "--log", str(log), "--map-in", str(there), "--no-film", "--out", "out"]


ROWS = [
    Row("benchmark", "submission: a command as SLAM",
        lambda h: ["--merge", str(h.submission()), "--tracks", "tour-guide", "--slam", "odometry",
                   "--seeds", "2", "--seconds", "0.5", "--out", str(h.path / "board")]),
    Row("verify", "submission: a command as SLAM", lambda h: [str(h.submission())]),
    Row("render", "run: a module as SLAM",
        lambda h: [str(h.run(scene="arena")), *STRIP], REFUSED),
    Row("render", "run: a command as SLAM", _drive_run, REFUSED),
    Row("render", "run: a module as scene",
        lambda h: [str(h.run(slam="ekf")), *STRIP], REFUSED),
    Row("render", "episode: a module as scene", lambda h: [str(h.episode()), *STRIP], REFUSED),
    Row("render", "bag: YAML with objects", lambda h: [str(h.bag()), *STRIP]),
    Row("blame", "run: a command as SLAM",
        lambda h: [str(h.run(scene="arena", slam=h.pipe))], REFUSED),
    Row("blame", "comparison: a module as scene",
        lambda h: [str(h.comparison(slam="ekf"))], REFUSED),
    Row("blame", "comparison: a command as SLAM",
        lambda h: [str(h.comparison(scene="arena", slam=h.pipe))], REFUSED),
    Row("blame", "comparison: arrays of objects",
        lambda h: [str(h.comparison(scene="arena", slam="odometry"))], "holds objects"),
    Row("gate", "results: a command as SLAM",
        lambda h: ["--against", str(h.submission()), "--slam", "odometry"]),
    Row("shrink", "run: a command as SLAM",
        lambda h: [str(h.run(scene="arena", slam=h.pipe))], REFUSED),
    Row("run", "run made again: a module as scene",
        lambda h: ["odometry", "--recipe", str(h.run(slam="ekf")), "--no-film"], REFUSED),
    Row("verify", "episode: YAML with objects", lambda h: [str(h.bag())]),
    Row("verify", "episode made again: a module as scene",
        lambda h: [str(h.episode()), "--regenerate", "1"], REFUSED),
    Row("run", "bag: YAML with objects", _bag_run),
    Row("run", "map of days: arrays of objects", _map_run, "holds objects"),
    Row("lifelong", "dataset of sessions: a module as scene",
        lambda h: [str(h.episode(session=0).parent), "--slam", "odometry", "--out", "life"]),
    Row("export", "episode: a module as scene", lambda h: [str(h.episode()), "--to", "tum"]),
    Row("report", "comparison: names of code, arrays of objects", lambda h: [str(h.report())]),
    Row("compare", "begun comparison: names of code, arrays of objects",
        lambda h: h.begun_comparison()),
    Row("drive", "begun drive: names of code, arrays of objects", lambda h: h.begun_drive()),
    Row("generate", "begun dataset: a module as scene", lambda h: h.dataset()[1]),
]  # fmt: skip


@pytest.fixture(scope="module")
def episode(tmp_path_factory: pytest.TempPathFactory) -> Path:
    recipe = Recipe(scene="arena", seed=1, dynamism=0.5, seconds=0.1)
    record(recipe, tmp_path_factory.mktemp("whole"))
    return next(iter(tmp_path_factory.getbasetemp().glob("whole*"))) / recipe.name


@pytest.fixture
def hostile(tmp_path: Path, episode: Path, monkeypatch) -> Iterator[Hostile]:
    (tmp_path / "ran").mkdir()
    monkeypatch.setattr(sys, "path", [*sys.path])
    folder = Hostile(tmp_path / "theirs", tmp_path / "ran", episode)
    monkeypatch.chdir(folder.path)
    yield folder
    sys.modules.pop("evilmod", None)


@pytest.fixture
def called(hostile: Hostile, capsys, monkeypatch) -> Callable[..., SimpleNamespace]:
    """``mobilia`` in the hostile folder, without the process."""

    def call(*words: str) -> SimpleNamespace:
        monkeypatch.setattr(sys, "argv", ["mobilia", *words])
        capsys.readouterr()
        try:
            main()
        except SystemExit as ended:
            status = ended.code
        except Exception as error:  # noqa: BLE001  (whether it is told well is not tested here)
            status = repr(error)
        printed = capsys.readouterr()
        return SimpleNamespace(status=status, out=printed.out, err=printed.err)

    return call


def ran(hostile: Hostile) -> list[str]:
    return sorted(path.name for path in hostile.ran.iterdir())


@pytest.mark.parametrize("row", ROWS, ids=lambda row: f"{row.verb}: {row.opens}")
def test_nothing_runs(row: Row, hostile: Hostile, called):
    done = called(row.verb, *row.words(hostile))
    assert ran(hostile) == []
    if row.says:
        assert done.status == 1
        assert row.says in done.err
        assert len(done.err.strip().splitlines()) == 1
        assert str(hostile.path) in done.err


def test_every_verb_has_a_row_or_a_reason():
    verbs = {command.name for command in app.registered_commands}
    assert {row.verb for row in ROWS} | OPEN_NOTHING == verbs
    assert not {row.verb for row in ROWS} & OPEN_NOTHING


@pytest.mark.parametrize(
    ("verb", "words", "names"),
    [
        ("render", lambda h: [str(h.run()), *STRIP], [SCENE, SLAM]),
        ("render", lambda h: [str(h.episode()), *STRIP], [SCENE]),
        ("blame", lambda h: [str(h.run()), "--at", "0.2", "--out", "b"], [SCENE, SLAM]),
        ("verify", lambda h: [str(h.episode()), "--regenerate", "1"], [SCENE]),
    ],
)
def test_trust_runs_it_and_says_so_before(verb, words, names, hostile: Hostile, called):
    done = called(verb, *words(hostile), "--trust")
    assert ran(hostile) == ["evilmod"]
    for name in names:
        told = [line for line in done.out.splitlines() if "--trust: running" in line]
        assert any(name in line and str(hostile.path) in line for line in told), done
    if verb != "verify":  # there the bag is the one of another scene's name, as the verdict says
        assert done.status == 0, done.err


def test_the_bait_is_live(hostile: Hostile, called):
    """Whoever takes it is caught: else these tests would show nothing."""
    folder = hostile.run(scene="arena", slam=hostile.pipe)
    assert called("render", str(folder), *STRIP, "--trust").status == 1  # ``touch`` is no SLAM
    with np.load(hostile.pickled(hostile.path / "a.npz", "a"), allow_pickle=True) as file:
        assert file["a"].dtype == object
    yaml = pytest.importorskip("yaml")
    yaml.unsafe_load((hostile.bag() / "metadata.yaml").read_text())
    assert ran(hostile) == ["pickle", "pipe", "yaml"]


@pytest.mark.parametrize("verb", ["render", "blame"])
@pytest.mark.parametrize(("typed", "runs"), [(SLAM, ["evilmod"]), ("odometry", [])])
def test_a_typed_slam_takes_the_place_of_the_named_one(verb, typed, runs, hostile, called):
    folder = hostile.run(scene="arena", slam=SLAM if runs else hostile.pipe)
    extra = STRIP if verb == "render" else ["--at", "0.2", "--out", "b"]
    done = called(verb, str(folder), "--slam", typed, *extra)
    assert done.status == 0, done.err
    assert "--trust" not in done.out
    assert ran(hostile) == runs


def test_the_readers_of_maps_states_and_recipes_run_nothing(hostile: Hostile):
    path = hostile.pickled(hostile.path / "map.npz", "header", "places", "x", "y", "age", "facing")
    with pytest.raises(LogFormatError):
        ShuntingSlam.load(path)
    with suppress(LogFormatError):
        read_map(hostile.map_yaml())
    simulation = Simulation("arena", dynamism=0.0)
    with pytest.raises(InvalidValueError):
        simulation.load_state(path.read_bytes())
    with pytest.raises(InvalidValueError):
        state.unpack(path.read_bytes())
    recipe = read_recipe(hostile.episode() / "recipe.json").recipe
    with pytest.raises(UntrustedNameError, match="evilmod:boom"):
        Simulation(**recipe.simulation())
    with pytest.raises(UntrustedNameError, match="pipe:touch"):
        create(NameFromFile(hostile.pipe, "recipe.json"))
    assert ran(hostile) == []


def in_process(hostile: Hostile, *words: str, **environment: str) -> subprocess.CompletedProcess:
    """As the installed command starts: by a script in a folder of its own."""
    start = hostile.path.parent / "bin" / "mobilia"
    start.parent.mkdir(exist_ok=True)
    start.write_text("from scripts.__main__ import main\nmain()\n")
    return python(start, *words, cwd=hostile.path, check=False, **environment)


def test_modules_of_the_working_folder_stay_out_of_command_workers_and_gl(hostile: Hostile):
    words = ["arena", "--seconds", "0.1", "--episodes", "2", "--out", "data", "--jobs", "2"]
    done = in_process(hostile, "generate", *words)
    assert done.returncode == 0, done.stderr
    assert gl._try("import json, numpy", None) is None
    assert ran(hostile) == []


def test_settings_of_the_working_folder_stay_out(hostile: Hostile):
    """And an empty entry of PYTHONPATH, which Python takes for the working folder, goes."""
    program = hostile.path.parent / "look.py"
    program.write_text(
        "import os, sys\n"
        "from scripts.__main__ import leave_out\n"
        "leave_out()\n"
        "assert os.getcwd() not in sys.path, sys.path\n"
        "assert '' not in os.environ['PYTHONPATH'].split(os.pathsep)\n"
        "import slam, matplotlib, numba\n"
        "numba.core.config.reload_config()\n"
        "print(numba.config.CACHE_DIR or 'none', matplotlib.rcParams['font.size'])\n"
    )
    for name in ("sitecustomize", "usercustomize", "json"):  # before we can do anything
        (hostile.path / f"{name}.py").unlink()
    done = subprocess.run(
        [sys.executable, program], cwd=hostile.path, capture_output=True, text=True, check=False,
        env={**os.environ, "PYTHONPATH": f"{REPO}{os.pathsep}{os.pathsep}/nowhere"},
    )  # fmt: skip
    assert done.stdout == "none 10.0\n", done.stderr
    assert ran(hostile) == []


def test_a_typed_module_is_found_in_the_working_folder_by_guests_too(hostile: Hostile):
    """Its neighbours that are called like modules of ours are not taken for these."""
    for name in ("sitecustomize", "usercustomize"):  # Python itself takes them from PYTHONPATH
        (hostile.path / f"{name}.py").unlink()
    done = in_process(
        hostile, "compare", "--slam", SLAM, "odometry", "--scene", "arena", "--dynamism", "0.5",
        "--seeds", "1", "--seconds", "0.5", "--jobs", "1", "--out", "compared",
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert "finished" in (hostile.path / "compared" / "runs.csv").read_text()
    assert ran(hostile) == ["evilmod"]

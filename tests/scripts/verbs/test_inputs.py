# SPDX-License-Identifier: Apache-2.0
"""No verb writes over what it reads, whatever it is asked for."""

import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from scripts.cli import app
from scripts.option_names import Verb
from scripts.output import together, write_recipe
from scripts.single_run import run
from scripts.verbs.scene import scene
from scripts.whole_folder import whole_folder
from sim.recording.episode import record
from sim.recording.recipe import Recipe
from sim.simulation import stream
from slam import inputs
from slam.errors import OutputError
from slam.files import write_text
from slam.logs import write_carmen

pytestmark = pytest.mark.slow
REFUSED = "is what this command reads: write to another place"
Words = list[str | Path]


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """``a.log.gz``, an episode ``bag``, an earlier ``run``, a map ``lab.yaml`` and ``lab.png``."""
    folder = tmp_path_factory.mktemp("made")
    write_carmen(folder / "a.log.gz", stream("arena", seed=3, dynamism=0.0, seconds=0.3))
    recipe = Recipe(scene="arena", seed=1, dynamism=0.5, seconds=0.2)
    record(recipe, folder)
    (folder / recipe.name).rename(folder / "bag")
    with whole_folder(folder / "run", overwrite=False) as part:
        write_recipe(part, "run", {"scene": "arena", "slams": ["odometry"], "seconds": 0.3})
        shutil.copy(folder / "a.log.gz", part / "kept.log.gz")
    walls = np.full((60, 80), 254, dtype=np.uint8)
    walls[5:8, 5:75] = walls[52:55, 5:75] = walls[5:55, 5:8] = walls[5:55, 72:75] = 0
    cv2.imwrite(str(folder / "lab.png"), walls)
    (folder / "lab.yaml").write_text(
        "image: lab.png\nresolution: 0.05\norigin: [0, 0, 0]\n"
        "negate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n"
    )
    return folder


@dataclass(frozen=True)
class Way:
    """A command line in a copy of ``made``, after ``first``; what it would write over."""

    words: str
    over: str
    first: Callable[[Path], object] = lambda folder: None


def copied(old: str, new: str) -> Callable[[Path], object]:
    return lambda folder: shutil.copy(folder / old, folder / new)


BAG = "bag/arena-d0.5-s0001.mcap"
WAYS = [
    Way("scene from-map lab.yaml", "lab.png"),
    Way("scene from-map lab.yaml --overwrite", "lab.png"),
    Way("scene from-map lab.yaml --out ../here/lab --overwrite", "lab.png"),
    Way("scene from-map lab.toml --overwrite", "lab.toml", copied("lab.yaml", "lab.toml")),
    Way("scene from-log a.xml --out a --overwrite --slam occupancy", "a.xml",
        copied("a.log.gz", "a.xml")),
    Way("export a.log.gz --to carmen", "a.log.gz"),
    Way("export a.log.gz --to npz --out ./a.log.gz", "a.log.gz"),
    Way(f"export bag --to npz --out {BAG}", BAG),
    Way(f"export {BAG} --to carmen --out {BAG}", BAG),
    Way("export a_truth.tum --to tum --out a.tum", "a_truth.tum",
        copied("a.log.gz", "a_truth.tum")),
    Way("render a.mp4 --out a.mp4 --slam odometry", "a.mp4", copied("a.log.gz", "a.mp4")),
    Way("render a.png --strip a.png --at 0 --slam odometry", "a.png", copied("a.log.gz", "a.png")),
    Way("render a.html --replay a.html --slam odometry", "a.html", copied("a.log.gz", "a.html")),
    Way("twin run/twin.log --out run --overwrite", "run/twin.log",
        copied("a.log.gz", "run/twin.log")),
    Way("run odometry --log run/kept.log.gz --no-film --out run --overwrite", "run/kept.log.gz"),
    Way("run shunting --log a.log.gz --map-out a.log.gz", "a.log.gz"),
    Way("run shunting --log a.log.gz --map-in m.npz --map-out m.npz", "m.npz",
        lambda folder: (folder / "m.npz").write_text("a map")),
    Way("score bag --out bag --overwrite", BAG),
    Way("blame run --out run --overwrite", "run/recipe.json"),
    Way("blame bag --out bag --overwrite", "bag/recipe.json"),
    Way("shrink run --out run --overwrite", "run/recipe.json"),
    Way("lifelong bag --out bag --overwrite", "bag/recipe.json"),
    Way("sensor-card --log out.log --out out.log", "out.log", copied("a.log.gz", "out.log")),
    Way("generate lab.toml --out lab.toml", "lab.toml", copied("lab.yaml", "lab.toml")),
    Way("reproduce theory --data bag --out bag", BAG),
]  # fmt: skip


@pytest.mark.parametrize("way", WAYS, ids=lambda way: way.words)
def test_what_is_read_is_not_written_over(way, made, tmp_path, called, monkeypatch):
    here = Path(shutil.copytree(made, tmp_path / "here"))
    monkeypatch.chdir(here)
    way.first(here)
    before = everything(here)
    assert str(here / way.over) in before
    done = called(*way.words.split())
    assert done.returncode == 1
    assert done.stderr.count("\n") == 1
    assert REFUSED in done.stderr
    assert "--overwrite" not in done.stderr
    assert before.items() <= everything(here).items()


def everything(folder: Path) -> dict[str, bytes]:
    return {str(file): file.read_bytes() for file in sorted(folder.rglob("*")) if file.is_file()}


def test_the_same_beside_it_is_written(made: Path, tmp_path: Path, called, monkeypatch):
    here = Path(shutil.copytree(made, tmp_path / "here"))
    monkeypatch.chdir(here)
    (here / "lab.xml").write_text("mine")
    done = called("scene", "from-map", "lab.yaml", "--out", "other")
    assert done.returncode == 0, done.stderr
    done = called("scene", "from-map", "lab.yaml", "--out", "other")
    assert done.returncode == 2
    names = "other.toml, other.xml, other.png"
    assert f"there already: {names}: --overwrite replaces them" in done.stderr
    assert called("scene", "from-map", "lab.yaml", "--out", "other", "--overwrite").returncode == 0
    assert called("export", "a.log.gz", "--to", "tum").returncode == 0
    assert called("export", "a.log.gz", "--to", "tum").returncode == 0  # what it wrote itself
    (here / "arena").mkdir()  # a name of a scene is not the folder of that name
    words = ["--seconds", "0.2", "--no-film", "--out", "arena"]
    assert called("run", "odometry", "--scene", "arena", *words).returncode == 0
    assert called("run", "odometry", "--scene", "arena", *words, "--overwrite").returncode == 0
    assert (here / "lab.xml").read_text() == "mine"


def test_a_map_of_days_goes_on_in_its_place(tmp_path: Path, monkeypatch):
    """That is what ``--map-in`` alone asks for (docs/days.md)."""
    monkeypatch.setattr(run, "keep", lambda _, path: write_text(path, "a day more") or path)
    path, apart = tmp_path / "m.npz", tmp_path / "n.npz"
    path.write_text("a day")
    session = SimpleNamespace(state=SimpleNamespace(found_after_s=1.0, fits=True))
    with inputs.of_one_command():
        inputs.note(path)
        run.kept(session, run.Maps(map_in=path, map_out=apart))
        assert path.read_text() == "a day"
        assert run.kept(session, run.Maps(map_in=path))
        assert path.read_text() == "a day more"
        session.state.found_after_s = None  # told once: no clocks and wheels are suspected too
        assert not run.kept(session, run.Maps(map_in=path))


def test_tables_that_would_take_the_place_of_what_is_read_are_not_moved(tmp_path: Path):
    """As ``benchmark --merge OUT/submission_a.json --submit a --out OUT``."""
    write_text(tmp_path / "submission_a.json", "theirs")
    with inputs.of_one_command():
        inputs.note(tmp_path / "submission_a.json")
        with pytest.raises(OutputError, match=REFUSED), together(tmp_path) as staged:
            write_text(staged / "submission_a.json", "ours")
    assert everything(tmp_path) == {str(tmp_path / "submission_a.json"): b"theirs"}


def test_links_and_other_ways_to_say_it_are_the_same_file(tmp_path: Path):
    (tmp_path / "a").write_text("mine")
    (tmp_path / "link").symlink_to("a")
    with inputs.of_one_command():
        inputs.note(tmp_path / "a", tmp_path / "missing", Path("\0"))
        for name in ("a", "link", "../" + tmp_path.name + "/a"):
            with pytest.raises(OutputError, match=REFUSED):
                write_text(tmp_path / name, "over it")
        write_text(tmp_path / "missing", "new")
    assert (tmp_path / "a").read_text() == "mine"


def test_every_path_of_a_verb_is_read_or_written():
    """A new one is to be put here, or ``writes=True``."""
    read = {"against", "data", "bag", "episode", "events", "folder", "log", "map_in", "map_yaml",
            "merge", "on", "recipe", "scene", "space", "text_format"}  # fmt: skip
    paths = [
        one
        for command in (*app.registered_commands, *scene.registered_commands)
        for one in getattr(command.callback, "options", ())
        if "Path" in str(one.kind)
    ]
    assert {one.name for one in paths if not one.writes} == read
    assert {one.name for one in paths if one.writes} == {
        "out", "strip_to", "replay", "page", "map_out", "save"
    }  # fmt: skip
    assert all(issubclass(one.cls, Verb) for one in app.registered_commands)

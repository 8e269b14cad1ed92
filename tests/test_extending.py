# SPDX-License-Identifier: Apache-2.0
"""docs/extending.md does what it says: each recipe is followed literally, in an empty folder."""

import json
import re
import shlex
import sys
from pathlib import Path

import imageio.v2 as imageio
import numpy as np
import pytest
from typer.testing import CliRunner

import scenes
from scripts.benchmark.tracks import TRACKS
from scripts.cli import app
from scripts.film import panes
from scripts.single_run import session
from sim.core import versions
from sim.core.versions import WorldVersionError
from sim.recording import topics
from sim.sensors.lidar import registry as scanners
from slam import system
from slam.errors import (
    InvalidValueError,
    LogFormatError,
    UnknownNameError,
    UntrustedNameError,
)
from slam.logs import open as logs
from slam.logs.bag_topics import Bag
from slam.names import NameFromFile, load

pytestmark = pytest.mark.docs
PAGE = (Path(__file__).resolve().parents[1] / "docs" / "extending.md").read_text()
HEADINGS = {part.partition("\n")[0]: part.partition("\n")[2] for part in PAGE.split("\n## ")[1:]}
BLOCK = re.compile(r"```(\w+)\n(.*?)```", re.DOTALL)
MODULES = (
    "shed",
    "storeroom",
    "carts",
    "lab_lidar",
    "my_log",
    "my_track",
    "speeds",
    "worst",
    "turning",
    "speed",
)


@pytest.fixture
def outside(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty folder to stand in; what is registered there is forgotten afterwards."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [*sys.path, str(tmp_path)])
    scanners.names()  # which loads our own, once
    for module, registry in (
        (panes, "_panes"), (topics, "_topics"), (scanners, "_models"), (system, "_registry"),
        (session, "_files"), (logs, "_registered"),
    ):  # fmt: skip
        monkeypatch.setattr(module, registry, getattr(module, registry).copy())
    monkeypatch.setattr(versions, "WORLD", versions.WORLD)
    monkeypatch.setattr(sys.modules["slam.names"], "_loaded", [])
    for name in MODULES:
        monkeypatch.delitem(sys.modules, name, raising=False)
    yield tmp_path
    TRACKS.pop("full-hall-v1", None)
    scenes.kinds.KINDS.pop("cart", None)
    for name in MODULES:
        sys.modules.pop(name, None)


def blocks(heading: str) -> list[tuple[str, str, str]]:
    """(file to save as or "", language, text) of each block under that heading."""
    found, text = [], HEADINGS[heading]
    for block in BLOCK.finditer(text):
        before = text[: block.start()].rstrip().rpartition("\n\n")[2]
        saved = re.search(r"[Ss]ave [^.`]*?as\s+`(\w+\.\w+)`:$", before)
        found.append((saved[1] if saved else "", block[1], block[2]))
    return found


def follow(heading: str, folder: Path) -> None:
    """Save what is to be saved, run what is to be run."""
    for saved, language, text in blocks(heading):
        if saved:
            (folder / saved).write_text(text)
        elif language == "python":
            exec(compile(text, heading, "exec"), {})
        else:
            assert language == "sh", heading
            for line in text.splitlines():
                done = CliRunner().invoke(app, shlex.split(line)[1:], catch_exceptions=False)
                assert done.exit_code == 0, done.output


def test_places_in_the_table_exist():
    repo = Path(__file__).resolve().parents[1]
    for row in re.findall(r"^\|.*\|$", PAGE, re.MULTILINE):
        for place in re.findall(r"`((?:slam|sim|scenes|scripts)/[\w/]*(?:NAME)?[\w.]*)`", row):
            path = repo / place
            assert (path.parent if "NAME" in place else path).exists(), place


def test_scene(outside: Path):
    follow("Scene", outside)
    scene = scenes.build("shed:shed", 3, n_chairs=4)
    assert [mover.kind.startswith("chair") for mover in scene.movers].count(True) == 4
    assert scene.compile().body("desk0/base").id > 0
    assert scene.bounds == (-3.0, -2.0, 3.0, 2.0)


WRONG = {
    'material="floor_concrete"': ('material="marble"', "marble.*There are: .*floor_concrete"),
    'name="start:robot"': ('name="start:robt"', "mark 'start:robt' must be written start:robot"),
    'pos="-2 0 0"': ('pos="-9 0 0"', r"start:robot at \(-9, 0\) is in no room"),
    "desk:shed:0": ("dsk:shed:0", "unknown mark 'dsk:shed:0'.*'desk'.*room:NAME.*bookshelf"),
    "start:robot": ("goal:there", "needs a mark 'start:robot'"),
    "room:shed": ("opening:shed", "needs a mark 'room:NAME'"),
    "desk:shed": ("door:shed", "'door:shed:0' must be written door:ROOM:left|right"),
    'class="wall"': ('class="wal"', "shed.xml.*'wal'"),
    "</worldbody>": ("", "shed.xml.*mismatched tag"),
    "0 2.1 0.55": ("0 up 0.55", "shed.xml"),
}


@pytest.mark.parametrize("right", WRONG)
def test_what_is_wrong_in_a_plan_is_named_with_what_there_is(outside: Path, right: str):
    (_, _, plan), *_ = blocks("Scene")
    wrong, words = WRONG[right]
    (outside / "shed.xml").write_text(plan.replace(right, wrong))
    with pytest.raises(InvalidValueError, match=words.replace("|", r"\|")):
        scenes.filled(outside / "shed.xml", 1)


def test_an_include_of_ones_own_is_left_as_it_is(outside: Path):
    (_, _, plan), *_ = blocks("Scene")
    common = Path(scenes.__file__).parent / "parts" / "common.xml"
    world = Path(scenes.__file__).parent / "plans" / "world.xml"
    lines = f'<mujoco><include file="{common}"/><include file="{world}"/>'
    (outside / "other.xml").write_text(plan.replace("<mujoco>", lines))
    (outside / "shed.xml").write_text(plan)
    with_include, without = (scenes.filled(outside / n, 1) for n in ("other.xml", "shed.xml"))
    assert with_include.initial == without.initial
    assert with_include.compile().ngeom == without.compile().ngeom


def test_furniture(outside: Path):
    follow("Furniture", outside)
    model = scenes.build("storeroom:storeroom", 1).compile()
    np.testing.assert_allclose(model.body("crate0/base").pos, [1.0, 2.0, 0.0])
    assert scenes.build("storeroom:storeroom", 1).static_map.values.sum() > (
        scenes.filled("arena", 1).static_map.values.sum()
    )
    (_, _, part), *_ = blocks("Furniture")
    (outside / "box.xml").write_text(part.replace("carton", "cardboard"))
    with pytest.raises(InvalidValueError, match=r"part 'box'.*'cardboard'. There are: .*carton"):
        scenes.filled("arena", 1, put=[(outside / "box.xml", (1.0, 2.0, 0.0))])
    with pytest.raises(InvalidValueError, match=r"no file 'box.xml'.* there are .*bookshelf"):
        scenes.filled("arena", 1, put=[("box", (1.0, 2.0, 0.0))])


def test_furniture_on_castors(outside: Path):
    follow("Furniture on castors", outside)
    scene = scenes.build("carts:carts", 1)
    assert [mover.name for mover in scene.movers if mover.kind == "cart"] == ["cart0", "cart1"]
    scenes.kinds.register("cart", scenes.kinds.KINDS["cart"])
    with pytest.raises(InvalidValueError, match=r"'cart'.*trolley"):
        scenes.kinds.register("cart", scenes.kinds.KINDS["bin"])
    with pytest.raises(UnknownNameError, match="'sleigh'"):
        scenes.filled("arena", 1, loads={"sleigh": 1})


def test_a_mark_puts_furniture_of_ones_own(outside: Path):
    (_, _, plan), *_ = blocks("Scene")
    (_, _, part), *_ = blocks("Furniture")
    (outside / "crate.xml").write_text(part)
    (outside / "shed.xml").write_text(plan.replace("desk:shed:0", "crate:0"))
    scene = scenes.filled(outside / "shed.xml", 1, parts=[outside / "crate.xml"])
    assert [0.0, 1.5, 0.3, 0.3, 0.0] in scene.obstacles.tolist()


def test_scanner(outside: Path):
    follow("Scanner", outside)
    settings = json.loads((outside / "out/lidar/recipe.json").read_text())["settings"]
    assert settings["laser"] == "lab_lidar(rate_hz=10):noise"
    assert scanners.scanner_of("lab_lidar(rate_hz=10)").scanner().rate_hz == 10.0


def test_log_format(outside: Path):
    rows = [[0.1 * k, 0.02 * k, 0.0, 0.0, *[4.0] * 19] for k in range(20)]
    np.savetxt(outside / "drive.csv", rows, delimiter=",", header="t,x,y,theta,ranges")
    follow("Log format", outside)
    assert json.loads((outside / "out/log/results.json").read_text())["slams"]["odometry"]
    logs._registered.clear()
    with pytest.raises(LogFormatError, match="of no known format"):
        logs.open_log(outside / "drive.csv")


def test_track(outside: Path):
    follow("Track", outside)
    board = json.loads((outside / "out/track/leaderboard.json").read_text())
    assert set(board["tracks"]) == {"full-hall-v1"}
    assert board["tracks"]["full-hall-v1"]["sha256"] == TRACKS["full-hall-v1"].sha256


def test_file_of_a_run(outside: Path):
    follow("File of a run", outside)
    assert len(np.loadtxt(outside / "out/speeds/speeds.csv")) > 10
    assert "speeds.csv" in (outside / "out/speeds/SHA256SUMS").read_text()
    with pytest.raises(InvalidValueError, match="name of its own"):
        session.run_file("speeds.csv")(lambda path, show: None)


def test_world(outside: Path):
    before = versions.WORLD
    follow("World", outside)
    with pytest.raises(WorldVersionError, match=f"of world version {before}, this mobilia has"):
        TRACKS["rush-hour-v1"].plan((), (720,))


def test_metric(outside: Path, capsys: pytest.CaptureFixture[str]):
    follow("Metric", outside)
    found = eval(capsys.readouterr().out)
    assert 0.0 < found["shunting"] < 0.5
    assert 0.0 < found["odometry"] < 0.5


def test_topic(outside: Path):
    follow("Topic", outside)
    (episode,) = (path for path in (outside / "out/turning").iterdir() if path.is_dir())
    with Bag(episode) as bag:
        found = [topic for topic, *_ in bag.raw()]
    assert found.count("/turning") == found.count("/scan") > 10
    words = ["--with", "turning", "verify", str(episode), "--regenerate", "1"]
    assert CliRunner().invoke(app, words).exit_code == 0
    topics._topics.clear()
    done = CliRunner().invoke(app, words[2:])
    assert done.exit_code == 1
    assert "/turning" in done.output


def test_a_topic_that_cannot_be_is_refused():
    with pytest.raises(InvalidValueError, match="/scan"):
        topics.topic("/scan", "std_msgs/msg/Float64")
    with pytest.raises(UnknownNameError, match="Flaot64"):
        topics.topic("/new", "std_msgs/msg/Flaot64")


def test_film_pane(outside: Path):
    follow("Film pane", outside)
    poster = np.asarray(imageio.imread(outside / "out/speed/poster.png"))
    painted = np.abs(poster[..., :3].astype(int) - (0, 0, 255)).sum(axis=2) < 30
    assert painted.sum() > 100
    assert np.flatnonzero(painted.any(axis=0)).min() > 1280 - 16 - 220


def test_a_pane_of_another_size_is_refused_by_name(outside: Path):
    panes.pane("small")(lambda show, frame, size: panes.blank((2, 2)))
    with pytest.raises(InvalidValueError, match="'small'"):
        panes.painted("small", None, None, (20, 10))


def test_numbers(outside: Path):
    follow("Dynamism rate", outside)
    follow("Lost rule", outside)
    assert (outside / "out/lost/results.json").exists()


def test_a_module_that_cannot_be_loaded_is_named(outside: Path):
    (outside / "speed.py").write_text("1 / 0")
    with pytest.raises(InvalidValueError, match=r"'speed' fails: ZeroDivisionError"):
        load(["speed"])
    with pytest.raises(UnknownNameError, match="no_such_module"):
        load(["no_such_module"])
    with pytest.raises(UntrustedNameError, match=r"theirs\.json"):
        load([NameFromFile("speed", "theirs.json")])

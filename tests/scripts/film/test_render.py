# SPDX-License-Identifier: Apache-2.0
"""Films of runs, episodes and logs: the promised size, rate and length, with and without GL."""

import json
import math
from pathlib import Path
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from PIL import Image
from typer.testing import CliRunner

from scripts.cli import app
from scripts.film.footage import of_scene, open_run
from scripts.film.map_pane import RobotScan
from scripts.film.panes import Layout
from scripts.film.render import Liveliest
from sim.core.versions import WORLD
from sim.recording.episode import record
from sim.recording.recipe import Recipe
from sim.simulation import stream
from sim.view import gl
from sim.view.draw import AZURE, BLUE, GRAY, GREEN, MAGENTA, TEAL, VIOLET
from sim.view.gl import Gl
from sim.view.scans import LEGEND, beam_colors
from slam.errors import MobiliaError
from slam.frames import BeamClass, BeamLabels, Frame, LaserSpec, Odometry, Scan
from slam.logs.carmen import write_carmen
from tests.pictures import pictures_at

pytestmark = pytest.mark.film
SETTINGS = {"scene": "arena", "seconds": 2.0, "dynamism": 1.0, "seed": 3}


@pytest.fixture
def without_gl(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(gl, "find", lambda: Gl(backend=None, reason="no GL here"))


@pytest.fixture
def run(tmp_path: Path) -> Path:
    folder = tmp_path / "run"
    folder.mkdir()
    settings = {**SETTINGS, "slams": ["shunting", "odometry"], "simulation": {}}
    recipe = {"schema": 1, "command": "run", "settings": settings, "versions": {}, "world": WORLD}
    (folder / "recipe.json").write_text(json.dumps(recipe))
    return folder


def render(*words: str | Path) -> str:
    """What the verb prints, in one line; raises what it raises."""
    done = CliRunner().invoke(app, ["render", *map(str, words)])
    if done.exception is not None:
        raise done.exception
    return " ".join(done.output.split())


def decoded(path: Path) -> tuple[list[np.ndarray], float]:
    """Every picture of a film, and its rate."""
    film = cv2.VideoCapture(str(path))
    pictures = []
    while (read := film.read())[0]:
        pictures.append(read[1])
    fps = film.get(cv2.CAP_PROP_FPS)
    film.release()
    return pictures, fps


def test_a_film_has_the_size_rate_and_length_it_should(run: Path, tmp_path: Path, without_gl):
    out, strip = tmp_path / "film.mp4", tmp_path / "strip.png"
    said = render(run, "--out", out, "--strip", strip, "--at", "0,1", "--size", "640x360")
    pictures, fps = decoded(out)
    assert fps == 30.0
    assert len(pictures) == math.floor((round(2.0 * 37.5) - 1) / 37.5 * 30.0) + 1
    assert {p.shape for p in pictures} == {(360, 640, 3)}
    assert pictures[-1].std() > 20.0
    assert "no 3D panel: no GL here" in said
    assert f"{len(pictures)} pictures" in said
    with Image.open(strip) as image:
        assert image.size[0] > 2 * 400


def test_the_pictures_do_not_depend_on_which_others_were_taken():
    alone = of_scene(SETTINGS, view=None)
    among = of_scene(SETTINGS, view=None)
    (want,) = pictures_at(alone.stream, alone.show(["odometry"]), [1.5])
    got = pictures_at(among.stream, among.show(["odometry"]), [0.2, 0.9, 1.5])[-1]
    np.testing.assert_array_equal(got, want)
    assert got.shape[1] == Layout.of((1280, 720), camera=False).scan.width


def test_an_episode_is_filmed_with_its_world_and_truth(tmp_path: Path):
    record(Recipe(scene="arena", seed=1, dynamism=0.5, seconds=1.0), tmp_path)
    (folder,) = tmp_path.iterdir()
    with open_run(folder, view=None) as footage:
        assert footage.title == "arena · dynamism 0.5 · seed 1"
        (picture,) = pictures_at(footage.stream, footage.show(["odometry"]), [0.5], whole=True)
    assert (picture == AZURE).all(axis=2).sum() > 100
    assert (picture == GREEN).all(axis=2).any()


def test_a_twin_is_filmed_from_above(tmp_path: Path):
    record(Recipe(scene="arena", seed=1, dynamism=1.0, seconds=0.5, twin="dynamic"), tmp_path)
    last = []
    for name in ("static", "dynamic"):
        with open_run(tmp_path / f"arena-d1-s0001-{name}") as footage:
            assert footage.title.endswith(f"{name} twin")
            assert "twins" in footage.no_camera
            last.append(pictures_at(footage.stream, footage.show(["odometry"]), [0.4])[0])
    assert (last[0] != last[1]).any()


def test_a_log_without_truth_is_filmed_without_it(tmp_path: Path):
    log = tmp_path / "bare.log"
    write_carmen(log, stream("arena", seed=1, seconds=1.0))
    bare = [line for line in log.read_text().splitlines() if not line.startswith("TRUEPOS")]
    log.write_text("\n".join(bare) + "\n")
    with open_run(log) as footage:
        show = footage.show(["odometry"])
        (picture,) = pictures_at(footage.stream, show, [0.9], whole=True)
    assert (picture == BLUE).all(axis=2).sum() > 100
    assert [name for name, _ in show.moments.named()] == ["odometry"]
    assert not (picture == GREEN).all(axis=2).any()
    assert not (picture == MAGENTA).all(axis=2).any()


@pytest.mark.parametrize("size", [(1280, 720), (640, 360), (1920, 1080), (1000, 1000)])
@pytest.mark.parametrize("camera", [True, False])
def test_panes_lie_inside_the_frame_and_apart(size, camera):
    layout = Layout.of(size, camera=camera)
    boxes = [layout.scan, layout.map, layout.chart, layout.close]
    boxes += [layout.camera] if layout.camera is not None else []
    assert (layout.camera is not None) == camera
    taken = np.zeros((size[1], size[0]), int)
    for box in boxes:
        assert box.x >= 0
        assert box.y >= 40 * layout.unit
        assert box.x + box.width <= size[0]
        assert box.y + box.height <= size[1]
        taken[box.y : box.y + box.height, box.x : box.x + box.width] += 1
    assert taken.max() == 1
    assert taken.mean() > (0.7 if not camera else 0.75)


def labelled() -> Frame:
    spec = LaserSpec(n_beams=5, angle_min=-1.0, angle_increment=0.5)
    kinds = [BeamClass.STATIC, BeamClass.SEMI_STATIC, BeamClass.MOVING, BeamClass.MOVING, 0]
    labels = BeamLabels(
        body=np.array([0, 1, 2, 2, -1], np.int32), kind=np.array(kinds, np.uint8),
        displacement=np.zeros(5), incidence=np.zeros(5), mixed=np.array([0, 0, 0, 1, 0], bool),
    )  # fmt: skip
    ranges = np.array([2.0, 2.0, 2.0, 2.0, np.inf], np.float32)
    odometry = Odometry(stamp_ns=0, T_odom_robot=np.zeros(3))
    scan = Scan(stamp_ns=0, ranges=ranges, spec=spec)
    return Frame(stamp_ns=0, odometry=odometry, scan=scan, labels=labels)


def test_beams_have_the_colour_of_what_they_hit_and_the_legend_says_which():
    colors = beam_colors(labelled())
    assert colors.tolist() == [list(c) for c in (AZURE, TEAL, MAGENTA, VIOLET, GRAY)]
    assert [color for _, color in LEGEND] == [AZURE, TEAL, MAGENTA, VIOLET, GRAY]
    picture = RobotScan((400, 300), 1.0)(labelled())
    for color in (AZURE, TEAL, MAGENTA, VIOLET):
        assert (picture == color).all(axis=2).any()
    assert (beam_colors(labelled().without_truth())[:4] == BLUE).all()


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("--size", "1280x721"), "--size must be even numbers"),
        (("--fps", "0"), "fps must be a number from 1 to 240, got 0.0"),
        (("--from", "5"), "--from must be >= 0 s and before --to"),
        (("--view", "side"), "--view must be one of follow, top, persp, got 'side'"),
        (("--at", "3,x", "--strip", "x.png"), "--at must be seconds"),
        (("--at", "3,1", "--strip", "x.png"), "rising order"),
        (("--at", "3,99", "--strip", "x.png"), "--at must lie within the run's"),
        (("--at", "1"), "--at names the moments of --strip"),
        (("--strip", "x.txt"), "--strip must be a file that ends in .png, got 'x.txt'"),
        (("--out", "film.xyz"), "--out must be a file that ends in .mp4"),
    ],
)
def test_a_wrong_option_is_named_and_nothing_is_written(run: Path, tmp_path: Path, words, says):
    with pytest.raises(MobiliaError, match=r"^[^\n]*$") as caught:
        render(run, "--out", tmp_path / "film.mp4", *words)
    assert says in str(caught.value)
    assert [p.name for p in tmp_path.iterdir()] == ["run"]


def test_a_replay_is_written_whole(run: Path, tmp_path: Path):
    pytest.importorskip("viser")
    out = tmp_path / "run.html"
    render(run, "--replay", out, "--slam", "odometry", "--to", "0.5", "--no-3d")
    assert "__VISER_EMBED_DATA__" in out.read_text()
    assert {p.name for p in tmp_path.iterdir()} == {"run", "run.html"}


def test_the_poster_is_of_the_second_in_which_most_moved():
    def told(moving: int) -> SimpleNamespace:
        kind = np.array([BeamClass.MOVING] * moving + [BeamClass.STATIC] * (9 - moving), np.uint8)
        return SimpleNamespace(labels=SimpleNamespace(kind=kind))

    lively = Liveliest(least_s=1.0)
    for k, moving in enumerate([9, 0, 0, 0, 3, 4, 5, 1, 0, 0]):  # early ones do not count
        lively.note(told(moving), 0.5 * k, f"picture {k}")
    assert lively.picture == "picture 6"
    blind = Liveliest(least_s=1.0)
    for k in range(4):
        blind.note(SimpleNamespace(labels=None), 0.5 * k, f"picture {k}")
    assert blind.picture == "picture 3"

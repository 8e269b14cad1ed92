# SPDX-License-Identifier: Apache-2.0
"""Pages of every kind: each command on them is read, and those that are cheap run as printed."""

import shlex
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from typer.testing import CliRunner

from scripts.cli import app
from scripts.verbs.live import Live
from tests.commands import of_page, read_by

pytestmark = pytest.mark.slow
QUICK = {  # what is added for a command to be over soon
    "run": "--no-film --overwrite",
    "compare": "--plan", "benchmark": "--plan", "blame": "--top 1 --repeats 0 --overwrite",
    "render": "--no-3d --to 0.1 --size 320x240", "live": "", "verify": "", "report": "",
}  # fmt: skip
FOR = {"LOG": "try.log.gz", "NAME": "tried", "NEXT.npz": "next.npz"}  # what the reader puts in
EPISODE = "data/arena-d0.5-s0000"
ROOM = "--scene arena --seconds 1"
TRY = "--seeds 1 --seconds 1"
WITHOUT = ("own-log/index.html",)  # commands
KINDS = {  # a page: what makes it, after what
    "mine/index.html": [f"run my_slam:MySlam {ROOM} --no-film --out mine"],
    "two/index.html": [f"run odometry {ROOM} --also-at -0.2,0,180 --no-film --out two"],
    "log/index.html": ["run shunting --log try.log.gz --no-film --out log"],
    "own-log/index.html": ["run my_slam:MySlam --log try.log.gz --no-film --out own-log"],
    "data/index.html": [],
    "blame-run/index.html": [f"blame {EPISODE} --top 1 --repeats 0 --out blame-run"],
    "blame-scene/index.html": [f"blame {ROOM} --crowd none --top 1 --repeats 0 --out blame-scene"],
    "drive/index.html": [
        f"drive arena --slam odometry --dynamism 0 --goals 1 {TRY} --out drive",
    ],
    "lives/index.html": [
        "lifelong --scene arena --slam shunting --sessions 2 --seconds 1 --out lives"
    ],
    "study/report.html": [
        f"compare --slam my_slam:MySlam odometry --scene arena --dynamism 1 {TRY} --out study",
        "report study",
    ],
    "board/index.html": [
        f"benchmark --slam odometry --quick --tracks busy-chairs {TRY} --out board",
    ],
    "board/busy-chairs-v1/report.html": [],
}  # fmt: skip


@pytest.fixture(scope="module")
def here(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A folder to stand in, with a SLAM of the reader's, a dataset and a log."""
    folder = tmp_path_factory.mktemp("here")
    (folder / "my_slam.py").write_text(
        "from slam.odometry import OdometrySlam\n\nclass MySlam(OdometrySlam):\n    pass\n"
    )
    with pytest.MonkeyPatch.context() as patched:
        patched.chdir(folder)
        patched.setattr(sys, "path", [*sys.path, str(folder)])
        patched.setattr(Live, "serve", lambda *_: None)
        run(f"generate {ROOM.replace('--scene ', '')} --out data")
        run(f"export {EPISODE} --to carmen --out try.log.gz")
        yield folder
    sys.modules.pop("my_slam", None)


def run(line: str) -> str:
    done = CliRunner().invoke(app, shlex.split(line))
    assert done.exit_code == 0, f"mobilia {line}: {done.exception!r} {done.output}"
    return done.output


@pytest.mark.parametrize("page", KINDS)
def test_what_a_page_says_to_type_works(here: Path, page: str, monkeypatch: pytest.MonkeyPatch):
    for line in KINDS[page]:
        run(line)
    lines = of_page(here / page)
    assert bool(lines) == (page not in WITHOUT)
    with monkeypatch.context() as patched:
        read = read_by(patched)
        for line in lines:
            read(line)
    for line in {line.split()[1]: line for line in lines}.values():  # one of each verb
        verb, *words = shlex.split(line)[1:]
        folder = "again" if verb in ("compare", "benchmark") else str(Path(page).parent)
        words = [FOR.get(word, word.replace("FOLDER", folder)) for word in words]
        if verb == "report" and not Path(words[0]).exists():
            continue  # of the comparison that the command before it makes
        run(shlex.join([verb, *words, *shlex.split(QUICK[verb])]))

# SPDX-License-Identifier: Apache-2.0
"""Links, pipes and devices in the place of what a writer writes: nothing outside changes, and
nothing is waited for."""

import os
import shutil
import signal
import socket
import stat
import sys
from collections.abc import Callable, Iterator
from contextlib import chdir, contextmanager, suppress
from pathlib import Path

import numpy as np
import pytest

from scripts.cli import main
from scripts.comparison.make import carry_out
from scripts.comparison.plan import Plan
from scripts.jobs import Job, run_jobs
from scripts.output import READY, STAGED, locked_folder, result_folder, write_recipe
from scripts.report import page
from scripts.report.study import study
from scripts.whole_folder import whole_folder
from sim.recording.dataset import Plan as DatasetPlan
from sim.recording.dataset import writing
from sim.recording.episode import record
from sim.recording.recipe import Recipe
from slam import locks
from slam.errors import MobiliaError
from slam.files import write_text

pytestmark = pytest.mark.fuzz
MOST_S = 5  # that a call may take
PLANTED = 60  # a writer
KINDS = ("file", "folder", "missing", "pipe", "socket", "device", "loop", "null")
COMPARED = Plan(slams=("odometry",), scenes=("arena",), levels=(0.5,), seeds=(1,), seconds=0.5)
RECORDED = DatasetPlan(
    recipe=Recipe(scene="arena", seed=1, dynamism=0.5, seconds=0.1), dynamisms=(0.5,), episodes=1
)


# -- what is planted -------------------------------------------------------------------------------


def plant(kind: str, place: Path, outside: Path) -> None:
    """In place of whatever is there."""
    if place.is_dir() and not place.is_symlink():
        shutil.rmtree(place)
    place.unlink(missing_ok=True)
    place.parent.mkdir(parents=True, exist_ok=True)
    if kind == "pipe":
        os.mkfifo(place)
    elif kind == "socket":
        with socket.socket(socket.AF_UNIX) as made, chdir(place.parent):
            made.bind(place.name)  # a short name: the path of a socket has 107 bytes at most
    elif kind == "device":
        try:
            os.mknod(place, stat.S_IFCHR | 0o666, os.makedev(1, 3))
        except OSError:  # only a superuser may
            place.symlink_to("/dev/null")
    else:
        to = {"file": outside / "notes.txt", "folder": outside / "folder", "loop": place,
              "missing": outside / "new", "null": Path("/dev/null")}  # fmt: skip
        place.symlink_to(to[kind])


@pytest.fixture
def outside(tmp_path: Path) -> Path:
    """Somebody else's, and so is all that lies in it."""
    write_text(tmp_path / "outside" / "notes.txt", "mine")
    write_text(tmp_path / "outside" / "folder" / "a.csv", "mine, too")
    return tmp_path / "outside"


def state(folder: Path) -> dict[str, tuple[int, int, bytes]]:
    """Mode, time of the last change and bytes of all in a folder."""
    return {
        str(path): (there.st_mode, there.st_mtime_ns, path.read_bytes() if path.is_file() else b"")
        for path in (folder, *sorted(folder.rglob("*")))
        for there in [path.lstat()]
    }


@contextmanager
def in_time() -> Iterator[None]:
    def late(*_: object) -> None:
        raise AssertionError(f"waits for more than {MOST_S} s")

    before = signal.signal(signal.SIGALRM, late)
    signal.alarm(MOST_S)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


# -- writers ---------------------------------------------------------------------------------------


def job(path: Path, *, text: str) -> None:
    path.write_text(text)


def grown(out: Path) -> None:
    """As ``compare``, ``drive`` and ``benchmark`` write."""
    with result_folder(out, "compare", {"seed": 1}) as tables:
        for name in ("recordings", "entries", "lives"):
            jobs = [Job(name=k, call=job, arguments={"text": k}, suffix=".npz") for k in "ab"]
            run_jobs(jobs, out / name)
        with tables() as staged:
            for name in ("runs.csv", "runs/a.npz", "report.html"):
                write_text(staged / name, name)


def published(out: Path) -> None:
    """As ``report`` writes into what has grown."""
    with locked_folder(out, "compare"):
        write_text(out / "report.html", "a page")
        write_text(out / "replays" / "a.html", "a page")


def recorded(out: Path) -> None:
    """As ``generate`` writes."""
    with writing(out, RECORDED) as dataset:
        missing, _ = dataset.missing()
        for recipe in missing:
            record(recipe, out)
        dataset.finish()


def whole(out: Path) -> None:
    """As ``run``, ``demo``, ``lifelong`` and ``blame`` write."""
    with whole_folder(out / "run", overwrite=True) as part:
        write_text(part / "maps" / "map.npz", "a map")
        write_recipe(part, "run", {"seed": 1})


def alone(out: Path) -> None:
    """As ``export``, ``scene`` and ``render`` write."""
    for name in ("a.txt", "plan.toml"):
        write_text(out / name, "text")


Writer = Callable[[Path], None]
# and names that it writes for a while, here and, of this process, hidden
WRITERS: dict[str, tuple[Writer, tuple[str, ...]]] = {
    "grown": (grown, (STAGED, READY, f"{READY}/runs", f"{READY}/runs.csv", "entries/.lock")),
    "published": (published, ("replays", "replays/.a.{pid}.part.html", "replays/a.html")),
    "recorded": (recorded, (".x.1.part", ".arena-d0.5-s0001.host.{pid}.part", "train.txt")),
    "whole": (whole, (".run.{pid}.part", ".run.17.part", "run/notes")),
    "alone": (alone, (".a.{pid}.part.txt", ".a.17.part.txt", ".a.txt.17.part")),
}
HIDDEN = (locks.LOCK, locks.WORKERS, ".recipe.{pid}.part.json", ".SHA256SUMS.{pid}.part", ".x.part")


@pytest.mark.parametrize("name", list(WRITERS))
def test_nothing_outside_changes_and_nothing_waits(name: str, tmp_path: Path, outside: Path):
    writer, more = WRITERS[name]
    base = tmp_path / "base"
    base.mkdir()
    if name == "published":
        grown(base)
    writer(base)
    names = [path.relative_to(base).as_posix() for path in sorted(base.rglob("*"))]
    names += [one.format(pid=os.getpid()) for one in (*HIDDEN, *more)]
    before, told = state(outside), list[str]()
    rng = np.random.default_rng(sorted(WRITERS).index(name))
    for number in range(PLANTED):
        out = tmp_path / f"out{number}"
        shutil.copytree(base, out)
        for _ in range(int(rng.integers(1, 3))):
            place = out / names[int(rng.integers(len(names)))]
            kind = KINDS[int(rng.integers(len(KINDS)))]
            if place.parent.resolve().is_relative_to(out):  # not through what is planted
                with suppress(NotADirectoryError, FileExistsError):
                    plant(kind, place, outside)
        try:
            with in_time():
                writer(out)
        except MobiliaError as error:
            told.append(str(error))
        assert state(outside) == before, sorted(out.rglob("*"))
        shutil.rmtree(out)
    assert not any("\n" in words for words in told)
    if name in ("grown", "published", "recorded"):
        assert len(told) == PLANTED


def test_what_was_killed_with_a_link_beside_is_not_put_into_its_place(
    tmp_path: Path, outside: Path
):
    """``.tables.ready/runs/a.csv`` and ``runs -> outside``: the table would go there."""
    out, before = tmp_path / "out", state(outside)
    grown(out)
    shutil.rmtree(out / "runs")
    (out / "runs").symlink_to(outside / "folder")
    write_text(out / READY / "runs" / "a.csv", "theirs")
    with pytest.raises(MobiliaError, match=r"out/runs is a link, in a folder that is written"):
        grown(out)
    assert state(outside) == before


@pytest.mark.parametrize("name", ["grown", "published", "recorded"])
def test_a_second_name_of_a_file_elsewhere_is_not_written(name: str, tmp_path: Path, outside: Path):
    """What ``ln`` makes is a file like any other; of it, only a lock would be written in place."""
    writer, _ = WRITERS[name]
    base, before = tmp_path / "base", state(outside)
    grown(base) if name == "published" else base.mkdir()
    writer(base)
    for planted in (*locks.NAMES, *(one.format(pid=os.getpid()) for one in HIDDEN), "SHA256SUMS"):
        out = tmp_path / "out"
        shutil.copytree(base, out)
        (out / planted).unlink(missing_ok=True)
        os.link(outside / "notes.txt", out / planted)
        told = ""
        try:
            writer(out)
        except MobiliaError as error:
            told = str(error)
        assert (f"{planted} is another name of a file elsewhere" in told) == (
            planted in locks.NAMES
        )
        shutil.rmtree(out)
    assert state(outside) == before


def test_a_link_that_is_typed_is_followed(tmp_path: Path):
    (tmp_path / "real").mkdir()
    (tmp_path / "out").symlink_to("real")
    grown(tmp_path / "out")
    assert (tmp_path / "out").is_symlink()
    assert (tmp_path / "real" / "runs.csv").read_text() == "runs.csv"


# -- whole verbs -----------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def compared(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("compared") / "out"
    carry_out(COMPARED, folder)
    page.write(study(folder))
    return folder


COMPARE = "compare --slam odometry --scene arena --dynamism 0.5 --seeds 1 --seconds 0.5 --out out"
GENERATE = "generate arena --seed 1 --seconds 0.1 --out out"


@pytest.mark.parametrize(
    ("words", "name", "kind"),
    [
        (COMPARE, "recordings", "folder"), (COMPARE, ".lock.workers", "file"),
        ("report out", "report.html", "file"), ("report out --replays", "replays", "folder"),
        (GENERATE, ".lock", "pipe"), (GENERATE, "dataset.json", "missing"),
        ("drive arena --slam odometry --seeds 1 --out out", "runs", "folder"),
        ("benchmark --quick --slam odometry --tracks tour-guide --out out", "tour-guide", "folder"),
        ("lifelong --scene arena --sessions 2 --out out", ".lock", "pipe"),
        ("run odometry --scene arena --out out", ".lock", "socket"),
        ("reproduce theory --out out", "theory", "folder"),
        ("sensor-card --out out", "pictures", "folder"),
    ],
)  # fmt: skip
def test_verbs(words: str, name: str, kind: str, compared: Path, tmp_path: Path, outside: Path,
               monkeypatch, capsys):  # fmt: skip
    out, verb = tmp_path / "out", words.split()[0]
    if verb in ("compare", "report"):
        shutil.copytree(compared, out)
    elif verb in ("drive", "benchmark"):
        write_recipe(out, verb, {})
    plant(kind, out / name, outside)
    before = state(outside)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", ["mobilia", *words.split()])
    with in_time(), pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 1
    told = capsys.readouterr().err
    assert told.count("\n") == 1
    assert f"out/{name} is" in told or "choose another --out" in told
    assert state(outside) == before

# SPDX-License-Identifier: Apache-2.0
"""A full disk is one line that names what the user named; nothing half-written is left."""

import os
import shutil
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from scripts.comparison import make
from scripts.comparison.plan import Plan
from scripts.console import console
from scripts.film.encode import film
from scripts.output import write_recipe
from scripts.whole_folder import whole_folder
from sim.recording.sums import write_sums
from slam.errors import OutputError
from slam.files import write_bytes
from tests.processes import python

pytestmark = pytest.mark.fuzz
FULL = "No space left on device"
Disk = Callable[[int], Path]


def tree(folder: Path) -> dict[str, bytes | None]:
    """All that lies in a folder; None of a folder."""
    return {
        path.relative_to(folder).as_posix(): None if path.is_dir() else path.read_bytes()
        for path in sorted(folder.rglob("*"))
    }


@pytest.fixture
def disk(tmp_path: Path) -> Iterator[Disk]:
    """Makes a disk of some kB; where that is not allowed, the test is skipped."""
    place = tmp_path / "disk"

    def of(kilobytes: int) -> Path:
        place.mkdir()
        words = ["mount", "-t", "tmpfs", "-o", f"size={kilobytes}k", "tmpfs", str(place)]
        if shutil.which("mount") is None or subprocess.run(words, capture_output=True).returncode:
            pytest.skip("no small file system can be mounted here")
        return place

    yield of
    if os.path.ismount(place):
        subprocess.run(["umount", "--lazy", str(place)], check=True)  # a worker may still end


@pytest.fixture(autouse=True)
def quiet() -> Iterator[None]:
    console.quiet = True
    yield
    console.quiet = False


def filmed(path: Path, pictures: int) -> None:
    rng = np.random.default_rng(0)
    with film(path, 30.0) as reel:
        for _ in range(pictures):
            reel.add(rng.integers(0, 256, (180, 320, 3), dtype=np.uint8))


def run_folder(path: Path) -> None:
    with whole_folder(path, overwrite=True) as folder:
        filmed(folder / "film.mp4", 60)
        write_recipe(folder, "test", {})


def test_a_film(disk: Disk):
    place = disk(100)
    with pytest.raises(OutputError) as caught:
        filmed(place / "film.mp4", 60)
    assert str(caught.value) == f"cannot write {place / 'film.mp4'}: {FULL} (ffmpeg stopped)"
    assert tree(place) == {}
    write_recipe(place / "run", "test", {})
    write_sums(place / "run")
    before = tree(place)
    with pytest.raises(OutputError) as caught:
        run_folder(place / "run")
    said = f"cannot write {place / 'run' / 'film.mp4'}: {FULL} (ffmpeg stopped)"
    assert str(caught.value) == said
    assert tree(place) == before


@pytest.mark.parametrize("pictures", [1, 60])
def test_ffmpeg_that_ends_badly_leaves_no_film(tmp_path: Path, monkeypatch, pictures: int):
    """Though it took all pictures: what counts is how it ended."""
    bad = tmp_path / "ffmpeg"
    bad.write_text("#!/bin/sh\ncat > /dev/null\nexit 3\n")
    bad.chmod(0o755)
    monkeypatch.setattr("scripts.film.encode.imageio_ffmpeg.get_ffmpeg_exe", lambda: str(bad))
    with pytest.raises(OutputError, match=r"film.mp4: exit status 3 \(ffmpeg stopped\)"):
        filmed(tmp_path / "film.mp4", pictures)
    with pytest.raises(OutputError, match="a film needs a picture"):
        filmed(tmp_path / "film.mp4", 0)
    assert not (tmp_path / "film.mp4").exists()


def test_tables_of_a_comparison(disk: Disk, tmp_path: Path):
    """Room for another SLAM's runs and not for the tables: the earlier ones stay, all of them."""
    ways = {"scenes": ("arena",), "levels": (1.0,), "seeds": (100,), "seconds": 1.0}
    one, two = (Plan(slams=slams, **ways) for slams in (("odometry",), ("odometry", "occupancy")))
    make.carry_out(one, tmp_path / "compared")
    place = disk(400)
    out = place / "compared"
    shutil.copytree(tmp_path / "compared", out)
    before = tree(out)
    room = os.statvfs(place).f_bavail * os.statvfs(place).f_bsize
    write_bytes(place / "rest", b"0" * (room - (32 << 10)))
    with pytest.raises(OutputError, match=f"cannot write {out}/.*: {FULL}"):
        make.carry_out(two, out)
    after = tree(out)
    assert {name: data for name, data in after.items() if name in before} == before
    new = set(after) - set(before)
    assert all(name.startswith("entries/") and "_occupancy-" in name for name in new)
    assert len(new) == 2  # the entry and its hash
    (place / "rest").unlink()
    assert len(make.carry_out(two, out)) == 2


def test_two_processes(disk: Disk):
    place = disk(100)
    words = ("generate", "arena", "--episodes", "2", "--seconds", "8")
    words = ("-m", "scripts", *words, "--jobs", "2", "--out", "out")
    done = python(*words, cwd=place, check=False)
    assert done.returncode == 1
    assert done.stderr.count("\n") == 1
    assert f"{place}/out/arena-" in done.stderr
    assert done.stderr.endswith(f": {FULL}\n")
    assert not [name for name in tree(place) if "/." in name]

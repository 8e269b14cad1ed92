# SPDX-License-Identifier: Apache-2.0
"""Small results of the verbs, who reads them, and random damage to them."""

import shutil
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from scripts import results
from scripts.closed_loop import make as drives
from scripts.closed_loop.plan import DrivePlan
from scripts.comparison import make as comparisons
from scripts.comparison.folder import read
from scripts.comparison.plan import Plan
from scripts.comparison.run_file import RunFile
from scripts.debugger.recording import case_of
from scripts.film.footage import of_log
from scripts.report import page
from scripts.report.study import study
from scripts.spec import command
from scripts.verbs.generate import Generate
from sim.loop import LoopConfig
from slam.errors import MobiliaError
from slam.maps import write_map
from slam.shunting import ShuntingSlam
from slam.shunting.slam import ShuntingConfig
from slam.system import Raster
from slam.tracker import map_file

COMPARED = Plan(
    slams=("odometry", "shunting"), scenes=("arena",), levels=(0.0, 1.0), seeds=(0,),
    seconds=1.5, every=8, scanner="ideal",
)  # fmt: skip
DRIVEN = DrivePlan(
    scene="arena", slams=("odometry",), levels=(0.5,), seeds=(0,), goals=1,
    loop=LoopConfig(limit_s=2.0),
)  # fmt: skip

generate = command(Generate)
MEASURED = ("ms_per_scan_p50", "ms_per_scan_p99", "ms_per_scan_p999", "peak_memory_mb")
KINDS = ("flip", "cut", "remove", "add")
ADDED = ("notes.txt", ".hidden", ".lock", ".x.1.part", "recipe.json.bak", "SHA256SUMS.old")
# Of a sample that is no folder: what ``verify`` is asked about, and what alone is damaged.
ALONE = {"map": "map.npz", "raster": "map.yaml"}


# -- results, and what their readers make of them --------------------------------------------------


def _dataset(folder: Path) -> None:
    generate(["arena"], folder, episodes=2, seconds=1.0, scanner="ideal")


def _comparison(folder: Path) -> None:
    comparisons.carry_out(COMPARED, folder)
    page.write(study(folder))


def _map(folder: Path) -> None:
    generate(["arena"], folder.with_name("driven"), episodes=1, seconds=1.0, scanner="ideal")
    stream = of_log(next(folder.with_name("driven").glob("arena-*"))).stream
    slam = ShuntingSlam()
    for frame, _ in zip(stream, range(20), strict=False):
        slam.update(frame.without_truth())
    slam.save(folder / "map.npz")


def _raster(folder: Path) -> None:
    values = np.random.default_rng(0).random((30, 40), dtype=np.float32)
    write_map(folder / "map", Raster(values=values, resolution_m=0.05, T_map_origin=np.zeros(3)))


SAMPLES: dict[str, Callable[[Path], object]] = {
    "dataset": _dataset, "comparison": _comparison, "map": _map, "raster": _raster,
    "drive": lambda folder: drives.carry_out(DRIVEN, folder),
}  # fmt: skip


def made(name: str, folder: Path) -> Path:
    """The folder, with that sample in it."""
    SAMPLES[name](folder)
    return folder


def _loaded(folder: Path) -> Any:
    config, state, arrays = map_file.read(folder / "map.npz", ShuntingConfig)
    return config, state.T_map_robot.tolist(), {k: v.tolist() for k, v in arrays.items()}


def _resumed(folder: Path) -> Any:
    """``compare`` again: all rows, but for what is measured, and all runs."""
    rows = comparisons.carry_out(COMPARED, folder)
    again = [{k: v for k, v in row.items() if k not in MEASURED} for row in rows]
    return repr(again), [len(read(folder).runs), len(read(folder).paired)]


def _runs(folder: Path) -> Any:
    """What ``blame`` and ``render`` take of a comparison's runs."""
    out = []
    for path in (folder / "runs" / f"{run.name}.npz" for run in COMPARED.runs()):
        file, case = RunFile(path), case_of(path, None, 1)
        poses = [file.believed(slam).poses.tolist() for slam in file.slams]
        out.append((file.truth.tolist(), file.ranges.tobytes(), poses, repr(case)))
    return out


def _driven(folder: Path) -> Any:
    drives.carry_out(DRIVEN, folder)
    return (folder / drives.LEVELS).read_text()


READERS: dict[str, tuple[Callable[[Path], Any], ...]] = {
    "comparison": (lambda folder: page.render(study(folder)), _resumed, _runs),
    "drive": (_driven,),
    "map": (_loaded,),
}


# -- damage ----------------------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class Damage:
    """What is done to a folder: ``kind`` to the file ``name``, at the byte ``at``."""

    kind: str
    name: str
    at: int = 0
    bit: int = 0

    def apply(self, folder: Path) -> None:
        path = folder / self.name
        if self.kind == "remove":
            path.unlink()
        elif self.kind == "add":
            path.write_bytes(b"something else\n")
        else:
            data = bytearray(path.read_bytes())
            if self.kind == "flip":
                data[self.at] ^= 1 << self.bit
            else:
                del data[self.at]
            path.write_bytes(bytes(data))


def damages(folder: Path, count: int, seed: int, kinds: Sequence[str] = KINDS) -> Iterator[Damage]:
    """``count`` of them: all files in turn, each in all of these ways."""
    rng = np.random.default_rng(seed)
    files = sorted(p.relative_to(folder) for p in folder.rglob("*") if p.is_file())
    rng.shuffle(files)
    for k in range(count):
        file, kind = files[(k // len(kinds)) % len(files)], kinds[k % len(kinds)]
        if kind == "add":
            file = file.parent / ADDED[int(rng.integers(len(ADDED)))]
            yield Damage(kind=kind, name=file.as_posix())
            continue
        if kind != "remove" and not (folder / file).stat().st_size:
            file = max(files, key=lambda f: (folder / f).stat().st_size)
        at = int(rng.integers(max((folder / file).stat().st_size, 1)))
        yield Damage(kind=kind, name=file.as_posix(), at=at, bit=int(rng.integers(8)))


@contextmanager
def damaged(folder: Path, whole: Path, damage: Damage) -> Iterator[Path]:
    """The folder with that damage; afterwards the one file is that of ``whole`` again."""
    damage.apply(folder)
    try:
        yield folder
    finally:
        if (whole / damage.name).exists():
            shutil.copy2(whole / damage.name, folder / damage.name)
        else:
            (folder / damage.name).unlink(missing_ok=True)


@contextmanager
def copy_of(folder: Path) -> Iterator[Path]:
    with tempfile.TemporaryDirectory(prefix="mobilia-damage-") as scratch:
        yield Path(shutil.copytree(folder, Path(scratch) / folder.name))


def answer(reader: Callable[[Path], Any], folder: Path, wanted: Any) -> str:
    """``noticed``, ``the same`` as of the whole one, ``wrong`` or the foreign error."""
    try:
        return "the same" if reader(folder) == wanted else "wrong"
    except MobiliaError:
        return "noticed"
    except Exception as error:  # noqa: BLE001  (that is what is looked for)
        return f"{type(error).__name__}: {error}"


def missed_by_verify(name: str, folder: Path, count: int, seed: int) -> list[str]:
    """The damages of ``count`` that ``verify`` does not see.

    A lone map may also be read as the very same one: its format has bytes that say nothing.
    """
    missed = []
    with copy_of(folder) as copy:
        asked = copy / ALONE.get(name, "")
        assert all(found.ok for found in results.check(asked))
        reader = READERS[name][0] if name in ALONE and name in READERS else None
        wanted = reader(copy) if reader else None
        for damage in damages(folder, count, seed, KINDS[:3] if name in ALONE else KINDS):
            with damaged(copy, folder, damage):
                said = answer(lambda path: all(f.ok for f in results.check(path)), asked, False)
                if said == "wrong" and reader:
                    said = answer(reader, copy, wanted)
                elif said == "the same":
                    said = "noticed"
            if said not in ("noticed", "the same"):
                missed.append(f"{damage}: {said}")
    return missed


def misread(name: str, folder: Path, count: int, seed: int) -> list[str]:
    """The damages, ``count`` a reader, with which it says something else or fails; it may mend."""
    wrong = []
    for number, reader in enumerate(READERS.get(name, ())):
        with copy_of(folder) as copy:
            wanted = reader(copy)
        for damage in damages(folder, count, seed, KINDS[:3] if name in ALONE else KINDS):
            with copy_of(folder) as copy:
                damage.apply(copy)
                said = answer(reader, copy, wanted)
            if said not in ("noticed", "the same"):
                wrong.append(f"reader {number}, {damage}: {said}")
    return wrong

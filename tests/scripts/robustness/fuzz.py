# SPDX-License-Identifier: Apache-2.0
"""Every reader on damaged and hostile variants of the seeds in ``corpus``.

python -m tests.scripts.robustness.fuzz --inputs 20000 --keep out/fuzz

Each input is read in a process of its own. It must be read, or be refused by a ``MobiliaError`` of
one line. Counted and kept is what ends in another error, in a signal, or beyond time and memory.
"""

import os

os.environ |= {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}  # no threads to be forked

import argparse
import resource
import shutil
import signal
import sys
import tempfile
import traceback
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any
from unittest.mock import ANY

import mujoco
import numpy as np

import scenes
from scenes.from_map import plan
from scripts.benchmark import runs_file, submission
from scripts.comparison.run_file import RunFile
from scripts.comparison.schema import TABLES
from scripts.comparison.tables import read_csv
from scripts.output import read_recipe_words
from scripts.scene.check import problems
from scripts.scene.make import of_file
from scripts.tuning.space import read as read_space
from sim.core import state
from sim.recording.dataset import read_plan
from sim.recording.recipe import read_recipe
from sim.sensors.lidar.caster import FanPlan, Raycaster
from sim.world.robots import read_robot
from sim.world.script import of_file as said_by
from sim.world.script import read_events
from slam.errors import MobiliaError
from slam.logs import open_log
from slam.shunting import ShuntingSlam
from slam.trajectory import read_tum
from tests.scripts.robustness.mutants import mutant

runs_file._sha256 = lambda _: ANY  # damage is to be noticed without it
CORPUS = Path(__file__).with_name("corpus")
LIMIT_S, LIMIT_BYTES = 10, 1 << 30  # of one input, beyond what Python holds
ANGLES = np.linspace(-3.0, 3.0, 90)


def scene(path: Path) -> None:
    """Build it, check it, and cast a scan, whose ranges are distances."""
    said_by(str(path))
    built = scenes.build(str(path), 1)
    model = built.compile()
    data = mujoco.MjData(model)
    built.place(model, data)
    mujoco.mj_forward(model, data)
    caster = Raycaster(model, height=built.scan_height_m)
    caster.start(data)
    caster.note()
    caster.lasers[:] = built.start
    n = ANGLES.size
    caster.cast(FanPlan.of([(np.arange(n), ANGLES, np.zeros(n), np.linspace(0.0, 1.0, n))]))
    assert (caster.hits[0] >= 0.0).all(), "a range is no distance"
    list(problems(built))


def log(folder: Path) -> None:
    """All frames, whose stamps rise."""
    (file,) = (f for f in folder.iterdir() if f.name.startswith("a.") and f.suffix != ".toml")
    text = folder / "a.toml"
    stamps = [f.stamp_ns for f in open_log(file, text_format=text if text.exists() else None)]
    assert all(a < b for a, b in pairwise(stamps)), "a stamp does not rise"


LOGS = (
    "carmen", "gz", "xz", "packed", "mcap", "ros1", "rawlog", "ticks", "poses", "robotlaser",
    "rawlaser", "reading", "parameters", "centimetre",
)  # fmt: skip
READERS: dict[str, Callable[[Path], Any]] = {
    "plan": lambda at: scene(at / "shed.xml"),
    "lab": lambda at: scene(at / "lab.toml"),
    "named": lambda at: scene(at / "lab.toml"),
    "events": lambda at: read_events(at / "events.toml"),
    "robot": lambda at: read_robot(str(at / "robot.toml")),
    "space": lambda at: read_space(at / "space.toml", "shunting"),
    **dict.fromkeys(
        ("map", "png", "bmp", "tif"),
        lambda at: plan(of_file(at / "map.yaml"), source="map.yaml"),
    ),
    **dict.fromkeys(LOGS, log),
    "sqlite": lambda at: list(open_log(at)),
    "recipe": lambda at: read_recipe(at / "recipe.json"),
    "compared": lambda at: read_recipe_words(at / "recipe.json"),
    "tables": lambda at: [read_csv(f, TABLES[f.name]) for f in sorted(at.iterdir())],
    "run": lambda at: [RunFile(at / "run.npz").believed(s) for s in RunFile(at / "run.npz").slams],
    "state": lambda at: state.unpack((at / "a.state").read_bytes()),
    "saved": lambda at: ShuntingSlam.load(at / "map.npz"),
    "submission": lambda at: submission.read(at / "mine.json"),
    "dataset": lambda at: read_plan(at),
    "tum": lambda at: read_tum(at / "a.tum"),
}


@dataclass
class Found:
    """What became of the inputs: their number by outcome, and what is wrong, a line each."""

    counts: Counter[str]
    wrong: list[str]

    def told(self) -> str:
        """The summary."""
        n, c = self.counts.total(), self.counts
        return (
            f"{n} inputs: {c['read']} read, {c['refused']} refused; "
            f"{c['raw']} raw errors, {c['crash']} crashes, {c['slow']} over {LIMIT_S} s"
        )


def fuzz(inputs: int, seed: int, keep: Path | None = None, kinds: Sequence[str] = ()) -> Found:
    """Read so many variants, of the kinds in turn; what is wrong is kept in a folder."""
    found, kinds = Found(Counter(), []), kinds or tuple(READERS)
    with tempfile.TemporaryDirectory(prefix="mobilia-fuzz-") as scratch:
        for kind in dict.fromkeys(
            kinds
        ):  # kernels are compiled, and modules imported, before the first fork
            READERS[kind](Path(shutil.copytree(CORPUS / kind, Path(scratch) / kind)))
        for k in range(inputs):
            kind, rng = kinds[k % len(kinds)], np.random.default_rng([seed, k])
            folder = Path(scratch) / kind
            names = sorted(path.name for path in (CORPUS / kind).iterdir())
            name = names[int(rng.integers(len(names)))]
            (folder / name).write_bytes(mutant(name, (CORPUS / kind / name).read_bytes(), rng))
            outcome, said = outcome_of(kind, folder)
            found.counts[outcome] += 1
            if outcome in ("raw", "crash", "slow"):
                found.wrong.append(f"{kind} {seed}-{k} {name}: {outcome}: {said}")
                if keep:
                    shutil.copytree(folder, keep / f"{kind}-{seed}-{k}", dirs_exist_ok=True)
            shutil.rmtree(folder)
            shutil.copytree(CORPUS / kind, folder)
    return found


def outcome_of(kind: str, folder: Path) -> tuple[str, str]:
    """ "read", "refused", "raw", "crash" or "slow" of one reader in a process of its own."""
    output, child = os.pipe(), os.fork()
    if child == 0:
        os._exit(_child(kind, folder, output[1]))
    os.close(output[1])
    with os.fdopen(output[0]) as said:
        words = said.read()
    status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    if status < 0:
        return "slow" if -status == signal.SIGALRM else "crash", signal.Signals(-status).name
    return ("read", "refused", "raw")[status], words


def _child(kind: str, folder: Path, output: int) -> int:
    signal.signal(signal.SIGALRM, signal.SIG_DFL)
    signal.alarm(LIMIT_S)
    held = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (held + LIMIT_BYTES,) * 2)
    os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
    try:
        READERS[kind](folder)
        return 0
    except MobiliaError as error:
        names = (folder.name, *(path.stem for path in folder.iterdir()))
        told = kind == "state" or any(name in str(error) for name in names)  # bytes have no name
        if told and len(str(error).splitlines()) == 1:
            return 1
        os.write(output, f"not one line that names a file: {error!r:.300}".encode())
    except BaseException as error:  # noqa: BLE001  (that is what is looked for)
        last = traceback.extract_tb(error.__traceback__)[-1]
        words = f"{type(error).__name__}: {error!s:.200} ({last.filename}:{last.lineno})"
        os.write(output, words.encode("utf-8", "replace"))
    return 2


def main() -> int:
    """The command."""
    ask = argparse.ArgumentParser(description=__doc__)
    ask.add_argument("--inputs", type=int, default=20_000)
    ask.add_argument("--seed", type=int, default=0)
    ask.add_argument("--kinds", nargs="*", default=(), choices=READERS)
    ask.add_argument("--keep", type=Path)
    wanted = ask.parse_args()
    found = fuzz(wanted.inputs, wanted.seed, wanted.keep, wanted.kinds)
    print(*found.wrong, found.told(), sep="\n")
    return 1 if found.wrong else 0


if __name__ == "__main__":
    sys.exit(main())

# SPDX-License-Identifier: Apache-2.0
"""What README and docs say that things cost: ``python -m scripts.quotes.costs``.

Processor time of commands, each in a fresh process with everything that it starts, after a call
that warms the caches of compiled code: the least of a few, since other work on a machine can only
add. Writes ``docs/results/costs.json``.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from resource import RUSAGE_CHILDREN, RUSAGE_SELF, getrusage
from typing import Any

from scripts.experiments.measured import ended
from scripts.machine import machine, versions
from scripts.result_files import RESULTS, SCHEMA, commit, write

REPEATS = 3
SCENE, SEED, DYNAMISM = "office", 100, 0.5
SHORT_S, LONG_S = 5.0, 15.0


def called(words: Sequence[str]) -> tuple[float, float]:
    """s of processor time of ``mobilia WORDS``: of its own process, and of those it started."""
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        return pool.submit(_call, list(words)).result()


def _call(words: list[str]) -> tuple[float, float]:
    from sim.view import gl

    gl.sanitise_environment()
    from scripts.cli import app

    before = _spent()
    app(words, standalone_mode=False)
    after = _spent()
    return after[0] - before[0], after[1] - before[1]


def _spent() -> tuple[float, float]:
    own, others = getrusage(RUSAGE_SELF), getrusage(RUSAGE_CHILDREN)
    return own.ru_utime + own.ru_stime, others.ru_utime + others.ru_stime


Costs = dict[str, dict[str, Any]]


def _row(s: float, of: str, seeds: list[int], repeats: int) -> dict[str, Any]:
    return {"s": s, "of": of, "seeds": seeds, "repeats": repeats}


def film(folder: Path, repeats: int) -> Costs:
    """Of a second of film, with simulation and SLAM: a long film less a short one."""
    run = folder / "run"
    called([
        "run", "shunting", "--scene", SCENE, "--dynamism", str(DYNAMISM), "--seed", str(SEED),
        "--seconds", str(LONG_S + 1.0), "--no-film", "--out", str(run),
    ])  # fmt: skip
    rows, told = {}, f"a second of film: {LONG_S:g} s less {SHORT_S:g} s"
    for name, how in (("with 3D", []), ("without 3D", ["--no-3d"])):
        words = ["render", str(run), "--out", str(folder / "film.mp4"), *how, "--to"]
        called([*words, str(SHORT_S)])
        short = [called([*words, str(SHORT_S)]) for _ in range(repeats)]
        long = [called([*words, str(LONG_S)]) for _ in range(repeats)]
        for k, of in enumerate(("film", "encoder")):
            s = (min(t[k] for t in long) - min(t[k] for t in short)) / (LONG_S - SHORT_S)
            rows[f"{of}, {name}"] = _row(s, told, [SEED], repeats)
    return rows


def demo(folder: Path, repeats: int) -> Costs:
    """Of ``mobilia demo``, compiled code kept from before."""
    words = ["demo", "--overwrite", "--out", str(folder / "demo")]
    spent = min(sum(called(words)) for _ in range(repeats))
    return {"demo": _row(spent, "mobilia demo", [0], repeats)}


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure and write."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repeats", type=int, default=REPEATS)
    parser.add_argument("--out", type=Path, default=RESULTS / "costs.json")
    wanted = parser.parse_args(arguments)
    head = {
        "schema": SCHEMA,
        "command": "python -m scripts.quotes.costs",
        "commit": commit(),
        "machine": machine(),
        "versions": versions(),
        "what": "s of processor time, the least of the repeats",
    }
    rows: Costs = {}
    with tempfile.TemporaryDirectory() as folder:
        for measure in (film, demo):
            rows |= measure(Path(folder), wanted.repeats)
    write(wanted.out, head, {"costs": rows})
    for name, row in rows.items():
        print(f"{name}: {row['s']:.3f} s of processor time, {row['of']}")
    return 0


if __name__ == "__main__":
    sys.exit(ended(main))

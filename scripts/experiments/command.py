# SPDX-License-Identifier: Apache-2.0
"""Options that commands which measure have in common, and the head of their results file."""

import argparse
import math
import shlex
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from scripts.machine import machine, versions
from scripts.marks import filled
from scripts.result_files import RESULTS, SCHEMA, commit
from sim.core.versions import WORLD


def add_run_options(parser: argparse.ArgumentParser, out: str, page: Path) -> None:
    """``--first-seed``, ``--seconds``, ``--jobs``, ``--results``, ``--page``."""
    parser.add_argument("--first-seed", type=int, default=500, help="nobody tuned on these")
    parser.add_argument("--seconds", type=float, default=60.0, help="of each run, simulated")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument("--results", type=Path, default=RESULTS / out)
    parser.add_argument("--page", type=Path, default=page)
    parser.add_argument("--no-page", action="store_true", help="leave the page as it is")


def seeds_of(wanted: argparse.Namespace) -> list[int]:
    """Of the two options."""
    return list(range(wanted.first_seed, wanted.first_seed + wanted.seeds))


def head(
    wanted: argparse.Namespace,
    mark: str,
    arguments: Sequence[str] | None,
    *asked: str,
    package: str = "scripts.experiments",
) -> dict[str, Any]:
    """The head of the results file, with the options ``asked``; call it before anything is run.

    ``mark`` names the module of ``package``, and its place in the page. Of absolute paths the
    command keeps the last part: where a machine keeps them helps nobody.

    Raises ``InvalidValueError`` where the page has no such mark, or where the project's own results
    would name a commit that is not the code here; ``OSError`` for no such page.
    """
    if not wanted.no_page:
        filled(wanted.page.read_text(encoding="utf-8"), mark, "", wanted.page)
    own = wanted.results.resolve().parent == RESULTS
    given = sys.argv[1:] if arguments is None else arguments
    words = [Path(word).name if Path(word).is_absolute() else word for word in given]
    return {
        "schema": SCHEMA,
        "command": shlex.join(["python", "-m", f"{package}.{mark}", *words]),
        "commit": commit() if own else None,
        "world": WORLD,
        "machine": machine(),
        "versions": versions(),
        "seeds": seeds_of(wanted),
        "seconds": wanted.seconds,
        **{key: getattr(wanted, key) for key in asked},
    }


def geometric(values: Sequence[float]) -> float:
    """Mean."""
    return math.exp(float(np.log(values).mean()))

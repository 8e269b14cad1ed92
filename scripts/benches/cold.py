# SPDX-License-Identifier: Apache-2.0
"""What compiling costs a first run: ``python -m scripts.benches.cold [VERB ...]``.

The run (of odometry in the arena, unless a verb of ``mobilia`` and its options are given) starts
without compiled code, then again with what that left.
"""

import os
import resource
import subprocess
import sys
import tempfile
from pathlib import Path

from scripts.console import say

RUN = ("run", "odometry", "--scene", "arena", "--seconds", "5", "--no-film")


def cost_s(verb: list[str], folder: Path) -> float:
    """Processor time of a run that keeps compiled code in ``folder``, s."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(
        [sys.executable, "-m", "mobilia", *verb, "--out", str(folder / "out"), "--overwrite"],
        env={**os.environ, "NUMBA_CACHE_DIR": str(folder)},
        stdout=subprocess.DEVNULL,
        check=True,
    )
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def main(verb: list[str]) -> None:
    """Print both, and how many entries from Python were compiled."""
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made)
        first = cost_s(verb, folder)
        entries = len(list(folder.rglob("*.nbc")))
        again = cost_s(verb, folder)
    say(f"first {first:.1f} s of processor time, again {again:.1f}; {entries} entries compiled")


if __name__ == "__main__":
    main(sys.argv[1:] or list(RUN))

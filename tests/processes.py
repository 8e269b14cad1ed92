# SPDX-License-Identifier: Apache-2.0
"""A Python of ours run to its end; which processes a test has started, wherever these went."""

import os
import subprocess
import sys
from contextlib import suppress
from pathlib import Path
from typing import Any

REPO = Path(__file__).resolve().parents[1]


def python(
    *words: object, check: bool = True, cwd: Path = REPO, **environment: str
) -> subprocess.CompletedProcess[Any]:
    """``python WORDS`` with our environment and more of it; what it says is captured."""
    done = subprocess.run(
        [sys.executable, *map(str, words)], cwd=cwd, capture_output=True, text=True, check=False,
        timeout=240, env={**os.environ, "PYTHONPATH": str(REPO), "COLUMNS": "200", **environment},
    )  # fmt: skip
    assert done.returncode == 0 or not check, done.stderr
    return done


def processes_with(name: str, mark: str) -> list[int]:
    """Processes with ``name=mark`` in their environment that are not over."""
    found = []
    for process in Path("/proc").glob("[0-9]*"):
        with suppress(OSError):
            if f"{name}={mark}".encode() in (process / "environ").read_bytes().split(b"\0"):
                found.append(int(process.name))
    return found

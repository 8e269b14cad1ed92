# SPDX-License-Identifier: Apache-2.0
"""A Python of ours run to its end; which processes a test has started, wherever these went."""

import os
import re
import subprocess
import sys
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from types import SimpleNamespace
from typing import Any

REPO = Path(__file__).resolve().parents[1]
_EACH = """
import sys
from scripts.__main__ import main
for line in sys.argv[1:]:
    sys.argv, status = ["mobilia", *line.split()], 0
    try:
        main()
    except SystemExit as ended:
        status = ended.code or 0
    loaded = sorted({name.partition(".")[0] for name in sys.modules})
    for stream in (sys.stdout, sys.stderr):
        print("= ended", status, *loaded, file=stream, flush=True)
"""


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


def mobilia_each(lines: Sequence[str], cwd: Path, **environment: str) -> dict[str, SimpleNamespace]:
    """``mobilia LINE`` for each of them in one process: what came of it, and what was loaded."""
    done = python("-c", _EACH, *lines, cwd=cwd, **environment)
    out, err = (
        re.split("^= ended (.*)\n", of, flags=re.MULTILINE) for of in (done.stdout, done.stderr)
    )
    assert len(out) == len(err) == 2 * len(lines) + 1, done.stderr
    found = {}
    for k, line in enumerate(lines):
        status, *loaded = out[2 * k + 1].split()
        found[line] = SimpleNamespace(
            returncode=int(status), stdout=out[2 * k], stderr=err[2 * k], loaded=loaded
        )
    return found


def processes_with(name: str, mark: str) -> list[int]:
    """Processes with ``name=mark`` in their environment that are not over."""
    found = []
    for process in Path("/proc").glob("[0-9]*"):
        with suppress(OSError):
            if f"{name}={mark}".encode() in (process / "environ").read_bytes().split(b"\0"):
                found.append(int(process.name))
    return found

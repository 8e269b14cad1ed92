# SPDX-License-Identifier: Apache-2.0
"""The compile cache must notice a change in a kernel that another module calls."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

CALLEE = """
from slam._jit import njit
@njit
def inner(x):
    return x + {}
"""
CALLER = """
from slam._jit import njit
from callee import inner
@njit
def outer(x):
    return inner(x)
print(outer(1.0))
"""


def run(folder: Path, step: float) -> float:
    (folder / "callee.py").write_text(CALLEE.format(step))
    here = Path(__file__).parents[2]
    env = {**os.environ, "PYTHONPATH": f"{here}{os.pathsep}{folder}"}
    env["NUMBA_CACHE_DIR"] = str(folder / "cache")
    env["PYTHONDONTWRITEBYTECODE"] = "1"
    done = subprocess.run(
        [sys.executable, str(folder / "caller.py")],
        capture_output=True,
        text=True,
        check=True,
        env=env,
    )
    return float(done.stdout)


def test_a_changed_callee_of_another_module_is_compiled_anew(tmp_path):
    (tmp_path / "caller.py").write_text(CALLER)
    assert run(tmp_path, 1.0) == 2.0
    assert run(tmp_path, 2.0) == 3.0

# SPDX-License-Identifier: Apache-2.0
"""The compile cache notices a change in a kernel of another module; compiling is said once."""

import gc
import logging
import os
import pickle
import subprocess
import sys
from pathlib import Path

import numba
import numpy as np
import pytest
from numba.core import event

from slam._jit import COMPILING, announced, inner, uncounted

CALLEE = """
from slam._jit import {} as jit
@jit
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


def run(folder: Path, decorator: str, step: float, callee: str = CALLEE) -> float:
    (folder / "callee.py").write_text(callee.format(decorator, step))
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


def test_a_kernel_that_counts_no_references_may_neither_allocate_nor_return_an_array():
    for kernel in (lambda table: np.zeros(2)[0], lambda table: table[0]):
        with pytest.raises(numba.core.errors.TypingError):
            uncounted(kernel)(np.zeros((2, 3)))


def test_a_kernel_that_counts_no_references_leaves_its_arguments_alone():
    @inner
    def first_of(row):
        return row[0]

    @uncounted
    def total(tables):
        return first_of(tables[0][1]) + first_of(tables[1])

    tables = (np.ones((2, 3)), np.ones(3))
    before = [sys.getrefcount(table) for table in tables]
    assert [total(tables) for _ in range(100)] == [2.0] * 100
    assert [sys.getrefcount(table) for table in tables] == before


@pytest.mark.parametrize("decorator", ["njit", "inner"])
def test_a_changed_callee_of_another_module_is_compiled_anew(tmp_path, decorator):
    (tmp_path / "caller.py").write_text(CALLER)
    assert run(tmp_path, decorator, 1.0) == 2.0
    assert run(tmp_path, decorator, 2.0) == 3.0


@pytest.mark.parametrize(
    ("imported", "name"),
    [("from numbers_of import STEP", "STEP"), ("import numbers_of", "numbers_of.STEP")],
)
def test_a_changed_constant_from_another_module_is_compiled_anew(tmp_path, imported, name):
    (tmp_path / "caller.py").write_text(CALLER)
    callee = f"from slam._jit import njit\n{imported}\n@njit\n"
    callee += f"def inner(x):\n    return x + {name}\n"
    for step in (1.0, 2.0):
        (tmp_path / "numbers_of.py").write_text(f"STEP = {step}\n")
        assert run(tmp_path, "njit", step, callee) == 1.0 + step


def test_a_cache_that_names_types_which_are_gone_is_an_empty_cache(tmp_path):
    """As after an update that moved a class to another module."""
    (tmp_path / "caller.py").write_text(CALLER)
    run(tmp_path, "njit", 1.0)
    indices = list((tmp_path / "cache").rglob("caller.outer*.nbi"))
    assert len(indices) == 1
    with indices[0].open("rb") as file:
        version = pickle.load(file)
    indices[0].write_bytes(pickle.dumps(version) + b"cslam.errors\nGone\n.")
    assert run(tmp_path, "njit", 1.0) == 2.0


def test_compiling_is_said_once_and_a_run_without_it_not(caplog: pytest.LogCaptureFixture) -> None:
    @numba.njit
    def twice(x: int) -> int:
        return 2 * x

    with caplog.at_level(logging.INFO, logger="slam._jit"):
        with announced("the test's kernel", 2.0):
            assert twice(2) == 4
            assert twice(0.5) == 1.0  # compiled again, for another type
        assert [r.message for r in caplog.records] == [
            "compiling the test's kernel, the first time only: about 2 s"
        ]
        with announced("the test's kernel", 2.0):
            twice(3)
        assert len(caplog.records) == 1


@pytest.mark.parametrize("collected", [False, True])
def test_the_collector_rests_while_a_kernel_compiles_and_is_left_as_it_was(collected: bool) -> None:
    resting = []

    class Look(event.Listener):
        def on_start(self, event: object) -> None:
            resting.append(not gc.isenabled())

        def on_end(self, event: object) -> None: ...

    was = gc.isenabled()
    (gc.enable if collected else gc.disable)()
    try:
        with event.install_listener(COMPILING, Look()):
            assert numba.njit(lambda x: x + 1)(1) == 2
            with pytest.raises(numba.core.errors.TypingError):
                numba.njit(lambda x: x.nothing)(1)
        assert resting
        assert all(resting)
        assert gc.isenabled() is collected
    finally:
        (gc.enable if was else gc.disable)()


def test_an_implementation_that_fitted_other_types_is_not_taken_for_these() -> None:
    @numba.njit
    def summed(x, y):
        return x + y

    assert summed(1, 2) == 3
    assert summed(1.5, 2) == 3.5
    assert summed("a", "b") == "ab"
    assert (summed(np.ones(2), 1) == 2.0).all()
    for _ in range(2):
        with pytest.raises(numba.core.errors.TypingError, match="No implementation of function"):
            summed(1, "b")

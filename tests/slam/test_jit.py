# SPDX-License-Identifier: Apache-2.0
"""The compile cache notices a change in a kernel of another module; compiling is said once."""

import hashlib
import logging
import os
import pickle
import sys
from pathlib import Path

import numba
import numpy as np
import pytest

from slam._jit import announced, inner, uncounted
from tests.processes import python

pytestmark = pytest.mark.slow
KERNEL = """
from slam._jit import inner, njit
{}
@{}
def called(x):
    return x + {}
"""
CALLER = """
from slam._jit import njit
from {} import called
@njit
def outer(x):
    return called(x)
"""


def run(folder: Path, step: float, constant: float) -> list[float]:
    """What kernels say that call one of another module: two of a step, two of a constant."""
    kernels = {
        "compiled": KERNEL.format("", "njit", step),
        "within": KERNEL.format("", "inner", step),
        "named": KERNEL.format("from numbers_of import STEP", "njit", "STEP"),
        "dotted": KERNEL.format("import numbers_of", "njit", "numbers_of.STEP"),
    }
    (folder / "numbers_of.py").write_text(f"STEP = {constant}\n")
    for name, text in kernels.items():
        (folder / f"{name}.py").write_text(text)
        (folder / f"calls_{name}.py").write_text(CALLER.format(name))
    code = "".join(f"import calls_{name}; print(calls_{name}.outer(1.0))\n" for name in kernels)
    path = f"{Path(__file__).parents[2]}{os.pathsep}{folder}"
    done = python("-c", code, PYTHONPATH=path, PYTHONDONTWRITEBYTECODE="1",
                  NUMBA_CACHE_DIR=str(folder / "cache"))  # fmt: skip
    return [float(line) for line in done.stdout.splitlines()]


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


@pytest.fixture(scope="module")
def ran(tmp_path_factory) -> Path:
    """Where all four are compiled."""
    folder = tmp_path_factory.mktemp("kernels")
    assert run(folder, 1.0, 1.0) == [2.0, 2.0, 2.0, 2.0]
    return folder


def test_a_changed_callee_or_constant_of_another_module_is_compiled_anew(ran):
    assert run(ran, 2.0, 1.0) == [3.0, 3.0, 2.0, 2.0]
    assert run(ran, 2.0, 2.0) == [3.0, 3.0, 3.0, 3.0]


def test_a_cache_that_names_types_which_are_gone_is_an_empty_cache(ran):
    """As after an update that moved a class to another module."""
    indices = list((ran / "cache").rglob("calls_compiled.outer*.nbi"))
    assert len(indices) == 1
    with indices[0].open("rb") as file:
        version = pickle.load(file)
    gone = pickle.dumps(version) + b"cslam.errors\nGone\n."
    indices[0].write_bytes(gone + hashlib.sha256(gone).digest())
    assert run(ran, 2.0, 2.0) == [3.0, 3.0, 3.0, 3.0]


DAMAGED = """
import os
from pathlib import Path

import numpy as np

from slam._jit import njit

cache = Path(os.environ["NUMBA_CACHE_DIR"])


def called():
    @njit
    def step(x):
        return x + 1.0

    assert step(1.0) == 2.0
    return step.stats


def files():
    return {file: file.read_bytes() for file in sorted(cache.rglob("*.nb[ci]"))}


# -- the cache and its damages
assert sum(called().cache_misses.values()) == 1
whole = files()
assert len(whole) == 2
assert sum(called().cache_hits.values()) == 1
rng = np.random.default_rng(0)
for k in range(48):  # each kind to each of the two files, four times in the mean
    path = list(whole)[k % 2]
    data = bytearray(whole[path])
    kind = ("empty", "cut", "flip", "flip", "zeros", "gone")[int(rng.integers(6))]
    at = int(rng.integers(len(data)))
    if kind == "flip":
        data[at] ^= 1 << int(rng.integers(8))
    elif kind == "zeros":  # as a disk gives back what it never wrote
        data[at:] = bytes(len(data) - at)
    else:
        del data[0 if kind == "empty" else at :]
    path.write_bytes(data)
    if kind == "gone":
        path.unlink()
    damaged = kind == "gone" or data != whole[path]
    assert sum(called().cache_misses.values()) == damaged, (kind, path, at)
    assert sum(called().cache_hits.values()) == 1, (kind, path, at)
print("survived")
"""


def test_a_damaged_entry_of_the_cache_is_made_again(tmp_path):
    """A torn file of a power cut, a flipped bit: the code in it would end the process."""
    (tmp_path / "damaged.py").write_text(DAMAGED)
    done = python(tmp_path / "damaged.py", NUMBA_CACHE_DIR=str(tmp_path / "cache"))
    assert (done.returncode, done.stdout, done.stderr) == (0, "survived\n", "")


def test_a_cache_that_cannot_be_written_any_more_is_done_without(tmp_path):
    """Its disk is full, or somebody made something else of its files."""
    script = DAMAGED.partition("# --")[0] + (
        "called()\n"
        "for file in files():\n    file.unlink()\n    (file / 'full').mkdir(parents=True)\n"
        "assert sum(called().cache_misses.values()) == 1\nprint('done')"
    )
    (tmp_path / "full.py").write_text(script)
    done = python(tmp_path / "full.py", NUMBA_CACHE_DIR=str(tmp_path / "cache"))
    assert (done.returncode, done.stdout, done.stderr) == (0, "done\n", "")


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

# SPDX-License-Identifier: Apache-2.0
"""Kernels are optimised once: what only kernels call is never made executable by itself."""

import numba
import numpy as np
import pytest

from slam import _jit, _numba


@pytest.mark.skipif(numba.version_info.short != _numba.TRIED, reason="another Numba")
def test_only_what_python_enters_is_made_executable():
    @_jit.inner
    def lowest(x: float) -> float:
        return x - 1.0

    @_jit.inner
    def middle(x: float) -> float:
        room = np.zeros(2)
        room[0], room[1] = lowest(x), lowest(2.0 * x)
        return float(room.sum())

    @numba.njit
    def entered(x: float) -> float:
        return middle(x) + lowest(x)

    @numba.njit
    def beside(x: float) -> float:
        return middle(x)

    assert entered(3.0) == 9.0
    assert beside(3.0) == 7.0
    finished = {
        kernel.py_func.__name__: kernel.overloads[(numba.float64,)].library._finalized
        for kernel in (lowest, middle, entered, beside)
    }
    assert finished == {"lowest": False, "middle": False, "entered": True, "beside": True}


def test_a_kernel_that_python_and_kernels_call_is_both():
    @numba.njit
    def factorial(n: int) -> int:
        return 1 if n < 2 else n * factorial(n - 1)

    @numba.njit
    def twice(n: int) -> int:
        return 2 * int(factorial(n))

    assert (twice(5), factorial(5)) == (240, 120)

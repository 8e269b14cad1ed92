# SPDX-License-Identifier: Apache-2.0
"""The user is told when something is compiled, and only then."""

from __future__ import annotations

import gc
import logging

import numba
import pytest

from slam._jit import announced


def test_compiling_is_said_once_and_a_run_without_it_not(caplog: pytest.LogCaptureFixture) -> None:
    @numba.njit
    def twice(x: int) -> int:
        return 2 * x

    with caplog.at_level(logging.INFO, logger="slam._jit"):
        with announced("the test's kernel"):
            assert not gc.isenabled()
            assert twice(2) == 4
            assert twice(0.5) == 1.0  # compiled again, for another type
        assert [r.message for r in caplog.records] == [
            "compiling the test's kernel, which takes some seconds the first time"
        ]
        with announced("the test's kernel"):
            twice(3)
        assert len(caplog.records) == 1
    assert gc.isenabled()


def test_the_collector_is_left_as_it_was_whatever_happens() -> None:
    gc.disable()
    try:
        with pytest.raises(ZeroDivisionError), announced("nothing"):
            raise ZeroDivisionError
        assert not gc.isenabled()
    finally:
        gc.enable()

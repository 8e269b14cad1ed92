# SPDX-License-Identifier: Apache-2.0
"""A packed table is to kernels what the named tuple is to Python: names, numbers and arrays."""

import gc
from typing import Any, NamedTuple

import numpy as np
import pytest
from numba import njit
from numba.core.errors import TypingError
from numpy.typing import NDArray

from sim.core.packed import packed
from sim.core.state import record

ROW = record(np.float64, "x y")


class Part(NamedTuple):
    rows: NDArray[Any]
    share: float


class Whole(NamedTuple):
    strided: NDArray[np.int32]
    parts: tuple[Part, Part]
    rates: tuple[float, float]
    row: int
    wanted: bool
    first: Part


@njit
def read(whole: Any) -> tuple[float, ...]:
    total = 0.0
    for part in whole.parts:
        part.rows[1].y += part.share
        total += part.rows[0].x
    ahead = whole.strided[whole.row, 1] if whole.wanted else 0
    return total, float(ahead), whole.rates[1], whole.first.share


def whole(*, wanted: bool = True) -> Whole:
    parts = [Part(np.zeros(2, ROW), 0.5 + k) for k in range(3)]
    for k, part in enumerate(parts):
        part.rows["x"] = 10.0 + k
    strided = np.arange(12, dtype=np.int32).reshape(3, 4)[:, ::2]
    return Whole(strided, (parts[0], parts[1]), (1.0, -2.5), 2, wanted, parts[2])


def test_kernels_read_every_field_and_write_into_the_arrays():
    table = whole()
    assert read(packed(table)) == (21.0, 10.0, -2.5, 2.5)
    assert [part.rows["y"].tolist() for part in table.parts] == [[0.0, 0.5], [0.0, 1.5]]
    assert read(packed(whole(wanted=False)))[1] == 0.0


def test_what_is_written_later_is_seen_and_nothing_is_freed():
    table = packed(whole())
    gc.collect()
    assert read(table) == read(table) == (21.0, 10.0, -2.5, 2.5)
    live = whole()
    table = packed(live)
    live.parts[0].rows["x"] = -1.0
    assert read(table)[0] == 10.0


def test_tables_with_the_same_fields_are_of_one_type_and_unknown_names_are_refused():
    assert packed(whole())._numba_type_ is packed(whole())._numba_type_
    with pytest.raises(TypingError, match="nowhere"):
        njit(lambda table: table.nowhere)(packed(whole()))

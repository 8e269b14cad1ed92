# SPDX-License-Identifier: Apache-2.0
"""What comes from outside is of its kind, or refused with field, value and what was expected."""

import gc
from contextlib import suppress
from typing import Annotated, Any, Literal

import numpy as np
import pytest
from msgspec import Meta

from slam.errors import InvalidValueError
from slam.shaped import Metres, Pose, Share, Table, Word, shaped


class Laser(Table, frozen=True):
    yaw_deg: Annotated[float, Meta(ge=-360.0, le=360.0)] = 0.0
    place: tuple[Metres, Metres] | None = None
    kind: Literal["disc", "box"] = "disc"


@pytest.mark.parametrize(
    ("value", "kind", "says"),
    [
        ({"yaw_deg": 400}, Laser, "x.yaw_deg must be a number from -360 to 360, got 400"),
        ({"yaw_dge": 1}, Laser, "x: unknown key 'yaw_dge'; known: .*Did you mean 'yaw_deg'?"),
        ({"place": [0, "1"]}, Laser, r"x.place\[1\] must be a number from -1e\+06 to 1e\+06"),
        ({"kind": "cone"}, Laser, "x.kind must be one of box, disc, got 'cone'"),
        (5, Laser, "x must be a table, got 5"),
        (np.zeros(2), Pose, r"x must be three finite numbers \(x m, y m, heading rad\), got"),
        ((0.0, np.nan, 1.0), Pose, r"x\[1\] must be a finite number, got nan"),
        ({"a": 1}, dict[str, Word], "x must be a table, got"),
        (True, Share, "x must be a number from 0 to 1, got True"),
        ("0.5", Share, "x must be a number from 0 to 1, got '0.5'"),
        ("a\u202eb", Word, "x must be a word of 0 to 100 letters"),
        ([], Annotated[list[int], Meta(min_length=1)], "x must be a list of 1 or more values"),
    ],
)
def test_what_is_refused_is_named_with_what_was_expected(value: Any, kind: Any, says: str):
    with pytest.raises(InvalidValueError, match=says):
        shaped("x", value, kind)


def test_numbers_of_numpy_and_of_cells_are_numbers():
    assert shaped("x", np.array([1.0, 2.0, 3.0]), Pose) == (1.0, 2.0, 3.0)
    assert shaped("x", (np.float64(1), np.int64(2), 3), Pose) == (1.0, 2.0, 3.0)
    assert shaped("x", "3.0", int, strict=False) == 3
    assert shaped("x", "inf", float, strict=False) == np.inf


def test_the_types_of_a_place_survive_the_garbage_collector():
    """As those of a bounded word beside a tuple do not with msgspec 0.22."""
    for value in ({"place": [0, 1]}, {"place": "here"}):
        with suppress(InvalidValueError):
            shaped("x", value, Laser)
        gc.collect()

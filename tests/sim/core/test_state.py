# SPDX-License-Identifier: Apache-2.0
"""Saved worlds are data: sizes and types are checked before anything is made of them."""

import json

import numpy as np
import pytest

from sim.core import state
from slam.errors import InvalidValueError

MAGIC = b"mobilia-world-1\n"


def block(arrays, body: bytes = bytes(64), length: int | None = None) -> bytes:
    header = json.dumps({"words": {}, "arrays": arrays}).encode()
    claimed = len(header) if length is None else length
    return MAGIC + claimed.to_bytes(8, "little") + header + body


def test_round_trip():
    arrays = {
        "a": np.array([[0.1, -0.0, np.inf, np.nan]]),
        "b": np.zeros((0, 3)),
        "c": np.array(True),
    }
    back, words = state.unpack(state.pack(arrays, {"n": 3}))
    assert words == {"n": 3}
    for name, array in arrays.items():
        assert (back[name].dtype, back[name].shape) == (array.dtype, array.shape)
        assert back[name].tobytes() == array.tobytes()


@pytest.mark.parametrize(
    ("damaged", "match"),
    [
        (block({"a": ["<f8", [10**12]]}), "does not fit 64 bytes"),
        (block({"a": ["<f8", [-8]]}), "does not fit"),
        (block({"a": ["<f8", [1.0]]}), "does not fit"),
        (block({"a": ["O", [8]]}), "which is no number's"),
        (block({"a": [["f8"], [8]]}), "which is no number's"),
        (block({"a": ["<f8", [4]]}), "32 bytes too many"),
        (block({"a": 5}), "damaged"),
        (block({}, b"", length=2**62), "a header of 4611686018427387904 bytes"),
        (MAGIC + (90_000).to_bytes(8, "little") + b"[" * 90_000, "damaged"),
        (MAGIC, "does not start with its mark"),
        (None, "no saved world"),
    ],
)
def test_what_was_never_saved_is_refused(damaged, match):
    with pytest.raises(InvalidValueError, match=match):
        state.unpack(damaged)

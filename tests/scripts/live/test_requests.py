# SPDX-License-Identifier: Apache-2.0
"""What pages ask for is read or refused, and nothing else."""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import fields

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scripts.live.requests import Anew, Click, Drive, Run, Seek, Speed
from sim.world.requests import Kidnap, MoveDoor, Push
from slam.errors import InvalidValueError

KINDS = (Anew, Click, Drive, Kidnap, MoveDoor, Push, Run, Seek, Speed)


@pytest.mark.parametrize(
    ("kind", "words", "said"),
    [
        (Push, {"name": "x" * 101}, "push: name must be a name of up to 100 letters"),
        (Push, {"name": "a\nb"}, "a name of up to 100 letters"),
        (Push, {"name": 7}, "a name of up to 100 letters"),
        (Drive, {"v": math.inf, "omega": 0.0}, "drive: v must be a number from"),
        (Drive, {"v": math.nan, "omega": 0.0}, "drive: v must be a number from .* got nan"),
        (Drive, {"v": "1", "omega": 0.0}, "drive: v must be a number from .* got '1'"),
        (Drive, {"v": True, "omega": 0.0}, "drive: v must be a number from .* got True"),
        (MoveDoor, {"opened": 1}, "door: opened must be True or False, got 1"),
        (Seek, {"back_s": -1.0}, "seek: back_s must be a number from 0"),
        (Speed, {"factor": 1e9}, "speed: factor must be a number from 0.05 to 20"),
        (Kidnap, {"pose": (0.0, math.nan, 0.0)}, r"kidnap: pose\[1\] must be a number"),
        (Click, {"origin": (0, 0), "direction": (0, 0, 1)}, "click: origin must be 3 values"),
        (Click, {"origin": (0, 0, 1), "direction": (0, 0, 0)}, "must have a direction"),
        (Anew, {"motion": 2.0}, "anew: motion must be a number from"),
        (Anew, {"slam": "x" * 500}, "anew: slam must be a name"),
    ],
)
def test_a_request_that_means_nothing_is_refused_at_birth(kind, words, said):
    with pytest.raises(InvalidValueError, match=said):
        kind(**words)


VALUES = (
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=120)
    | st.lists(st.floats(), max_size=4).map(tuple)
)  # fmt: skip


@settings(max_examples=300, deadline=None)
@given(st.data())
def test_anything_at_all_is_taken_or_refused_in_words(data):
    kind = data.draw(st.sampled_from(KINDS))
    words = {field.name: data.draw(VALUES) for field in fields(kind)}
    with suppress(InvalidValueError):
        kind(**words)

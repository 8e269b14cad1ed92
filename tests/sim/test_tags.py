# SPDX-License-Identifier: Apache-2.0
"""Truth at a stamp."""

from __future__ import annotations

import numpy as np
import pytest

from sim.tags import CeilingTags
from slam import se2
from slam.errors import InvalidValueError


def test_truth_is_exact_at_a_step_and_on_the_arc_between_steps() -> None:
    tags = CeilingTags()
    first = np.array([1.0, 2.0, 3.1])
    twist = (0.5, 0.1, 2.0)
    second = se2.compose(first, se2.exp(twist, 0.1))
    tags.note(0, first, [[0.0, 0.0, 3.1]])
    tags.note(100, second, [[1.0, 0.0, -3.1]])
    np.testing.assert_array_equal(tags.robot(0), first)
    np.testing.assert_array_equal(tags.robot(100), second)
    middle = se2.compose(first, se2.exp(twist, 0.025))
    np.testing.assert_allclose(tags.robot(25), middle, atol=1e-12)
    mover = tags.movers(50)
    assert mover[0, 0] == 0.5
    assert abs(abs(se2.wrap(float(mover[0, 2]))) - np.pi) < 1e-12


def test_what_was_not_noted_is_not_made_up() -> None:
    tags = CeilingTags(depth=2)
    with pytest.raises(InvalidValueError, match="nothing"):
        tags.robot(0)
    for time in (0, 10, 20):
        tags.note(time, np.zeros(3))
    with pytest.raises(InvalidValueError, match=r"10\.\.20"):
        tags.robot(5)
    with pytest.raises(InvalidValueError, match="after 20"):
        tags.note(20, np.zeros(3))
    tags.reset()
    tags.note(0, np.zeros(3))
    assert tags.movers(0).shape == (0, 3)

# SPDX-License-Identifier: Apache-2.0
"""Words on a picture."""

import numpy as np
import pytest

from sim.view import draw

pytestmark = pytest.mark.film


@pytest.mark.parametrize("x", [-500, -20, 0, 30, 100])
def test_what_lies_outside_is_cut_off(x):
    wide = np.zeros((30, 1100, 3), np.uint8)
    draw.text(wide, "a long command", (x + 500, 5), color=(255, 255, 255))
    narrow = np.zeros((30, 80, 3), np.uint8)
    draw.text(narrow, "a long command", (x, 5), color=(255, 255, 255))
    np.testing.assert_array_equal(narrow, wide[:, 500:580])

# SPDX-License-Identifier: Apache-2.0
"""A film strip holds every picture once, in the order of time, and says what does not fit."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from scripts.film.render import GAP, LABEL, MARGIN, evenly, strip
from slam.errors import InvalidValueError


def plain(level: int) -> np.ndarray:
    return np.full((90, 160, 3), level, np.uint8)


def test_pictures_stand_side_by_side_in_the_order_of_time(tmp_path: Path):
    path = tmp_path / "strip.png"
    whole = strip(
        [plain(10), plain(20), plain(30)], [0.0, 1.5, 3.0], path, columns=3, cell_width=80
    )
    with Image.open(path) as image:
        np.testing.assert_array_equal(np.asarray(image), whole)
    for k, level in enumerate((10, 20, 30)):
        x = MARGIN + k * (80 + GAP)
        cell = whole[6 + LABEL : 6 + LABEL + 45, x : x + 80]
        assert (cell == level).all()
        assert whole[6 : 6 + LABEL, x : x + 80].min() < 200  # its time is written above it


def test_many_moments_go_over_several_lines(tmp_path: Path):
    pictures = [plain(k) for k in range(5)]
    whole = strip(
        pictures, [float(k) for k in range(5)], tmp_path / "s.png", columns=3, cell_width=160
    )
    assert whole.shape[1] == 2 * MARGIN + 3 * 160 + 2 * GAP
    assert set(range(5)) <= set(np.unique(whole).tolist())


def test_evenly():
    assert evenly(3, 1.0, 5.0) == [1.0, 3.0, 5.0]
    assert evenly(1, 1.0, 5.0) == [5.0]
    with pytest.raises(InvalidValueError, match="at least 1 moment, got 0"):
        evenly(0, 0.0, 1.0)


def test_a_legend_stands_below_and_wraps(tmp_path: Path):
    parts = [np.full((40, 60, 3), 10, np.uint8)]
    legend = [("one of the colours", (1, 2, 3)), ("another of the colours", (4, 5, 6))]
    bare, told = (
        strip(parts, [0.0], tmp_path / "s.png", columns=1, cell_width=200, legend=named)
        for named in ((), legend)
    )
    below = told[len(bare) - MARGIN :]
    for _, color in legend:  # in a line of its own each, as both are wider than the strip
        assert (below == color).all(axis=2).any()
    assert len(told) > len(bare) + 2 * LABEL - 1

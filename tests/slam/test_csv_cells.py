# SPDX-License-Identifier: Apache-2.0
"""No word of a table is a formula to a spreadsheet; every word is read as it was."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from slam.csv_cells import cell_of, word_of


@pytest.mark.parametrize("word", ["=1+1", "+cmd", "-cmd", "@SUM(A1)", "\tx", "\rx", "=", "'=x"])
def test_what_a_spreadsheet_would_compute_is_text(word):
    assert cell_of(word) == f"'{word}"
    assert word_of(cell_of(word)) == word


@pytest.mark.parametrize("word", ["-0.5", "+1", "-1e-05", "-inf", "", "nan", "a=b", "it's", "'tis"])
def test_numbers_and_other_words_stay_as_they_are(word):
    assert cell_of(word) == word_of(word) == word


@given(st.text(st.sampled_from("'=+-@\t\r1.e a") | st.characters(), max_size=8))
def test_every_word_comes_back(word):
    cell = cell_of(word)
    assert word_of(cell) == word
    if cell.startswith(tuple("=+-@\t\r")):
        float(cell)

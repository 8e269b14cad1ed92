# SPDX-License-Identifier: Apache-2.0
"""Every file has tests that hold it, and every place in the table of marks has tests."""

import re

import pytest

from tests.conftest import MARKS, TESTS
from tests.test_imports import files
from tests.which import holders


def test_every_file_has_tests():
    assert all(holders(name) for name in files())
    found = {path.relative_to(TESTS).as_posix() for path in holders("slam.tracker.map_file")}
    assert "slam/tracker/test_map_file.py" in found
    assert {path.parent for path in holders("slam.guests.kiss")} == {TESTS / "slam" / "guests"}


def test_the_quick_half_leaves_out_every_mark():
    (words,) = re.findall(r'-m "not \((.*)\)"', (TESTS.parent / "Makefile").read_text())
    assert sorted(words.split(" or ")) == sorted(MARKS)


@pytest.mark.parametrize("place", [place for places in MARKS.values() for place in places])
def test_every_place_in_the_table_of_marks_is_there(place: str):
    file, _, test = place.partition("::")
    assert (TESTS / file).exists()
    assert not test or re.search(f"def {test}", (TESTS / file).read_text())

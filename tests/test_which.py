# SPDX-License-Identifier: Apache-2.0
"""Every file has tests that hold it, and the quick half leaves out every mark."""

import re
import tomllib

from tests.test_imports import ROOT, files
from tests.which import holders

TESTS = ROOT / "tests"


def test_every_file_has_tests():
    assert all(holders(name) for name in files())
    found = {path.relative_to(TESTS).as_posix() for path in holders("slam.tracker.map_file")}
    assert "slam/tracker/test_map_file.py" in found
    assert {path.parent for path in holders("slam.guests.kiss")} == {TESTS / "slam" / "guests"}


def test_the_quick_half_leaves_out_every_mark():
    (words,) = re.findall(r'-m "not \((.*)\)"', (ROOT / "Makefile").read_text())
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text())
    marks = settings["tool"]["pytest"]["ini_options"]["markers"]
    assert sorted(words.split(" or ")) == sorted(mark.partition(":")[0] for mark in marks)

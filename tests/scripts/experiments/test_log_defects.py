# SPDX-License-Identifier: Apache-2.0
"""Logs with the defects of public ones, read and run; the whole logs by the script itself."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from scripts.experiments import log_defects


def lines(times):
    return [f"FLASER 2 1.0 2.0 0 0 0 0 0 0 {t} host {t}\n" for t in times]


def test_the_defects_are_what_they_are_called():
    whole = lines([1234.567, 1235.25, 1236.75])
    assert [row.split()[-3] for row in log_defects.rounded(whole)] == ["1235", "1235", "1237"]
    assert [row.split()[-3] for row in log_defects.set_back(whole)] == [
        "1234.567", "1233.85", "1235.35",
    ]  # fmt: skip
    torn = log_defects.cut(whole)
    assert torn[:2] == whole[:2]
    assert not torn[2].endswith("\n")


def test_an_excerpt_of_intel_comes_through_all_of_them(tmp_path, capsys):
    root = os.environ.get("MOBILIA_DATA")
    folder = Path(root) if root else Path(__file__).resolve().parents[4] / "shared" / "data"
    log = folder / "intel" / "intel-corrected.log.xz"
    if not log.is_file():
        pytest.skip(f"NO REAL LOGS: {log} is missing (set MOBILIA_DATA to their folder)")
    words = ["--log", str(log), "--scans", "60", "--folder", str(tmp_path)]
    assert log_defects.STUDY.main([*words, "--results", str(tmp_path / "r.json")]) == 0
    told = capsys.readouterr().out
    assert told.count("| yes |") == len(log_defects.DEFECTS)
    assert "**no**" not in told

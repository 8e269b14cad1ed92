# SPDX-License-Identifier: Apache-2.0
"""A comparison scores what SLAMs from outside do to it, and goes on."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest

from scripts.compare.entry import Entry
from scripts.compare.plan import source_of
from slam.guests import Limits
from tests.scripts.compare.hand_made import recording
from tests.slam import misbehaving

CLIENT = Path(__file__).parents[2] / "slam" / "misbehaving.py"


def scored(fault: str, *, scan_s: float = 5.0, first_s: float = 10.0) -> dict[str, object]:
    drive = recording([(2.0, 1.0)] * 8)
    command = f"pipe:{sys.executable} -S -E {CLIENT} {fault}"
    entry = Entry(command, drive, Limits(scan_s=scan_s, first_s=first_s))
    entry.over([frame.without_truth() for frame in drive.frames])
    row: dict[str, object] = json.loads(entry.arrays()["row"])
    return row


@pytest.mark.parametrize(
    ("fault", "outcome"),
    [("crash", "raised"), ("hang", "hung"), ("nan", "nan"), ("stamp", "bad"), ("garbage", "bad")],
)
def test_each_fault_is_an_outcome(fault: str, outcome: str):
    row = scored(fault, scan_s=0.3 if outcome == "hung" else 5.0)
    assert (row["outcome"], row["scans"], row["lost"]) == (outcome, 2, 1)
    assert "scan 2," in str(row["failure"])
    assert row["lost_at_s"] == pytest.approx(0.4)


def test_one_that_cannot_start_has_lost_at_once():
    row = scored("mute", first_s=0.3)
    assert (row["outcome"], row["scans"], row["lost_at_s"]) == ("hung", 0, 0.0)


def test_a_program_that_changed_is_run_again(tmp_path: Path):
    (program := tmp_path / "mine.py").write_text("")
    assert source_of(f"pipe:python3 {program} --fast") == (program,)
    assert source_of("tests.slam.misbehaving:Any") == (Path(misbehaving.__file__),)
    assert source_of("shunting") == ()


def test_a_good_one_is_charged_its_own_time_and_memory():
    row = scored("none")
    assert row["failure"] is None
    assert row["scans"] == 8
    assert float(str(row["ms_per_scan_p50"])) > 0.0
    if sys.platform == "linux":
        assert 0.0 <= float(str(row["peak_memory_mb"])) < 100.0

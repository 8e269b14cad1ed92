# SPDX-License-Identifier: Apache-2.0
"""``rearranged.csv``: a row for each thing, as any reader of CSV has it; out is empty."""

import csv
from pathlib import Path

import pytest

from sim.actors.rearranging import FAR_M, Rearrangement
from sim.recording.tables import COLUMNS, write_rearranged

pytestmark = pytest.mark.slow
BOUNDS = (0.0, 0.0, 8.0, 6.0)


def test_what_was_put_elsewhere_is_written(tmp_path: Path):
    here, there, out = (1.5, 2.5, -0.1), (3.5, 0.5, 1.0), (8.0 + FAR_M, 0.0, 0.0)
    events = [
        Rearrangement(time_s=2.0, name="chair0", change="moved", before=here, after=there),
        Rearrangement(time_s=2.0, name="bin, the old", change="removed", before=there, after=out),
        Rearrangement(time_s=4.0, name="chair1", change="brought in", before=out, after=here),
    ]
    write_rearranged(tmp_path / "a.csv", events, BOUNDS)
    header, *rows = csv.reader((tmp_path / "a.csv").read_text().splitlines())
    assert tuple(header) == COLUMNS
    assert [row[1:3] for row in rows] == [
        ["chair0", "moved"], ["bin, the old", "removed"], ["chair1", "brought in"],
    ]  # fmt: skip
    read = [[tuple(map(float, filter(None, row[k : k + 3]))) for k in (3, 6)] for row in rows]
    assert read == [[here, there], [there, ()], [(), here]]
    assert [float(row[0]) for row in rows] == [2.0, 2.0, 4.0]

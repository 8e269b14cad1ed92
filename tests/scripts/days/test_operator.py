# SPDX-License-Identifier: Apache-2.0
"""What a session says to who looks after the building."""

from __future__ import annotations

from scripts.days.report import operator
from scripts.days.tables import last_session
from slam.days.changes import Change


def change(kind: str, x: float, **more) -> Change:
    return Change(kind=kind, at=(x, 0.0), size_m=0.5, confidence=0.9, places=((x, 0.0),), **more)


def test_doors_have_numbers_by_where_they_are_and_things_are_counted():
    earlier = [change("door", 9.0, angle_deg=80.0), change("door", 2.0, angle_deg=-70.0)]
    now = [
        change("door", 9.1, angle_deg=-82.0), change("moved", 4.0, before=(5.0, 1.0)),
        change("moved", 6.0, before=(7.0, 1.0)), change("gone", 1.0),
    ]  # fmt: skip
    told = operator(now, [*earlier, *now])
    assert told == "door 2 turned by 82°, 2 things moved, 1 thing gone"
    assert operator([], earlier) == "nothing changed that it could tell"
    row = {"session": 3, "slam": "s", "place": "right", "found_after_s": 4.2, "map": "merged"}
    assert last_session([row | {"tracked": 1.0}], told).endswith("found in 4 s, never lost.")
    lost = last_session([row | {"tracked": 0.75, "place": "wrong"}], "")
    assert lost.endswith("found in 4 s, at a wrong place, in doubt in 25 % of the scans.")
    assert "not found in the map" in last_session([row | {"found_after_s": None}], told)

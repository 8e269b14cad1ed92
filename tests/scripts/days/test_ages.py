# SPDX-License-Identifier: Apache-2.0
"""Which older maps a session is tried in, when the verdict is asked, and sums over buildings."""

from __future__ import annotations

import json
from types import SimpleNamespace

import numpy as np
import pytest

from scripts.days.ages import ages_of, verdicts
from scripts.days.lifelong import COLUMNS
from scripts.experiments import lifelong_bars
from scripts.experiments.lifelong_bars import changes_line, read, summary
from slam.errors import LogFormatError
from slam.tracker.belief.status import Status


def test_an_age_counts_sessions_back_and_a_session_that_lay_apart_makes_it_older():
    assert list(ages_of(range(11), 11)) == [(1, 10), (3, 8), (10, 1)]
    assert list(ages_of([0, 1, 3], 5)) == [(1, 3), (3, 1)]
    assert list(ages_of([], 5)) == []
    assert list(ages_of([4], 5)) == [(1, 4)]


def test_the_verdict_is_asked_where_the_room_clearly_changed_and_where_it_did_not():
    outdated, tracking = Status.OUTDATED.value, Status.TRACKING.value
    said = [outdated, outdated, tracking, outdated, tracking]
    estimates = [SimpleNamespace(diagnostics={"verdict": word}) for word in said]
    shares = np.array([0.9, 0.2, 0.3, 0.0, 0.0])
    assert verdicts(estimates, shares, 1) == {"outdated_told": 0.5, "outdated_false": 0.5}
    assert verdicts(estimates, np.full(5, 0.05), 0) == {
        "outdated_told": None,
        "outdated_false": None,
    }


def building(seed, errors):
    rows = [
        {
            **dict.fromkeys(COLUMNS), "slam": "shunting", "session": k, "place": "right",
            "start": "known", "found_after_s": 2.0 * k, "rmse_m": error,
        }
        for k, error in enumerate(errors)
    ]  # fmt: skip
    score = {"listed": 10, "right": 9, "seen": 4, "told": 3, "doors": [2, 1], "moved": [0, 0]}
    return {"settings": {"seed": seed, "change": 0.3}, "rows": rows, "ages": [], "changes": score}


def test_the_sums_over_buildings_are_by_hand():
    both = [building(1, [0.01, 0.02, 0.03]), building(2, [0.01, 0.02, 0.01])]
    both[1]["rows"][2] |= {"found_after_s": None, "place": "not found", "start": "unknown"}
    lines = summary(both, "shunting")
    assert lines[0].startswith("4 sessions: 3 found, 3 within 10 s, 0 at a wrong place; of 3")
    assert "last to session 1 1.00, to session 0 2.00" in lines[1]
    assert changes_line(both).startswith("changes: precision 0.90 (18 of 20), recall 0.75 (6 of 8)")
    assert changes_line([{**both[0], "changes": None}]).endswith("no session was found")


def test_a_folder_that_lifelong_did_not_write_is_refused(tmp_path):
    with pytest.raises(LogFormatError, match=r"lifelong\.json"):
        read(tmp_path)
    (tmp_path / "lifelong.json").write_text(json.dumps([1]))
    with pytest.raises(LogFormatError, match="rows and settings"):
        read(tmp_path)
    assert lifelong_bars.main([str(tmp_path)]) == 1
    (tmp_path / "lifelong.json").write_text(json.dumps(building(1, [0.01, 0.02, 0.03])))
    with pytest.raises(SystemExit, match="2"):
        lifelong_bars.main([str(tmp_path), "--slam", "ekf"])

# SPDX-License-Identifier: Apache-2.0
"""Which older maps a session is tried in, and when the verdict is asked."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from scripts.days.truth import ages_of, verdicts
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

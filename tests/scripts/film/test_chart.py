# SPDX-License-Identifier: Apache-2.0
"""The chart of a film: curves at their heights, the band as claimed, events at their times."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from scripts.film.chart import ErrorChart, Series
from sim.events import Event
from sim.view.draw import MAGENTA, ORANGE, RED
from sim.view.moment import Shown

pytestmark = pytest.mark.film
COLORS = {"shunting": RED, "odometry": ORANGE}
LANES = ("chair", "door", "unsure")


def chart(span_s=(0.0, 60.0)) -> ErrorChart:
    return ErrorChart(
        (600, 240), 1.0, span_s=span_s, primary="shunting", colors=COLORS, lanes=LANES
    )


def series(error_m: float | None, sigma_m: float, seconds=range(61)) -> Series:
    made = Series()
    for at_s in seconds:
        error = None if error_m is None else np.array([error_m, 0.0, 0.001])
        made.add(shown(at_s, error, np.diag([sigma_m**2, (0.5 * sigma_m) ** 2, 1e-5])), "shunting")
    return made


def shown(at_s, error, covariance):
    """A moment of one track that is off by ``error``."""
    estimate = SimpleNamespace(T_map_robot=np.ones(3), covariance=covariance)
    moment = SimpleNamespace(
        seconds=float(at_s), estimates={"shunting": estimate},
        truth_map=None if error is None else np.ones(3) - error,
    )  # fmt: skip
    moment.error = lambda name: Shown.error(moment, name)
    moment.claimed = lambda name: Shown.claimed(moment, name)
    return moment


def rows(picture: np.ndarray, color) -> np.ndarray:
    return np.flatnonzero((picture[:, 300] == color).all(axis=1))


def test_a_series_claims_two_sigma_of_the_longest_axis():
    made = Series()
    turn = math.pi / 6.0
    axes = np.array([[math.cos(turn), -math.sin(turn)], [math.sin(turn), math.cos(turn)]])
    covariance = np.zeros((3, 3))
    covariance[:2, :2] = axes @ np.diag([0.04, 0.01]) @ axes.T
    covariance[2, 2] = 0.0009
    made.add(shown(3.0, np.array([0.3, -0.4, 0.1]), covariance), "shunting")
    assert made.rows().tolist() == [pytest.approx([3.0, 0.5, 0.1, 0.4, 0.06])]


def test_events_stand_at_their_times_and_in_their_lanes():
    still = chart().paint({"shunting": series(None, 0.01)}, ())
    bars = [
        Event(kind="chair", name="a", start_s=10.0, end_s=20.0, seen=True),
        Event(kind="door", name="b", start_s=30.0, end_s=40.0),
        Event(kind="unsure", name="", start_s=50.0, end_s=50.0, seen=True),
    ]
    picture = chart().paint({"shunting": series(None, 0.01)}, bars)
    changed = (picture != still).any(axis=2)
    columns = np.flatnonzero(changed.any(axis=0))
    left, width = 58, 600 - 58 - 10
    assert columns[0] == pytest.approx(left + width / 6.0, abs=1)
    assert columns[-1] == pytest.approx(left + width * 50.0 / 60.0, abs=2)
    at = {c: np.argwhere((picture == c).all(axis=2) & changed) for c in (MAGENTA, RED)}
    assert len(at[MAGENTA]) > 0
    assert at[MAGENTA][:, 0].max() < at[RED][:, 0].min()

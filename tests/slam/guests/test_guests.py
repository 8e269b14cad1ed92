# SPDX-License-Identifier: Apache-2.0
"""Guests speak the protocol, follow a known drive, and lose a run when they fail."""

from __future__ import annotations

import sys

import numpy as np
import pytest

from slam import create
from slam.errors import InvalidValueError, MissingDependencyError, SlamFailedError
from slam.evaluation import metrics
from slam.frames import Float, Frame, LaserSpec, Odometry
from slam.frontend.odometry_prior import Prediction
from slam.guests import Guest
from slam.replay import Replay, Track
from tests.world2d import World2D, arena, frames, laser, wander

MODULES = {"kiss-icp": "kiss_icp", "karto": "karto_scanmatcher"}


@pytest.fixture(scope="module")
def stream() -> list[Frame]:
    return frames(World2D(arena()), wander(15.0), rate_hz=5.0, spec=laser(181), seed=4)


@pytest.mark.parametrize("name", MODULES)
def test_a_guest_follows_the_drive_better_than_the_wheels(name: str, stream: list[Frame]) -> None:
    pytest.importorskip(MODULES[name])
    replay = Replay.of({"guest": create(name), "odometry": create("odometry")})
    assert sum(1 for _ in replay.run(stream)) == len(stream)
    truth = replay.truth()
    assert truth is not None
    errors = {
        n: metrics.ate(track.online(), truth, align="se2") for n, track in replay.tracks.items()
    }
    assert errors["guest"].value < min(0.04, 0.5 * errors["odometry"].value)
    np.testing.assert_array_equal(replay.tracks["guest"].online().poses[0], 0.0)
    assert replay.tracks["guest"].final() is None


@pytest.mark.parametrize("name", MODULES)
def test_a_guest_begins_anew_and_repeats_itself(name: str, stream: list[Frame]) -> None:
    pytest.importorskip(MODULES[name])
    system = create(name)
    first = [system.update(frame).T_map_robot for frame in stream[:8]]
    system.reset()
    again = [system.update(frame).T_map_robot for frame in stream[:8]]
    np.testing.assert_allclose(again, first, atol=1e-9)


@pytest.mark.parametrize("name", MODULES)
def test_a_guest_that_is_not_installed_says_how_to_get_it(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    for module in [m for m in sys.modules if m.partition(".")[0] == MODULES[name]]:
        monkeypatch.delitem(sys.modules, module)
    monkeypatch.setitem(sys.modules, MODULES[name], None)
    with pytest.raises(MissingDependencyError, match=r"pip install 'mobilia\[guests\]'"):
        create(name)


class Failing(Guest):
    """Ends nowhere at its fourth scan."""

    def begin(self, spec: LaserSpec) -> None:
        self.scanner = spec

    def locate(self, points_robot: Float, prediction: Prediction) -> tuple[Float, dict[str, float]]:
        place = prediction.T_map_robot.copy()
        if len(self._stamps) == 3:
            place[0] = np.nan
        return place, {}


def test_a_guest_that_ends_nowhere_has_lost_the_run(stream: list[Frame]) -> None:
    track = Track("failing", Failing())
    failure = track.survive(stream)
    assert isinstance(failure, SlamFailedError)
    assert "scan 3" in str(failure)
    assert "nan" in str(failure)
    assert len(track.estimates) == 3
    assert Track("odometry", create("odometry")).survive(stream) is None


def test_a_guest_refuses_what_it_cannot_use(stream: list[Frame]) -> None:
    blind = Frame(stamp_ns=9, odometry=Odometry(stamp_ns=9, T_odom_robot=np.zeros(3)))
    with pytest.raises(InvalidValueError, match="needs a laser scan"):
        Failing().update(blind)
    guest = Failing()
    guest.update(stream[1])
    with pytest.raises(InvalidValueError, match="in order"):
        guest.update(stream[0])

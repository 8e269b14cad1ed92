# SPDX-License-Identifier: Apache-2.0
"""Play, pause, step and seek, and the pace, without a world and without a wall clock."""

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from scripts.live.playback import (
    KEPT_S,
    MOST_WAITING,
    Anew,
    Click,
    Drive,
    Inbox,
    Pace,
    Playback,
    Run,
    Seek,
    Speed,
    Step,
)
from sim.world.requests import Kidnap, MoveDoor, Push
from slam.errors import InvalidValueError, SlamFailedError


def moments(seconds: float, step: float = 0.5) -> Any:
    for k in range(round(seconds / step) + 1):
        yield SimpleNamespace(seconds=k * step, number=k, stamp_ns=k)


def shown(playback: Playback) -> float:
    assert playback.shown is not None
    return playback.shown.seconds


def test_seeking_back_shows_the_same_moments_again_and_then_goes_on():
    playback = Playback(moments(10.0))
    first = [playback.advance() for _ in range(9)]
    playback.do(Seek(back_s=2.0))
    assert playback.looks_back
    assert shown(playback) == 2.0
    again = [playback.advance() for _ in range(5)]
    assert again[:4] == first[5:]
    assert again[4] is not None
    assert again[4].seconds == 4.5
    assert not playback.looks_back


def test_only_the_last_minute_is_kept():
    playback = Playback(moments(100.0))
    playback.do(Seek(back_s=0.0))
    assert playback.shown is None  # before the first there is nothing to seek
    while playback.advance() is not None:
        pass
    assert playback.ended
    assert playback.resting
    playback.do(Seek(back_s=61.0))
    assert shown(playback) == 100.0 - KEPT_S
    playback.do(Seek(back_s=0.0))
    assert shown(playback) == 100.0


def test_a_step_goes_on_by_a_scan_and_pauses():
    playback = Playback(moments(10.0))
    playback.advance()
    playback.do(Step())
    while not playback.resting:
        playback.advance()
    assert shown(playback) == 0.5
    assert not playback.playing
    playback.do(Run(playing=True))
    assert not playback.resting


def test_a_slam_that_fails_ends_the_run_but_not_the_view():
    def source():
        yield from moments(1.0)
        raise SlamFailedError("SLAM 'x', scan 3, raised y")

    playback = Playback(source())
    while playback.advance() is not None:
        pass
    assert playback.why == "SLAM 'x', scan 3, raised y"
    playback.do(Seek(back_s=1.0))
    assert shown(playback) == 0.0


def test_the_pace_waits_for_what_is_early_and_never_runs_after_what_is_late():
    now = [100.0]
    pace = Pace(lambda: now[0])
    assert pace.wait_s(0.0, 1.0) == 0.0
    assert pace.wait_s(0.5, 1.0) == pytest.approx(0.5)
    now[0] = 100.5
    assert pace.wait_s(0.5, 1.0) == 0.0
    now[0] = 103.0  # a scan has taken long
    assert pace.wait_s(0.6, 1.0) == 0.0
    assert pace.wait_s(0.7, 1.0) == pytest.approx(0.1)
    assert pace.wait_s(0.8, 2.0) == 0.0  # another speed: from here on
    assert pace.wait_s(1.8, 2.0) == pytest.approx(0.5)


def test_an_inbox_that_is_full_says_so():
    inbox = Inbox()
    for _ in range(MOST_WAITING):
        inbox.put(Run(playing=True))
    with pytest.raises(InvalidValueError, match="64 requests wait already"):
        inbox.put(Run(playing=True))
    inbox.refuse(InvalidValueError("a" * 1000))
    assert inbox.refused() == "a" * 300
    assert inbox.refused() is None


@pytest.mark.parametrize(
    ("kind", "words", "said"),
    [
        (Push, {"name": "x" * 101}, "Push.name must be a word of 0 to 100 letters"),
        (Push, {"name": "a\nb"}, "Push.name must be a word"),
        (MoveDoor, {"opened": True, "name": "\x1b"}, "MoveDoor.name must be a word"),
        (Drive, {"v": math.nan, "omega": 0.0}, "Drive.v must be a number from .* got nan"),
        (Drive, {"v": "1", "omega": 0.0}, "Drive.v must be a number from .* got '1'"),
        (MoveDoor, {"opened": 1}, "MoveDoor.opened must be True or False, got 1"),
        (Seek, {"back_s": -1.0}, "Seek.back_s must be a number from 0"),
        (Speed, {"factor": 1e9}, "Speed.factor must be a number from 0.05 to 20"),
        (Kidnap, {"pose": (0.0, math.nan, 0.0)}, r"Kidnap.pose\[1\] must be a number"),
        (Click, {"origin": (0, 0), "direction": (0, 0, 1)}, "Click.origin must be 3 values"),
        (Click, {"origin": (0, 0, 1), "direction": (0, 0, 0)}, "must not be three zeros"),
        (Anew, {"motion": 2.0}, "Anew.motion must be a number from"),
    ],
)
def test_a_request_that_means_nothing_is_refused_at_birth(kind, words, said):
    with pytest.raises(InvalidValueError, match=said):
        kind(**words)


def test_places_may_come_as_numpy_s_numbers():
    assert Push(towards=tuple(np.array([1.0, 2.0]))).towards == (1.0, 2.0)
    assert Kidnap(pose=tuple(np.array([1.0, 2.0, 0.0]))).pose == (1.0, 2.0, 0.0)

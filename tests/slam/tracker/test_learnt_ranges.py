# SPDX-License-Identifier: Apache-2.0
"""A SLAM that learns its scanner's systematic error while driving."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import numpy as np

from slam import se2
from slam.frames import Float, Frame
from slam.frontend.observations import observe
from slam.frontend.range_error import RangeError
from slam.shunting import ShuntingSlam
from slam.tracker.config import TrackerConfig
from slam.tracker.learnt_ranges import less
from tests import world2d

ON = {"range_error.learn": "on"}


def error_m(ranges: Float) -> Float:
    """m; 20 mm up and down, once in 4 m."""
    out: Float = 0.020 * np.sin(math.tau * ranges / 4.0)
    return out


@cache
def driven(*, wrong: bool, seconds: float = 32.0) -> tuple[Frame, ...]:
    """Circles through a room, with the error or with noise only."""
    world, drive = world2d.World2D(world2d.arena()), world2d.wander(seconds)
    frames = world2d.frames(world, drive, rate_hz=4.7)
    if not wrong:
        return tuple(frames)
    out = []
    for frame in frames:
        assert frame.scan is not None
        ranges = frame.scan.ranges + error_m(frame.scan.ranges.astype(np.float64))
        scan = replace(frame.scan, ranges=ranges.astype(np.float32))
        out.append(replace(frame, scan=scan))
    return tuple(out)


def online(slam: ShuntingSlam, frames: tuple[Frame, ...]) -> Float:
    """(n, 3) poses as they were said."""
    return np.array([slam.update(frame.without_truth()).T_map_robot for frame in frames])


def late_error_m(poses: Float, frames: tuple[Frame, ...]) -> float:
    """Root mean square of the position's error in the second half."""
    first = frames[0].truth
    true = np.array([se2.between(first, frame.truth) for frame in frames])
    off = (poses - true)[len(frames) // 2 :, :2]
    return math.sqrt((off**2).sum(axis=1).mean())


def test_learning_the_error_halves_that_of_the_pose() -> None:
    frames = driven(wrong=True)
    learning = ShuntingSlam(ON)
    better = late_error_m(online(learning, frames), frames)
    assert better < 0.5 * late_error_m(online(ShuntingSlam(), frames), frames)


def test_a_scanner_with_noise_only_gives_the_same_poses() -> None:
    frames = driven(wrong=False)[:100]
    assert np.array_equal(online(ShuntingSlam(ON), frames), online(ShuntingSlam(), frames))


def test_off_is_the_default_of_both_presets() -> None:
    for preset in TrackerConfig.presets:
        assert TrackerConfig.preset(preset).range_error.learn == "off"
    assert ShuntingSlam()._ranges is None


def test_key_frames_follow_what_is_learnt_later() -> None:
    frame = driven(wrong=True)[0]
    seen = observe(frame, np.zeros(3), TrackerConfig())
    error = RangeError()
    nothing, offset = np.zeros(error.knots + 1), np.full(error.knots + 1, 0.02)
    nearer = less(seen, error, nothing, offset)
    laser = seen.T_robot_laser[:2]
    before = np.hypot(*(seen.points_robot - laser).T)
    after = np.hypot(*(nearer.points_robot - laser).T)
    assert np.allclose(before - after, 0.02)
    again = less(nearer, error, offset, nothing)
    assert np.allclose(again.points_robot, seen.points_robot)

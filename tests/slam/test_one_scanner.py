# SPDX-License-Identifier: Apache-2.0
"""SLAMs that know of one scanner get the scans of the first, and are led on between them."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from slam import create
from slam.estimate import Estimate
from slam.frames import Frame, Stream, StreamMetadata
from slam.odometry import OdometrySlam
from slam.one_scanner import OneScanner, for_several
from slam.oracle import Oracle
from slam.replay import Replay
from tests.slam.test_oracle import Watcher
from tests.world2d import Drive, World2D, arena, frames, laser

FRONT = replace(laser(91), T_robot_laser=np.array([0.3, 0.0, 0.0]))
REAR = replace(laser(61), T_robot_laser=np.array([-0.3, 0.0, math.pi]))
DRIVE = Drive((0.0, 0.0, 0.0), ((0.3, 0.4, 2.0),))


class Foreign(Watcher):
    """Somebody's SLAM, which knows nothing of several."""

    takes_several = False


def stream(*, odometry: bool = True) -> Stream:
    made = frames(World2D(arena()), DRIVE, rate_hz=5.0, spec=[FRONT, REAR], apart_s=0.05, seed=3)
    metadata = StreamMetadata(source="test", laser=FRONT, odometry=odometry)
    others = (replace(metadata, laser=REAR),)
    return Stream(metadata=replace(metadata, others=others), frames=lambda: made)


def run(system: Any, shown: Stream) -> tuple[Replay, Any]:
    replay = Replay.of({"it": system})
    for _ in replay.run(shown):
        pass
    return replay, replay.tracks["it"].system


def test_it_gets_the_first_scanner_s_and_odometry_leads_it_on() -> None:
    both = stream()
    replay, system = run(Foreign(), both)
    assert type(system) is OneScanner
    assert system.cells_hold == "guesses"
    seen = system.slam.seen
    assert [frame.scan.spec for frame in seen] == [FRONT] * (len(list(both)) // 2)
    track, whole = replay.tracks["it"], run(OdometrySlam(), both)[0].tracks["it"]
    for k, (ours, all_of_it) in enumerate(zip(track.estimates, whole.estimates, strict=True)):
        np.testing.assert_allclose(ours.T_map_robot, all_of_it.T_map_robot, atol=1e-12)
        if k != 1:  # led on from the first, whose zero may be no claim
            np.testing.assert_allclose(ours.covariance, all_of_it.covariance, atol=1e-12)
    assert track.final() is None or np.allclose(track.final().poses, track.online().poses)


def test_who_says_that_it_takes_several_gets_all() -> None:
    for name in ("shunting", "occupancy", "shunting-features", "odometry"):
        system = create(name)
        assert for_several(system) is system
    for name in ("ekf", "pipe:cat"):
        assert type(for_several(create(name))) is OneScanner
    told = for_several(Oracle(Foreign(), "moving"))  # labels are for oracles only
    assert type(told) is Oracle
    assert type(told.slam) is OneScanner
    assert told.takes_out == "moving"


def test_a_stream_of_one_scanner_leaves_every_slam_as_it_is() -> None:
    both = stream()
    alone = replace(both, metadata=replace(both.metadata, others=()))
    assert type(run(Foreign(), alone)[1]) is Foreign


def test_without_odometry_the_velocity_is_between_two_scans_of_one_scanner() -> None:
    """Those of two are moments apart, and a small error of either would be a high speed."""

    speeds: list[float] = []

    class Watching(OdometrySlam):
        """Right, but for a centimetre at the scans of the rear."""

        def update(self, frame: Frame) -> Estimate:
            speeds.append(float(frame.odometry.twist[0]))
            true, off = DRIVE.at(frame.stamp_ns * 1e-9)[0], 0.01 * (frame.scan.spec == REAR)
            return replace(super().update(frame), T_map_robot=true + np.array([off, 0.0, 0.0]))

    run(Watching(), stream(odometry=False))
    assert speeds[4:] == pytest.approx([0.3] * len(speeds[4:]), abs=0.02)

# SPDX-License-Identifier: Apache-2.0
"""Streams of other people's robots, with default parameters: rates, scanners, places, gaps."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import pytest

from slam import create, se2
from slam.evaluation import metrics
from slam.frames import Frame, LaserSpec, Odometry
from slam.replay import Track
from slam.trajectory import Trajectory
from tests.world2d import Drive, World2D, arena, frames, office, office_loop

pytestmark = pytest.mark.slow


def scanner(
    step_deg: float, fov_deg: float, range_m: float, at: tuple[float, float, float] = (0.1, 0, 0)
) -> LaserSpec:
    n = round(fov_deg / step_deg) + 1
    return LaserSpec(
        n_beams=n,
        angle_min=-math.radians(fov_deg) / 2.0,
        angle_increment=math.radians(step_deg),
        range_max=range_m,
        beam_time_offsets=np.zeros(n),
        T_robot_laser=np.array(at, dtype=np.float64),
    )


def curve(seconds: float) -> Drive:
    """On a circle of 1 m; a full turn takes 15.7 s."""
    return Drive((0.0, 0.0, 0.0), ((0.4, 0.4, seconds),))


def with_gaps(frame: Frame) -> Frame:
    """A third of the beams says nothing, half of those NaN, half inf."""
    assert frame.scan is not None
    beams = np.arange(frame.scan.spec.n_beams)
    lost = (beams * 7 + frame.stamp_ns // 1000) % 6
    ranges = np.where(lost == 0, np.nan, np.where(lost == 1, np.inf, frame.scan.ranges))
    scan = replace(frame.scan, ranges=ranges.astype(np.float32))
    return replace(frame, scan=scan)


def with_zeros(frame: Frame) -> Frame:
    """A third of the beams says 0, as drivers do that know no other word for nothing."""
    assert frame.scan is not None
    lost = np.arange(frame.scan.spec.n_beams) % 3 == 0
    ranges = np.where(lost, 0.0, frame.scan.ranges).astype(np.float32)
    return replace(frame, scan=replace(frame.scan, ranges=ranges))


def without_twist(frame: Frame) -> Frame:
    """Nothing but the pose of the wheels."""
    odometry = Odometry(stamp_ns=frame.stamp_ns, T_odom_robot=frame.odometry.T_odom_robot)
    return replace(frame, odometry=odometry)


@dataclass(frozen=True, kw_only=True)
class Foreign:
    """``limit_m``: root mean square error allowed, in the frame of the start."""

    segments: Callable[[], np.ndarray]
    drive: Drive
    rate_hz: float
    spec: LaserSpec
    limit_m: float
    change: Callable[[Frame], Frame] = without_twist


LOOP = office_loop()
STREAMS = {
    "75 Hz, 1 degree, 8 m": Foreign(
        segments=arena, drive=curve(5.0), rate_hz=75.0, spec=scanner(1.0, 180.0, 8.0), limit_m=0.01
    ),
    "5 Hz, 0.25 degree, 270 degrees": Foreign(
        segments=arena, drive=curve(12.0), rate_hz=5.0, spec=scanner(0.25, 270.0, 30.0),
        limit_m=0.01,
    ),
    "looks backwards, off the axis": Foreign(
        segments=arena, drive=curve(12.0), rate_hz=10.0,
        spec=scanner(0.5, 180.0, 30.0, (-0.4, 0.3, math.pi)), limit_m=0.01,
    ),
    "90 degrees of view": Foreign(
        segments=arena, drive=curve(12.0), rate_hz=10.0, spec=scanner(0.5, 90.0, 80.0),
        limit_m=0.01,
    ),
    "a third of the beams NaN or inf": Foreign(
        segments=arena, drive=curve(12.0), rate_hz=10.0, spec=scanner(1.0, 180.0, 80.0),
        limit_m=0.01, change=with_gaps,
    ),
    "a third of the beams 0": Foreign(
        segments=arena, drive=curve(6.0), rate_hz=10.0, spec=scanner(1.0, 180.0, 8.0),
        limit_m=0.01, change=with_zeros,
    ),
    "a scan each metre, round the office": Foreign(
        segments=office, drive=LOOP, rate_hz=0.8, spec=scanner(1.0, 180.0, 80.0), limit_m=0.10
    ),
    "8 m of range, round the office": Foreign(
        segments=office, drive=LOOP, rate_hz=5.0, spec=scanner(1.0, 180.0, 8.0), limit_m=0.05
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", STREAMS)
def test_foreign_streams_are_followed(name: str) -> None:
    case = STREAMS[name]
    world = World2D(case.segments())
    stream = [
        case.change(f) for f in frames(world, case.drive, rate_hz=case.rate_hz, spec=case.spec)
    ]
    track = Track("shunting", create("shunting"))
    assert track.survive(stream) is None
    truth = Trajectory(
        stamps_ns=np.array([f.stamp_ns for f in stream]), poses=np.array([f.truth for f in stream])
    )
    error = metrics.ate(track.online(), truth).value
    assert error <= case.limit_m


@pytest.mark.parametrize("silence", [math.nan, math.inf, 0.0])
def test_a_scanner_that_falls_silent_is_told_from_one_that_stands_still(silence: float) -> None:
    """Two seconds in the middle: odometry goes on and nobody pretends to know; then it is back."""
    spec = scanner(1.0, 180.0, 30.0)
    stream = frames(World2D(arena()), curve(12.0), rate_hz=5.0, spec=spec)
    system = create("shunting")
    for k, frame in enumerate(stream):
        blind = 20 <= k < 30
        if blind:
            assert frame.scan is not None
            scan = replace(frame.scan, ranges=np.full(181, silence, np.float32))
            frame = replace(frame, scan=scan)
        estimate = system.update(frame.without_truth())
        off = estimate.T_map_robot - se2.between(stream[0].truth, stream[k].truth)  # type: ignore[arg-type]
        assert estimate.converged is not blind
        assert math.hypot(off[0], off[1]) < 0.05
        assert k < 5 or math.hypot(*estimate.T_map_robot[:2]) > 0.3


def test_a_scanner_that_never_speaks_is_never_believed() -> None:
    spec = scanner(1.0, 180.0, 30.0)
    system = create("shunting")
    for frame in frames(World2D(arena()), curve(3.0), rate_hz=5.0, spec=spec):
        assert frame.scan is not None
        scan = replace(frame.scan, ranges=np.full(181, math.inf, np.float32))
        estimate = system.update(replace(frame, scan=scan).without_truth())
        assert not estimate.converged
        assert estimate.diagnostics["state"] == "blind"
    np.testing.assert_allclose(estimate.T_map_robot, frame.odometry.T_odom_robot, atol=1e-9)

# SPDX-License-Identifier: Apache-2.0
"""Twins of one drive, and how many chairs move."""

import math

import numpy as np
import pytest

from sim.core.dynamism import Dynamism
from sim.driving.drive import TourConfig
from sim.sensors.lidar.models.lms221 import Lms221Config
from sim.twins.room import UNSEEN_S
from sim.twins.twins import TWINS, rolled, twins
from sim.world.world import SUBSTEPS_PER_S, World
from slam.errors import InvalidValueError
from slam.frames import BeamClass

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def trio():
    made = twins(
        "arena",
        seconds=24.0,
        seed=3,
        dynamism=0.8,
        laser=Lms221Config.noise_only(),
        labels=True,
        n_chairs=14,
        change=0.0,
        crowd="none",
    )
    return made, {name: list(made[name]) for name in TWINS}


def test_path_and_odometry_are_the_same_to_the_bit(trio):
    _, frames = trio
    for name in TWINS[1:]:
        for ours, theirs in zip(frames["dynamic"], frames[name], strict=True):
            assert ours.odometry == theirs.odometry
            np.testing.assert_array_equal(ours.truth, theirs.truth)
    path = np.array([f.truth for f in frames["dynamic"]])
    assert np.linalg.norm(np.diff(path[:, :2], axis=0), axis=1).sum() > 3.0


def test_beams_on_what_never_moves_are_the_same_to_the_bit(trio):
    """Same pose, same wall, same noise: whatever else stands in the room."""
    _, frames = trio
    for name in TWINS[1:]:
        same = 0
        for ours, theirs in zip(frames["dynamic"], frames[name], strict=True):
            wall = (ours.labels.kind == BeamClass.STATIC) & (theirs.labels.kind == BeamClass.STATIC)
            wall &= ours.labels.incidence == theirs.labels.incidence
            np.testing.assert_array_equal(ours.scan.ranges[wall], theirs.scan.ranges[wall])
            same += int(wall.sum())
        assert same > 0.5 * 361 * len(frames["dynamic"])


def test_the_dynamic_twin_moves_the_semi_static_is_moved_the_static_rests(trio):
    _, frames = trio
    moving = {n: sum((f.labels.kind == BeamClass.MOVING).sum() for f in frames[n]) for n in TWINS}
    shift = {n: max(float(f.labels.displacement.max()) for f in frames[n]) for n in TWINS}
    assert moving["dynamic"] > 0
    assert moving["semi_static"] == moving["static"] == 0
    assert shift["semi_static"] > 0.05
    assert shift["static"] == 0.0


def test_nothing_is_displaced_while_in_view(trio):
    _, frames = trio
    seen: dict[int, float] = {}
    for frame in frames["semi_static"]:
        labels = frame.labels
        for body in np.unique(labels.body[labels.kind == BeamClass.SEMI_STATIC]).tolist():
            moved = float(labels.displacement[labels.body == body].max())
            if moved > 0.0:
                assert frame.stamp - seen[body] > UNSEEN_S
            seen[body] = frame.stamp


def test_a_room_without_a_free_path_is_refused():
    blind = TourConfig(robot_radius_m=0.06)  # a driver that keeps no distance
    with pytest.raises(InvalidValueError, match=r"none of 1 tours .* crosses chair"):
        twins("arena", seconds=20.0, seed=2, dynamism=0.0, n_chairs=40, tries=1, tour=blind)


def test_wheels_roll_along_a_path_without_slip():
    angle = np.linspace(0.0, math.pi, 200)
    circle = np.column_stack([np.sin(angle), 1.0 - np.cos(angle), angle])
    left, right, _ = rolled(circle, 0.33)[-1]
    assert 0.5 * (left + right) == pytest.approx(math.pi, rel=1e-4)
    assert right - left == pytest.approx(0.33 * math.pi, rel=1e-9)


@pytest.mark.parametrize("share", [0.0, 0.25, 0.5])
def test_a_set_share_of_the_chairs_moves(share):
    world = World("office", seed=3, dynamism=0.0, moving_share=share)
    chairs = [i for i, m in enumerate(world.scene.movers) if m.kind.startswith("chair")]
    shares, ever = [], np.zeros(len(world.scene.movers), dtype=bool)
    for k in range(12 * SUBSTEPS_PER_S):
        world.substep()
        if k % 30 == 0 and k > SUBSTEPS_PER_S:
            moving = world.movers_moving()
            ever |= moving
            shares.append(moving[chairs].mean())
    assert np.mean(shares) == pytest.approx(share, abs=0.06)
    assert not (share == 0.0 and ever.any())


def test_the_share_is_checked():
    with pytest.raises(InvalidValueError, match="moving_share"):
        Dynamism(moving_share=1.5)
    with pytest.raises(InvalidValueError, match="moving_share"):
        World("arena", moving_share=-0.1)

# SPDX-License-Identifier: Apache-2.0
"""Legs: planted feet stay planted, links keep their length, a walker who stops stands."""

import math

import numpy as np
import pytest

from sim.actors.people import columns, gait

DT = 1.0 / 300.0


class Walker:
    """One torso moved along by hand, its legs by ``sim.actors.people.gait``."""

    def __init__(self, yaw: float) -> None:
        self.qpos, self.qvel = np.array([1.0, -2.0, yaw]), np.zeros(3)
        self.feet, self.state = np.zeros((1, gait.N_COLUMNS)), np.zeros(1, columns.STATE)
        self.at, self.limbs = np.zeros((1, 2), dtype=np.int64), np.arange(4).reshape(1, 4)
        self.pos, self.quat = np.zeros((4, 3)), np.zeros((4, 4))
        gait.stand(self.qpos, self.at, self.feet)

    def step(self, speed: float, turn: float = 0.0) -> None:
        yaw = self.qpos[2]
        self.qvel[:] = speed * math.cos(yaw), speed * math.sin(yaw), turn
        self.qpos += DT * self.qvel
        physics, mocap = (self.qpos, self.qvel), (self.pos, self.quat)
        gait.walk(DT, physics, self.at, self.limbs, self.feet, self.state, mocap)

    def ends(self, length: float, rows: tuple[int, int]) -> np.ndarray:
        """Lower ends of the thighs (rows 0, 2) or shanks (rows 1, 3)."""
        w, x, y, z = self.quat[list(rows)].T
        down = -np.stack([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)], 1)
        return self.pos[list(rows)] + length * down


@pytest.mark.parametrize("yaw", [0.3, 3.1, -2.0])
@pytest.mark.parametrize("speed", [0.4, 1.0, 1.5])
def test_a_stance_foot_stands_still(speed, yaw):
    walker = Walker(yaw)
    slips, stance, swing_speeds = [], [], []
    before, swung = None, None
    for k in range(2400):
        ramp = min(1.0, k / 150.0, (2400 - k) / 300.0)
        walker.step(ramp * speed, turn=0.3 * ramp)
        feet = walker.ends(gait.SHANK, (1, 3))
        now = walker.feet[0, gait.SWING]
        if before is not None:
            for foot in range(2):
                moved = np.linalg.norm(feet[foot] - before[foot]) / DT
                if foot not in (now, swung):
                    slips.append(moved)
                elif foot == now and k > 600:
                    swing_speeds.append(moved)
        stance.append([now != 0, now != 1])
        before, swung = feet, now
    assert np.mean(slips) < 1e-3
    assert np.max(swing_speeds) < 3.0 * speed + 2.0
    assert 0.5 < np.mean(stance[600:2000]) < 0.75  # literature: 60 % of a stride


def test_links_keep_their_length_and_the_knee_joins_them():
    walker = Walker(0.7)
    for k in range(900):
        walker.step(min(1.3, k / 200.0), turn=0.5)
        knees = walker.ends(gait.THIGH, (0, 2))
        np.testing.assert_allclose(knees, walker.pos[[1, 3]], atol=1e-12)
        np.testing.assert_allclose(np.sum(walker.quat**2, axis=1), 1.0, atol=1e-12)
        soles = walker.ends(gait.SHANK, (1, 3))[:, 2]
        assert soles.min() > 0.0
        assert soles.max() < gait.SOLE + gait.LIFT + 1e-9


def test_who_stops_ends_with_the_feet_under_the_hips():
    walker = Walker(1.0)
    for k in range(900):
        walker.step(1.2 if k < 400 else 1.2 * max(0.0, 1.0 - (k - 400) / 120.0))
    for foot in range(2):
        rest = gait.rest_foot(*walker.qpos, foot)
        place = walker.feet[0, 2 * foot : 2 * foot + 2]
        assert math.hypot(place[0] - rest[0], place[1] - rest[1]) < 0.08
    assert walker.feet[0, gait.SWING] == -1.0


def test_who_sits_has_hips_on_the_seat_and_feet_on_the_floor_in_front():
    walker = Walker(0.4)
    for k in range(900):
        walker.state["sit"][0] = min(k / 240, 1.0)
        walker.step(0.0)
    hips = walker.pos[[0, 2], 2]
    np.testing.assert_allclose(hips, gait.SEAT_HEIGHT, atol=1e-9)
    soles = walker.ends(gait.SHANK, (1, 3))
    np.testing.assert_allclose(soles[:, 2], gait.SOLE, atol=1e-6)
    ahead = (soles[:, :2] - walker.qpos[:2]) @ [math.cos(0.4), math.sin(0.4)]
    np.testing.assert_allclose(ahead, gait.KNEES, atol=0.08)
    knees = walker.pos[[1, 3], 2]
    assert (knees > 0.38).all()

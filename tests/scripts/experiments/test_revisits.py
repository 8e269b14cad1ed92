# SPDX-License-Identifier: Apache-2.0
"""Revisits: which scans are of one place, and by how much their poses are off."""

import numpy as np
import pytest

from scripts.experiments import revisits
from slam import se2
from tests.world2d import World2D, frame_at, laser, rectangle

pytestmark = pytest.mark.slow
ROOM = World2D(np.vstack([rectangle(-3.0, -2.0, 5.0, 6.0), rectangle(1.5, 1.0, 2.2, 2.0)]))
SPEC = laser(181)


def there_and_back() -> np.ndarray:
    x = np.concatenate([np.linspace(0.0, 3.0, 15), np.linspace(3.0, 0.0, 15)])
    return np.column_stack([x, np.zeros(30), 0.05 * np.sin(x)])


def scans_at(poses: np.ndarray) -> list:
    frames = []
    for k, pose in enumerate(poses):
        at = np.tile(se2.compose(pose, SPEC.T_robot_laser), (181, 1))
        ranges = ROOM.ranges(0.0, at, np.asarray(SPEC.angles), 30.0)
        frames.append(frame_at(int(k * 2e9), pose, ranges, SPEC))
    return frames


@pytest.mark.parametrize("off", [[0.0, 0.0, 0.0], [0.06, 0.08, 0.03]])
def test_poses_that_are_off_are_told_by_the_scans(off):
    poses = there_and_back()
    frames = scans_at(poses)
    claimed = poses.copy()
    claimed[15:] = [se2.compose(pose, off) for pose in poses[15:]]
    told = revisits.judged(frames, 2.0 * np.arange(30), claimed)
    assert told.count > 5
    assert told.apart_cm == pytest.approx(100.0 * np.hypot(*off[:2]), abs=2.0)


def test_scans_of_other_places_are_infinitely_far_apart():
    poses = there_and_back()
    elsewhere = poses + np.array([0.0, 3.0, 1.5])
    frames = [*scans_at(poses[:15]), *scans_at(elsewhere[15:])]
    told = revisits.judged(frames, 2.0 * np.arange(30), poses)
    assert told.count > 5
    assert told.apart_cm > 20.0


def test_a_place_is_revisited_after_a_way_or_a_carrying():
    poses, seconds = there_and_back(), 2.0 * np.arange(30)
    assert all(b - a > 10 for a, b in revisits.pairs_of(seconds, poses, None))
    assert not revisits.pairs_of(seconds / 100.0, poses, None)  # 20 s later
    assert {b >= 20 > a for a, b in revisits.pairs_of(seconds, poses, 20)} == {True}
    assert revisits.judged([], seconds[:1], poses[:1]).apart_cm is None

# SPDX-License-Identifier: Apache-2.0
"""What becomes a landmark, what goes, and what only hides."""

import math

import numpy as np

from slam.ekf.config import EkfConfig
from slam.ekf.slam import Lifecycle, in_view, unhidden_by_beams, unhidden_by_features
from slam.frames import LaserSpec, Scan

NOWHERE = np.zeros(0, dtype=np.int64)


def judge(life: Lifecycle, seen: list[int], expected: list[bool]) -> list[int]:
    gone = life.judge(
        np.array(seen, dtype=np.int64), np.array(expected), np.zeros(len(expected), dtype=bool)
    )
    life.remove(gone)
    return gone.tolist()


def test_a_second_look_confirms_and_missing_looks_delete():
    life = Lifecycle(EkfConfig(confirm_looks=2, detection=0.9, memory_looks=4.0))
    life.add(2)
    assert not life.confirmed.any()
    assert judge(life, [0, 1], [True, True]) == []
    assert life.confirmed.all()
    missed = 0
    while len(life.keys) == 2:
        judge(life, [0], [True, True])
        missed += 1
    assert 2 <= missed <= 4
    assert life.keys.tolist() == [0]
    assert life.deleted == 1
    life.add(1)
    assert life.keys.tolist() == [0, 2]  # names are not used again


def test_what_is_not_expected_is_not_missed():
    life = Lifecycle(EkfConfig())
    life.add(1)
    for _ in range(1000):
        assert judge(life, [], [False]) == []


def test_memory_is_bounded():
    """However often it was seen, a landmark that is gone goes after as many misses."""
    life = Lifecycle(EkfConfig(detection=0.5, memory_looks=5.0))
    life.add(1)
    for _ in range(500):
        judge(life, [0], [True])
    misses = 0
    while len(life.keys):
        judge(life, [], [True])
        misses += 1
    # 5 log(0.5 / 0.05) / log(0.95 / 0.5)
    assert misses == math.ceil(5.0 * math.log(10.0) / math.log(1.9))


def test_candidates_left_behind_go_and_landmarks_stay():
    life = Lifecycle(EkfConfig(confirm_looks=2))
    life.add(2)
    judge(life, [0], [True, False])
    gone = life.judge(NOWHERE, np.zeros(2, dtype=bool), np.ones(2, dtype=bool))
    assert gone.tolist() == [1]
    life.remove(gone)
    assert life.deleted == 0  # a candidate was no landmark


def test_view_is_range_and_field():
    config = EkfConfig(range_m=10.0, fov_deg=180.0)
    points = np.array([[5.0, 0.0], [9.9, 0.0], [-1.0, 3.0], [0.1, 5.0], [1.0, -5.0]])
    assert in_view(points, config).tolist() == [True, False, False, False, True]
    around = EkfConfig(range_m=10.0, fov_deg=360.0)
    assert in_view(points, around).tolist() == [True, False, True, True, True]


def test_a_thing_in_front_hides_and_one_behind_does_not():
    config = EkfConfig(occluder_m=0.3)
    landmarks = np.array([[6.0, 0.0], [6.0, 1.0], [2.0, 0.0]])
    seen = np.array([[3.0, 0.1]])
    assert unhidden_by_features(landmarks, seen, config).tolist() == [False, True, True]
    assert unhidden_by_features(landmarks, seen, EkfConfig(occluder_m=0.0)).all()
    assert unhidden_by_features(landmarks, np.zeros((0, 2)), config).all()


def test_only_beams_that_pass_beyond_prove_absence():
    spec = LaserSpec(n_beams=181, angle_min=-math.pi / 2.0, angle_increment=math.pi / 180.0)
    landmark = np.array([[4.0, 0.0]])
    for value, gone in ((7.0, True), (np.inf, True), (4.0, False), (2.0, False), (np.nan, True)):
        ranges = np.full(181, value, dtype=np.float32)
        scan = Scan(stamp_ns=0, ranges=ranges, spec=spec)
        assert unhidden_by_beams(landmark, scan).tolist() == [gone], value
    ranges = np.full(181, 7.0, dtype=np.float32)
    ranges[90] = np.nan  # one beam failed: it proves nothing
    assert unhidden_by_beams(landmark, Scan(stamp_ns=0, ranges=ranges, spec=spec)).tolist() == [
        False
    ]
    behind = np.array([[-4.0, 0.0]])
    far = Scan(stamp_ns=0, ranges=np.full(181, 9.0, dtype=np.float32), spec=spec)
    assert unhidden_by_beams(behind, far).tolist() == [False]

# SPDX-License-Identifier: Apache-2.0
"""Key frames of one place become one."""

import numpy as np
import pytest

from slam import se2
from slam.posegraph import Edge, optimise
from slam.shunting import ShuntingConfig, ShuntingSlam
from slam.tracker.tracking import loops, merging
from slam.tracker.tracking.merging import Merge
from tests.world2d import Drive, World2D, frames, laser, office, office_loop

ONCE = 31  # key frames in one round of a ring of 31 m
LOOSE = np.diag([0.03, 0.03, 0.003]) ** 2
INFORMATION = np.linalg.inv(np.diag([0.02, 0.02, 0.002]) ** 2)


def ring(rounds: int) -> np.ndarray:
    """(n, 3) a pose each metre, each round 5 cm beside the one before."""
    drive = Drive((0.0, 0.0, 0.0), ((1.0, 2.0 * np.pi / ONCE, rounds * ONCE + 1.0),))
    poses = np.array([drive.at(float(k))[0] for k in range(rounds * ONCE)])
    poses[:, 0] += 0.05 * (np.arange(len(poses)) // ONCE)
    return poses


def chain(poses: np.ndarray) -> list[Edge]:
    return [
        Edge(a=k, b=k + 1, T_a_b=se2.between(poses[k], poses[k + 1]), information=INFORMATION)
        for k in range(len(poses) - 1)
    ]


def written(poses: np.ndarray) -> np.ndarray:
    return np.ones(len(poses), np.bool_)


def test_a_way_that_was_driven_before_adds_no_key_frames() -> None:
    config = ShuntingConfig().loops
    few = config.recent + 2 * config.submap
    for rounds in (2, 5):
        poses = ring(rounds)
        merge = Merge.of(poses, written(poses), range(ONCE, len(poses)), len(poses), config)
        assert len(merge.left) <= ONCE + few
        off = poses[merge.left[merge.into]] - poses
        assert np.hypot(off[:, 0], off[:, 1]).max() < config.key_m
        assert np.abs(se2.wrap_array(off[:, 2])).max() < config.key_rad


def test_what_no_closure_holds_stays() -> None:
    poses, config = ring(2), ShuntingConfig().loops
    assert len(Merge.of(poses, written(poses), [], len(poses), config).left) == len(poses)
    unwritten = Merge.of(
        poses, ~written(poses), range(ONCE, len(poses)), len(poses), config
    )  # no map holds what they would stand for
    assert len(unwritten.left) == len(poses)
    searched = Merge.of(poses, written(poses), range(ONCE, len(poses)), ONCE + 10, config)
    assert set(range(ONCE + 10, len(poses))) <= set(searched.left.tolist())


def test_the_graph_that_is_left_holds_together_where_it_was() -> None:
    """Each key frame is joined to the first, and least squares move none."""
    poses = ring(3)
    config = ShuntingConfig().loops
    merge = Merge.of(poses, written(poses), range(ONCE, len(poses)), len(poses), config)
    edges = merge.joined(chain(poses), poses, LOOSE)
    left = poses[merge.left]
    reached = {0}
    for _ in left:
        reached |= {k for e in edges for k in (e.a, e.b) if {e.a, e.b} & reached}
    assert len(reached) == len(left)
    assert len(edges) == len({(edge.a, edge.b) for edge in edges})
    solved, _ = optimise(left, edges)
    assert solved == pytest.approx(left, abs=1e-5)
    round_again = [edge for edge in edges if edge.b > edge.a + 1]
    for edge in round_again:  # no surer than what it stands for
        assert np.linalg.eigvalsh(INFORMATION)[0] > np.linalg.eigvalsh(edge.information)[0]


def test_a_map_that_is_not_moved_keeps_all_key_frames(monkeypatch: pytest.MonkeyPatch) -> None:
    """Else past poses would lose the corrections that only their own key frames have."""
    monkeypatch.setattr(loops, "MOST_KEYS", 10)
    drive = Drive(office_loop().start, office_loop().pieces)
    stream = frames(World2D(office()), drive, rate_hz=1.0, spec=laser(181), seed=4)
    slam = ShuntingSlam({"cell_m": 0.05, "loops.long_m": 20.0, "loops.corrects": 0})
    for frame in stream:
        slam.update(frame.without_truth())
    assert slam._loops._stand == list(range(len(slam._loops.keys)))


@pytest.mark.slow
def test_round_and_round_the_graph_stops_growing(monkeypatch: pytest.MonkeyPatch) -> None:
    """Four times round an office: all poses are kept, and are as good as with all key frames."""
    once = office_loop()
    drive = Drive(once.start, once.pieces * 4)
    stream = frames(World2D(office()), drive, rate_hz=1.0, spec=laser(181), seed=4)
    truth = np.array([se2.between(stream[0].truth, frame.truth) for frame in stream])  # type: ignore[arg-type]
    errors = {}
    for most in (1000, 60):
        monkeypatch.setattr(merging, "MOST_KEYS", most)
        monkeypatch.setattr(loops, "MOST_KEYS", most)
        slam, counts = ShuntingSlam({"cell_m": 0.05, "loops.long_m": 40.0}), []
        for frame in stream:
            slam.update(frame.without_truth())
            counts.append(len(slam._loops.keys))
        off = slam.trajectory().poses - truth
        errors[most] = np.sqrt((off[:, :2] ** 2).sum(axis=1).mean())
    assert max(counts) <= 90
    assert slam._loops.way_m > 140.0
    assert errors[60] < 1.2 * errors[1000]
    graph = slam._loops
    assert len(graph.poses) <= len(graph.keys) == len(graph._squares)
    assert {k for pair in graph._edges for k in pair} <= set(range(len(graph.poses)))

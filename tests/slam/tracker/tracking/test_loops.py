# SPDX-License-Identifier: Apache-2.0
"""Loops of long runs."""

import copy
import itertools
from collections.abc import Generator
from dataclasses import replace

import numpy as np
import pytest

from slam import se2
from slam.frames import Frame
from slam.frontend.observations import Observations, from_scan
from slam.posegraph import Edge
from slam.shunting import ShuntingConfig, ShuntingSlam
from slam.tracker.matching.matcher import Matcher
from slam.tracker.network import Network
from slam.tracker.tracking.loops import Loops
from tests.world2d import Drive, World2D, frames, laser, office, office_loop, rectangle

pytestmark = pytest.mark.slow
Found = Generator[None, None, Edge | None]
CONFIG = ShuntingConfig().changed({"cell_m": 0.05, "loops.long_m": 50.0})


def seen(frame: Frame) -> Observations:
    assert frame.scan is not None
    return from_scan(frame.scan, np.zeros(3), CONFIG)


Drifted = tuple[list[Frame], np.ndarray, np.ndarray, list[Observations]]


@pytest.fixture(scope="module")
def drifted() -> Drifted:
    """Once round the office and 10 m on, with a heading that creeps: 1 m off at the end."""
    once = office_loop()
    drive = Drive(once.start, (*once.pieces, (0.8, 0.0, 12.0)))
    stream = frames(World2D(office()), drive, rate_hz=1.0, spec=laser(181), seed=3)
    truth = np.array([se2.between(stream[0].truth, frame.truth) for frame in stream])  # type: ignore[arg-type]
    poses = [np.zeros(3)]
    for before, now in itertools.pairwise(truth):
        motion = se2.between(before, now) + np.array([0.002, 0.0, 0.0008])
        poses.append(se2.compose(poses[-1], motion))
    return stream, truth, np.array(poses), [seen(frame) for frame in stream]


def filled(graph: Loops, drifted: Drifted) -> Loops:
    _, _, poses, observations = drifted
    graph.add(poses[0], np.zeros(3), np.zeros((3, 3)), observations[0])
    for k in range(1, len(poses)):
        motion = se2.between(poses[k - 1], poses[k])
        graph.add(poses[k], motion, np.diag([1e-4, 1e-4, 1e-6]), observations[k])
    return graph


def finish(graph: Loops) -> None:
    """As after many scans in which no key frame came."""
    for _ in range(1000):
        graph.work()


def errors(poses: np.ndarray, truth: np.ndarray) -> np.ndarray:
    return np.asarray(np.hypot(*(poses - truth)[:, :2].T))


def test_a_drifted_way_is_bent_back_onto_itself(drifted: Drifted) -> None:
    _, truth, poses, _ = drifted
    graph = filled(Loops(CONFIG, Matcher(CONFIG), lambda: Network(CONFIG)), drifted)
    finish(graph)
    corrected = graph.corrected(poses)
    assert len(graph.edges) >= 3
    error, left = errors(poses, truth), errors(corrected, truth)
    assert error[-1] > 0.3
    assert left[-1] < 0.12
    assert left.max() < 0.6 * error.max()
    np.testing.assert_array_equal(graph.corrected(poses), corrected)


def test_a_map_that_moved_off_its_start_says_so(drifted: Drifted) -> None:
    """The map stays where most of it was: its first key frame moves, and that is known."""
    _, truth, poses, _ = drifted
    new = lambda: Network(CONFIG)  # noqa: E731
    graph = filled(Loops(CONFIG, Matcher(CONFIG), new, new), drifted)
    finish(graph)
    correction = graph.correction(lambda: poses)
    assert correction is not None
    first, last = correction.poses[0], correction.poses[-1]
    assert np.hypot(*first[:2]) > 0.05
    error = graph.map_error()
    assert error is not None
    known = se2.between(first, last) - last  # where the way from the start says that it ends
    assert known @ np.linalg.solve(error, known) <= 1.0
    off = last - truth[-1]
    assert off @ np.linalg.solve(error, off) < 11.3  # 3 numbers, 99 %


def test_a_copy_amid_a_search_comes_to_the_same_graph(drifted: Drifted) -> None:
    graph = filled(Loops(CONFIG, Matcher(CONFIG), lambda: Network(CONFIG)), drifted)
    while graph._begun is None:
        graph.work()
    other = copy.deepcopy(graph)
    finish(graph)
    finish(other)
    assert len(graph.edges) >= 3
    np.testing.assert_array_equal(other.corrected(drifted[2]), graph.corrected(drifted[2]))


class Misled(Loops):
    """The first two closures that it finds agree with each other, and are 1 m off."""

    def __init__(self) -> None:
        super().__init__(CONFIG, Matcher(CONFIG), lambda: Network(CONFIG))
        self.forced: list[Edge] = []
        self.right, self.closures.search = self.closures.search, self.found  # type: ignore[method-assign]

    def found(self, middle: int, j: int, predicted: np.ndarray, gate: float) -> Found:
        edge = yield from self.right(middle, j, predicted, gate)
        if edge is None or len(self.forced) == 2:
            return edge
        place = se2.compose(self.poses[middle], edge.T_a_b) + np.array([0.8, 0.6, 0.0])
        self.forced.append(replace(edge, T_a_b=se2.between(self.poses[middle], place)))
        return self.forced[-1]


def test_a_wrong_closure_is_taken_back() -> None:
    """Two wrong ones, off by 1 m: what is found later, where it then drives, outweighs them."""
    once = office_loop()
    drive = Drive(once.start, (*once.pieces, *once.pieces))
    stream = frames(World2D(office()), drive, rate_hz=1.0, spec=laser(181), seed=3)
    truth = np.array([se2.between(stream[0].truth, frame.truth) for frame in stream])  # type: ignore[arg-type]
    graph, poses = Misled(), [np.zeros(3)]
    graph.add(poses[0], np.zeros(3), np.zeros((3, 3)), seen(stream[0]))
    for k in range(1, len(truth)):
        motion = se2.between(truth[k - 1], truth[k]) + np.array([0.002, 0.0, 0.0004])
        poses.append(se2.compose(poses[-1], motion))
        graph.add(poses[k], motion, np.diag([1e-4, 1e-4, 1e-6]), seen(stream[k]))
        for _ in range(4):
            graph.work()
    finish(graph)
    assert len(graph.forced) == 2
    for edge in graph.forced:  # let go of, or measured again
        assert edge not in graph.edges or graph.weights[edge.a, edge.b] < 0.2
    assert errors(graph.corrected(np.array(poses)), truth).max() < 0.15


LONG, WIDE = 100.0, 68.0  # m, of the ring


def ring(seed: int) -> np.ndarray:
    """Segments of a corridor of 2.5 m round a block, with cupboards at random along its walls."""
    rng = np.random.default_rng(seed)
    half = 1.25
    walls = [
        rectangle(-half, -half, LONG + half, WIDE + half),
        rectangle(half, half, LONG - half, WIDE - half),
    ]
    for length, lengthwise, across in (
        (LONG, True, 0.0), (WIDE, False, LONG), (LONG, True, WIDE), (WIDE, False, 0.0),
    ):  # fmt: skip
        at = 3.0
        while at < length - 3.0:
            side = across + rng.choice([-1.0, 1.0]) * 1.05
            h = rng.uniform(0.15, 0.5)
            box = (at - h, side - 0.2, at + h, side + 0.2)
            walls.append(rectangle(*box) if lengthwise else rectangle(*np.array(box)[[1, 0, 3, 2]]))
            at += rng.uniform(2.0, 7.0)
    return np.vstack(walls)


def long_ring() -> tuple[list[Frame], np.ndarray]:
    """Round it once and 30 m on; frames and truth from the start."""
    corner = (0.4, 0.8, np.pi / 2.0 / 0.8)
    pieces = [piece for s in (LONG, WIDE) * 2 for piece in ((0.8, 0.0, (s - 1.0) / 0.8), corner)]
    drive = Drive((0.5, 0.0, 0.0), (*pieces, (0.8, 0.0, 30.0 / 0.8)))
    stream = frames(World2D(ring(2)), drive, rate_hz=1.0, spec=laser(181), seed=2)
    truth = np.array([se2.between(stream[0].truth, frame.truth) for frame in stream])  # type: ignore[arg-type]
    return stream, truth


def test_a_ring_of_335_m_closes_while_driving() -> None:
    """Pose, map and past follow; each move is announced; nothing is left to the end."""
    stream, truth = long_ring()
    slam = ShuntingSlam({"loops.datum": "first", "loops.corrects": 1})
    loops, tasks = slam._loops, [0]
    task = loops._task

    def counted() -> int:
        cost = task()
        tasks[-1] += cost
        return cost

    loops._task = counted  # type: ignore[method-assign]
    poses, moved, smooth = [], [], []
    for frame in stream:
        tasks.append(0)
        estimate = slam.update(frame.without_truth())
        poses.append(estimate.T_map_robot)
        correction = np.array(estimate.diagnostics["correction"])
        moved.append(np.hypot(*correction[:2]))
        smooth.append(se2.between(estimate.diagnostics["T_map_odom"], estimate.T_map_robot))
    error = errors(np.array(poses), truth)
    assert np.max(moved) > 0.3
    assert np.argmax(moved) > 400
    jumps = np.hypot(*np.diff(np.array(smooth)[:, :2], axis=0).T)
    assert jumps.max() < 1.0  # the robot drives 0.8 m from scan to scan
    assert error[np.argmax(moved) - 1] > 0.3
    assert error[-1] <= 0.10
    in_map = slam.poses_in_map()  # past poses moved with the map, the last is the one reported
    np.testing.assert_array_equal(in_map[-1], poses[-1])
    assert errors(in_map, truth).max() < error.max()
    assert max(tasks) <= CONFIG.loops.work + 14  # a piece beyond it
    spent = sum(tasks)
    final = slam.trajectory().poses
    assert sum(tasks) == spent
    after = errors(final, truth)
    assert after[-1] <= 0.10
    assert after.max() < 0.6 * error.max()


def test_places_found_while_lost_do_not_tear_the_map_alone(drifted: Drifted) -> None:
    graph = filled(Loops(CONFIG, Matcher(CONFIG), lambda: Network(CONFIG)), drifted)
    finish(graph)
    assert graph._torn_keys(1.0)
    graph._links = {(edge.a, edge.b) for edge in graph.edges}
    assert not graph._torn_keys(1.0)


def test_a_map_that_is_held_is_not_moved() -> None:
    stream, _ = long_ring()
    slam = ShuntingSlam({"loops.corrects": 1})
    slam.hold_map()
    for frame in stream:
        assert not any(slam.update(frame.without_truth()).diagnostics["correction"])

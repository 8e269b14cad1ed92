# SPDX-License-Identifier: Apache-2.0
"""What loops say of the map's error where the robot is."""

from dataclasses import replace

import numpy as np
import pytest

from slam import se2
from slam.frames import Float
from slam.frontend.observations import Observations
from slam.posegraph import Edge
from slam.tracker.tracking.anchors import map_errors
from slam.tracker.tracking.keys import KeyFrame
from tests.world2d import Drive

STEP = np.diag([0.02, 0.02, 0.004]) ** 2  # of each metre driven
CLOSURE = np.diag([0.03, 0.03, 0.003]) ** 2
NONE = np.zeros((3, 3))


@pytest.fixture(scope="module")
def ring() -> list[KeyFrame]:
    """Twice round a ring of 31 m, a key frame each metre."""
    drive = Drive((0.0, 0.0, 0.0), ((1.0, 0.2, 63.0),))
    poses = [drive.at(float(k))[0] for k in range(64)]
    nothing: Observations = None  # type: ignore[assignment] (nobody looks at it)
    return [
        KeyFrame(
            frame=k, T_map_robot=pose, observations=nothing,
            step=se2.between(poses[max(k - 1, 0)], pose), covariance=STEP,
            way_m=float(k), start_s=float(k), written=True,
        )
        for k, pose in enumerate(poses)
    ]  # fmt: skip


def deviation_m(covariance: Float) -> float:
    return float(np.sqrt(covariance[0, 0] + covariance[1, 1]))


def closure(keys: list[KeyFrame], a: int, b: int) -> dict[tuple[int, int], Edge]:
    T_a_b = se2.between(keys[a].T_map_robot, keys[b].T_map_robot)
    return {(a, b): Edge(a=a, b=b, T_a_b=T_a_b, information=np.linalg.inv(CLOSURE), robust=True)}


def graph(keys: list[KeyFrame]) -> list[Float]:
    return [key.T_map_robot for key in keys]


def test_without_loops_it_grows_as_driven(ring: list[KeyFrame]) -> None:
    errors = map_errors(ring, graph(ring), {}, NONE, NONE)
    assert not errors[0].any()
    assert errors[1] == pytest.approx(STEP, abs=1e-9)
    headings = [float(error[2, 2]) for error in errors]
    assert headings == pytest.approx([k * STEP[2, 2] for k in range(len(ring))])
    slack = map_errors(ring, graph(ring), {}, 0.5 * STEP, NONE)
    assert slack[-1] == pytest.approx(0.5 * errors[-1])


def test_back_at_the_start_it_is_that_of_the_closure(ring: list[KeyFrame]) -> None:
    before = map_errors(ring, graph(ring), {}, NONE, NONE)
    errors = map_errors(ring, graph(ring), closure(ring, 0, 31), NONE, NONE)
    assert errors[30] == pytest.approx(before[30])
    assert errors[31] == pytest.approx(CLOSURE, rel=1e-6)
    assert deviation_m(errors[32]) < 0.1 < 0.5 * deviation_m(before[32])
    later = {pair: replace(edge, a=edge.b, b=edge.a, T_a_b=se2.inverse(edge.T_a_b))
             for pair, edge in closure(ring, 0, 31).items()}  # fmt: skip
    found = map_errors(ring, graph(ring), {(31, 0): later[0, 31]}, NONE, NONE)
    assert deviation_m(found[31]) < 0.2


def test_what_the_graph_denies_of_the_map_is_an_error_of_the_map(ring: list[KeyFrame]) -> None:
    """From key frame 40 on, the graph puts the robot 0.8 m beside where the map has it."""
    denied = graph(ring)
    for k in range(40, len(denied)):
        denied[k] = denied[k] + np.array([0.8, 0.0, 0.0])
    sound = map_errors(ring, graph(ring), closure(ring, 0, 31), NONE, NONE)
    errors = map_errors(ring, denied, closure(ring, 0, 31), NONE, NONE)
    assert errors[39] == pytest.approx(sound[39])
    assert errors[45][0, 0] == pytest.approx(sound[45][0, 0] + 0.64, rel=1e-6)


def test_a_closure_that_the_map_denies_takes_little_away(ring: list[KeyFrame]) -> None:
    off = {pair: replace(edge, T_a_b=edge.T_a_b + np.array([0.0, 2.0, 0.0]))
           for pair, edge in closure(ring, 0, 31).items()}  # fmt: skip
    before = map_errors(ring, graph(ring), {}, NONE, NONE)
    assert map_errors(ring, graph(ring), off, NONE, NONE)[31] == pytest.approx(before[31])


def test_a_robot_that_was_doubted_and_goes_on_in_its_map_is_off_by_no_more(
    ring: list[KeyFrame],
) -> None:
    """Odometry's steps while nothing was written count no more; found elsewhere, they do."""
    keys = list(ring)
    for k in range(10, 14):
        keys[k] = replace(keys[k], written=False, covariance=100.0 * STEP)
    again = map_errors(keys, graph(keys), {}, NONE, CLOSURE)
    sound = map_errors(ring, graph(ring), {}, NONE, NONE)
    assert deviation_m(again[14]) < 1.2 * deviation_m(sound[14])
    keys[13] = replace(keys[13], found=True)
    elsewhere = map_errors(keys, graph(keys), {}, NONE, CLOSURE)
    assert deviation_m(elsewhere[14]) > 2.0 * deviation_m(sound[14])

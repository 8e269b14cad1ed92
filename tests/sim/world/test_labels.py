# SPDX-License-Identifier: Apache-2.0
"""Truth per beam: what was hit, whether it moves, how far it has moved since it was last seen."""

import math

import mujoco
import numpy as np

from sim.sensors.lidar.models.lms221 import Lms221Config
from sim.simulation import Simulation
from slam.frames import BeamClass


def lone(**settings) -> tuple[Simulation, int, int]:
    """One chair 1.5 m ahead of the robot; its body and its first qpos."""
    simulation = Simulation("arena", seed=1, dynamism=0, n_chairs=1, labels=True, **settings)
    return simulation, *put(simulation, 1.5, 0.0)


def put(simulation: Simulation, ahead: float, left: float) -> tuple[int, int]:
    model, data = simulation.world.model, simulation.world.data
    x, y, yaw = simulation.world.robot_pose().tolist()
    joint = model.joint("chair0/x")
    qpos, c, s = int(joint.qposadr[0]), math.cos(yaw), math.sin(yaw)
    data.qpos[qpos : qpos + 2] = x + c * ahead - s * left, y + s * ahead + c * left
    mujoco.mj_forward(model, data)
    return qpos, int(joint.dofadr[0])


def test_a_chair_that_rests_rolls_and_was_moved_unseen():
    simulation, _, dof = lone(laser=Lms221Config.ideal())
    first = simulation.observe().labels
    on_chair = first.kind == BeamClass.SEMI_STATIC
    assert 1 <= on_chair.sum() < 30
    assert set(np.unique(first.kind)) <= {BeamClass.STATIC, BeamClass.SEMI_STATIC}
    names = {simulation.world.model.body(int(b)).name for b in first.body[on_chair]}
    assert {n.partition("/")[0] for n in names} == {"chair0"}
    assert not first.mixed.any()
    simulation.world.data.qvel[dof] = 0.5
    rolling = simulation.observe().labels
    assert (rolling.kind == BeamClass.MOVING).any()
    assert not (rolling.kind == BeamClass.SEMI_STATIC).any()
    simulation.world.data.qvel[dof] = 0.0
    simulation.observe()
    put(simulation, -1.5, 0.0)  # behind the robot, out of its view
    assert not (simulation.observe().labels.kind == BeamClass.SEMI_STATIC).any()
    before = simulation.world.mover_poses()[0]
    put(simulation, 1.5, 0.4)
    after = simulation.observe().labels
    on_chair = after.kind == BeamClass.SEMI_STATIC
    moved = after.displacement[on_chair]
    assert on_chair.any()
    assert (after.displacement[~on_chair] == 0.0).all()
    # since it was last *seen*: where it rolled to ahead, not where it stood behind
    far = float(np.hypot(*(simulation.world.mover_poses()[0] - before)[:2]))
    assert 0.3 < moved[0] < 0.6 < far
    assert (moved == moved[0]).all()


def test_mixed_pixels_are_marked_at_edges_and_only_there():
    simulation, *_ = lone(laser=Lms221Config())
    put(simulation, 1.5, 1.5)
    wall = float(simulation.observe().scan.ranges[180])
    put(simulation, wall - 0.5, 0.0)  # near enough to a wall for pulses to run together
    mixed, flat = 0, 0
    for _ in range(60):
        frame = simulation.observe()
        body, marked = frame.labels.body, frame.labels.mixed
        edge = np.zeros(len(body), dtype=bool)
        for shift in range(-3, 4):
            edge |= body != np.roll(body, shift)
        mixed += int((marked & edge).sum())
        flat += int((marked & ~edge).sum())
    assert mixed > 20
    assert flat < 0.1 * mixed

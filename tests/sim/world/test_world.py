# SPDX-License-Identifier: Apache-2.0
"""The moving world: seeds, stillness, shoves, drive, saved states."""

import hashlib
import math

import mujoco
import numpy as np
import pytest

from sim.actors.chairs import Shoves, shove
from sim.actors.robot import DriveConfig
from sim.core.dynamism import Dynamism
from sim.core.seeds import Seeds
from sim.world.world import SUBSTEPS_PER_S, World
from slam import se2
from slam.errors import InvalidValueError

pytestmark = pytest.mark.slow
STILL = Dynamism.at(0)


def run(world: World, seconds: float) -> World:
    for _ in range(round(seconds * SUBSTEPS_PER_S)):
        world.substep()
    return world


def digest(world: World) -> str:
    d = world.data
    arrays = (d.qpos, d.qvel, d.xpos, d.xquat, d.mocap_pos, d.mocap_quat, world.wheel_angles())
    return hashlib.sha256(b"".join(a.tobytes() for a in arrays)).hexdigest()


def lively(seed: int | Seeds) -> World:
    world = World("office", seed=seed, dynamism=0.9)
    world.set_command(0.4, 0.15)
    return world


# -- stillness ------------------------------------------------------------------------------


@pytest.mark.parametrize("scene", ["arena", "office"])
def test_at_dynamism_zero_nothing_moves(scene):
    world = World(scene, seed=1, dynamism=0)
    poses, limbs = world.mover_poses(), world.data.mocap_pos.copy()
    run(world, 10.0)
    np.testing.assert_array_equal(world.mover_poses(), poses)
    np.testing.assert_array_equal(world.data.mocap_pos, limbs)
    assert not world.movers_moving().any()


# -- chairs ---------------------------------------------------------------------------------


def lone_chair() -> tuple[World, int, int]:
    """A world with one swivel chair in the middle, nothing else near; its qpos and dof."""
    world = World("arena", seed=1, dynamism=0, n_chairs=1)
    joint = world.model.joint("chair0/x")
    qpos, dof = int(joint.qposadr[0]), int(joint.dofadr[0])
    world.data.qpos[qpos : qpos + 3] = 0.5 * (world.scene.bounds[0] + world.scene.bounds[2]), 1.5, 0
    mujoco.mj_forward(world.model, world.data)
    return world, qpos, dof


def test_a_chair_rolls_as_far_as_friction_says_and_sleeps():
    world, qpos, dof = lone_chair()
    start, v = float(world.data.qpos[qpos]), 0.9
    world.data.qvel[dof] = v
    run(world, 4.0)
    mass = float(world.model.body("chair0/base").mass[0])
    friction = float(world.model.dof_frictionloss[dof])
    damping = float(np.ravel(world.model.dof_damping[dof])[0])
    # m dv/dt = -F - c v from v to 0
    way = mass / damping * (v - friction / damping * math.log1p(damping * v / friction))
    assert world.data.qpos[qpos] - start == pytest.approx(way, rel=0.03)
    assert world.data.qvel[dof] == 0.0
    assert not world.movers_moving().any()


@pytest.mark.parametrize("speed", [0.4, 1.2])
def test_a_shove_gives_the_speed_that_was_drawn(speed):
    world, _, dof = lone_chair()
    counters = Seeds(5).counters("chairs", 1)
    shoves = Shoves(world.model, ["chair0"], rates=(0.0, speed, speed, 0.0), counters=counters)
    shoves.schedule[0, 0] = 0.0
    fastest = 0.0
    for k in range(300):
        if k % 4 == 0:
            shove(k / 300, 4 / 300, shoves.table, world.data.qfrc_applied)
        world.substep()
        fastest = max(fastest, math.hypot(*world.data.qvel[dof : dof + 2]))
    assert 0.8 * speed < fastest < 1.05 * speed  # damping takes a little during the shove
    assert not world.data.qfrc_applied[dof : dof + 3].any()


# -- the robot ------------------------------------------------------------------------------


def empty(drive: DriveConfig | None = None) -> World:
    return World("arena", dynamism=0, n_chairs=0, drive=drive)


def test_a_straight_run_is_as_long_as_commanded():
    world = empty()
    start = world.robot_pose()
    world.set_command(0.5, 0.0)
    run(world, 2.0)
    expected = 0.5 * 2.0 - 0.5**2 / (2.0 * world.drive_config.accel)
    moved = se2.between(start, world.robot_pose())
    assert moved[0] == pytest.approx(expected, abs=0.02)
    assert abs(moved[1]) < 0.002
    assert abs(moved[2]) < 0.002
    np.testing.assert_allclose(world.wheel_angles(), expected, atol=0.01)


def test_a_circle_closes_and_the_wheels_know_it():
    world = empty()
    start = world.robot_pose()
    v, omega = 0.3, 0.6
    world.set_command(v, omega)
    run(world, 1.0)  # the ramp
    first, rolled = world.robot_pose(), world.wheel_angles()
    run(world, math.tau / omega)
    gap = se2.between(first, world.robot_pose())
    assert math.hypot(gap[0], gap[1]) < 0.03
    left, right = world.wheel_angles() - rolled
    assert 0.5 * (left + right) == pytest.approx(math.tau * v / omega, rel=0.01)
    assert (right - left) / world.drive_config.track == pytest.approx(math.tau, rel=0.01)
    assert world.robot_pose()[2] - start[2] > math.tau


def test_commands_are_clipped_and_must_be_finite():
    world = empty(DriveConfig(v_max=0.3))
    world.set_command(5.0, 0.0)
    before = world.robot_pose()
    run(world, 2.0)
    assert se2.between(before, world.robot_pose())[0] < 0.61
    with pytest.raises(InvalidValueError, match="command"):
        world.set_command(math.nan, 0.0)


def test_a_wall_stops_the_robot_and_its_wheels_slip():
    world = empty()
    world.set_command(0.8, 0.0)
    run(world, 20.0)
    assert -0.05 < world.bodies.clearance(world.data) < 0.05
    touched = world.take_contacts()
    assert touched[0].kind == "static"
    assert touched[0].hard
    assert world.wheel_angles().min() > 12.0
    assert world.take_contacts() == []


def test_the_robot_pushes_a_chair():
    world, qpos, _ = lone_chair()
    x, y, yaw = world.robot_pose()
    world.data.qpos[qpos : qpos + 2] = x + 0.9 * math.cos(yaw), y + 0.9 * math.sin(yaw)
    mujoco.mj_forward(world.model, world.data)
    world.set_command(0.5, 0.0)
    run(world, 3.0)
    assert {c.name for c in world.take_contacts()} == {"chair0"}
    assert math.hypot(*(world.data.qpos[qpos : qpos + 2] - [x, y])) > 1.2


# -- state ----------------------------------------------------------------------------------


def test_a_restored_world_goes_on_bit_for_bit():
    world = run(lively(6), 3.0)
    saved = world.save_state()
    asleep = world.data.ntree_awake < world.model.ntree
    end = digest(run(world, 3.0))
    fresh = lively(6)
    fresh.load_state(saved)
    assert asleep
    assert fresh.time_ns == 3_000_000_000
    assert fresh.save_state() == saved
    assert digest(run(fresh, 3.0)) == end


def test_saving_changes_nothing():
    plain, watched = lively(6), lively(6)
    for _ in range(10):
        run(plain, 0.3)
        run(watched, 0.3).save_state()
    assert digest(plain) == digest(watched)


def test_a_state_of_another_world_is_refused():
    office, arena = World("office", dynamism=0), World("arena", dynamism=0)
    before = digest(arena)
    with pytest.raises(InvalidValueError, match="office"):
        arena.load_state(office.save_state())
    with pytest.raises(InvalidValueError, match="no saved world"):
        arena.load_state(b"\x00" * 100)
    with pytest.raises(InvalidValueError, match="damaged"):
        arena.load_state(arena.save_state()[:-8])
    assert digest(arena) == before


# -- chairs on castors ----------------------------------------------------------------------


def test_a_chair_on_castors_rolls_as_far_as_a_planar_one_and_sleeps():
    ways = {}
    for level in ("planar", "free"):
        world = World("arena", seed=1, dynamism=0, n_chairs=1, chairs=level)
        joint = world.model.joint("chair0/x")
        qpos, dof = int(joint.qposadr[0]), int(joint.dofadr[0])
        world.data.qpos[qpos : qpos + 2] = 0.0, 1.5
        run(world, 0.5)
        world.data.qvel[dof] = 0.9
        run(world, 4.0)
        ways[level] = float(world.data.qpos[qpos])
        assert world.data.qvel[dof] == 0.0
    assert ways["free"] == pytest.approx(ways["planar"], rel=0.3)


def test_chairs_on_castors_stay_upright_and_move_as_often():
    world = run(World("arena", seed=2, dynamism=1.0, n_people=2, chairs="free"), 12.0)
    tilt = [
        world.data.qpos[int(world.model.joint(f"{m.name}/{axis}").qposadr[0])]
        for m in world.scene.movers
        if m.kind.startswith("chair")
        for axis in ("pitch", "roll")
    ]
    assert np.abs(tilt).max() < 0.2
    assert not any(w.number for w in world.data.warning)
    moved = world.mover_poses() - World("arena", seed=2, dynamism=1.0, n_people=2).mover_poses()
    assert (np.hypot(moved[:, 0], moved[:, 1]) > 0.2).sum() >= 2
    fresh = World("arena", seed=2, dynamism=1.0, n_people=2, chairs="free")
    fresh.load_state(world.save_state())
    assert digest(run(fresh, 1.0)) == digest(run(world, 1.0))


def test_an_unknown_level_is_refused():
    with pytest.raises(InvalidValueError, match="chairs must be one of planar, free"):
        World("arena", chairs="rocking")

# SPDX-License-Identifier: Apache-2.0
"""Physics from compiled code is MuJoCo's own, and many substeps at once are single ones."""

import mujoco
import numpy as np

from sim.core.engine import Engine, call, engine
from sim.core.packed import packed
from sim.world import substeps
from sim.world.world import World
from slam._jit import njit

BALLS = """
<mujoco>
  <option timestep="0.0033333333333333335" integrator="implicitfast"/>
  <worldbody>
    <geom type="plane" size="5 5 1"/>
    <body pos="0 0 .5"><freejoint/><geom size=".1"/></body>
    <body pos=".12 .03 .8"><freejoint/><geom type="box" size=".1 .05 .07"/></body>
  </worldbody>
</mujoco>
"""


@njit
def steps(n: int, room: Engine) -> None:
    for _ in range(n):
        call(room.step2, room.model, room.data)
        call(room.step1, room.model, room.data)


def test_both_halves_in_turn_are_a_step_with_fresh_poses():
    model = mujoco.MjModel.from_xml_string(BALLS)
    ours, theirs = mujoco.MjData(model), mujoco.MjData(model)
    mujoco.mj_forward(model, ours)
    mujoco.mj_forward(model, theirs)
    steps(400, engine(model, ours))
    for _ in range(400):
        mujoco.mj_step(model, theirs)
    mujoco.mj_kinematics(model, theirs)
    assert ours.ncon > 0
    for name in ("time", "qpos", "qvel", "qacc_warmstart", "geom_xpos", "geom_xmat"):
        np.testing.assert_array_equal(getattr(ours, name), getattr(theirs, name))


def test_many_substeps_at_once_are_single_ones():
    """Also where the robot runs into something."""
    worlds = [World("arena", seed=100, dynamism=0.9) for _ in range(2)]
    watch = substeps.unseen(9)
    path, travel = watch.path, watch.travel
    touched: list[list[str]] = [[], []]
    for world in worlds:
        world.set_command(1.0, 0.0)
    for _ in range(180):
        worlds[0].advance(0, 8, packed(watch))
        for k in range(8):
            worlds[1].substep()
            np.testing.assert_array_equal(path[k + 1], worlds[1].robot_pose())
            np.testing.assert_array_equal(travel[k + 1, :2], worlds[1].wheel_angles())
        for world, names in zip(worlds, touched, strict=True):
            names += [str(contact) for contact in world.take_contacts()]
    assert touched[0] == touched[1] != []
    assert worlds[0].save_state() == worlds[1].save_state()


def test_rooms_are_of_two_types_with_and_without_hands():
    """Each type is compiled for itself, for seconds: what else stands in a room must make none."""
    free = [
        World("arena", seed=1, crowd="none"),
        World("office", seed=2, dynamism=0.9, n_chairs=3, crowd="escorts:2,queue:2"),
    ]
    held = [World("arena", seed=1, crowd=crowd) for crowd in ("boards:1", "cleaners:1")]
    types = [{world._room._numba_type_ for world in worlds} for worlds in (free, held)]
    assert [len(each) for each in types] == [1, 1]
    assert types[0] != types[1]

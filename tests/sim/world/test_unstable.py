# SPDX-License-Identifier: Apache-2.0
"""Physics that fails ends a run with an error of its own, and leaves no log of MuJoCo behind."""

import math
import os

import mujoco
import pytest

from sim.core.engine import forward
from sim.simulation import Simulation
from sim.world.world import World
from slam.errors import UnstableError


def steps(world: World, n: int) -> None:
    for _ in range(n):
        world.substep()


@pytest.mark.parametrize(
    ("array", "value", "says"),
    [
        ("qvel", math.nan, r"at 0\.04 s: .*QACC.*\(joint 'chair0/x'\)"),
        ("qpos", 1e12, r"at 0\.04 s: .*QPOS.*\(joint 'chair0/yaw'\)"),
        ("ctrl", math.inf, r"at 0\.04 s: .*CTRL at ACTUATOR 2"),
    ],
)
def test_a_number_that_is_none_ends_the_world(array, value, says, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    world = World("arena", seed=1, dynamism=0.3)
    steps(world, 10)
    getattr(world.data, array)[2] = value
    with pytest.raises(UnstableError, match=f"scene 'arena' {says}"):
        steps(world, 3)
    assert os.listdir(tmp_path) == []


def test_a_scan_of_such_a_world_is_none():
    simulation = Simulation("arena", seed=1, dynamism=0.0)
    simulation.observe()
    simulation.world.data.qpos[0] = math.nan
    with pytest.raises(UnstableError, match="QPOS at DOF 0"):
        simulation.observe()


def test_too_little_memory_is_told():
    spheres = "<body><freejoint/><geom size='.2'/></body>" * 60
    model = mujoco.MjModel.from_xml_string(
        f"<mujoco><size memory='48K'/><worldbody>{spheres}</worldbody></mujoco>"
    )
    with pytest.raises(UnstableError, match=r"heap: .*out of memory"):
        forward(model, mujoco.MjData(model), "heap")

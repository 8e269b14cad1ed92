# SPDX-License-Identifier: Apache-2.0
"""A small model with a planar robot, for the sensor tests: no scene needed."""

from collections.abc import Callable
from types import SimpleNamespace

import mujoco
import numpy as np
import pytest

SCAN_HEIGHT = 0.36
ROBOT = """
<mujoco>
  <compiler angle="radian"/>
  <option timestep="0.0033333333333333335" gravity="0 0 0" integrator="implicitfast"/>
  <worldbody>
    <body name="robot/base">
      <joint name="robot/x" type="slide" axis="1 0 0"/>
      <joint name="robot/y" type="slide" axis="0 1 0"/>
      <joint name="robot/yaw" type="hinge" axis="0 0 1"/>
      <inertial pos="0 0 .2" mass="9" diaginertia=".5 .5 .5"/>
      <geom type="cylinder" size=".2 .3" pos="0 0 .3" contype="0" conaffinity="0"/>
      <site name="robot/laser" pos="0.02 0 0.36"/>
    </body>
    {world}
  </worldbody>
</mujoco>
"""


def wall(x: float, y: float, half_x: float, half_y: float, extra: str = "") -> str:
    """MJCF of an upright box 2 m high."""
    return f'<geom type="box" size="{half_x} {half_y} 1" pos="{x} {y} 1" {extra}/>'


SQUARE = "".join(
    (
        wall(4.1, 0, 0.1, 4.2),
        wall(-4.1, 0, 0.1, 4.2),
        wall(0, 4.1, 4.2, 0.1),
        wall(0, -4.1, 4.2, 0.1),
    )
)


def build(world: str = SQUARE) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """The robot among ``world``; kinematics fresh."""
    model = mujoco.MjModel.from_xml_string(ROBOT.format(world=world))
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    return model, data


def stepper(
    model: mujoco.MjModel, data: mujoco.MjData, twist: tuple[float, float, float] = (0.0, 0.0, 0.0)
) -> Callable[[], None]:
    """``advance`` that moves the robot by exact world velocities (vx, vy, omega)."""
    velocity = np.array(twist)

    def advance() -> None:
        data.qpos[:3] += velocity / 300.0
        data.time += 1.0 / 300.0
        mujoco.mj_kinematics(model, data)

    return advance


@pytest.fixture(scope="session")
def room() -> SimpleNamespace:
    """``build``, ``stepper``, ``wall`` and ``SQUARE`` of this file."""
    return SimpleNamespace(build=build, stepper=stepper, wall=wall, SQUARE=SQUARE)

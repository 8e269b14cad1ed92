# SPDX-License-Identifier: Apache-2.0
"""A test bench for the scanner: it stands still at the origin, things are put before it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import mujoco
import numpy as np
from numpy.typing import NDArray

from sim.sensors.lidar.device import LaserScanner, ScanResult
from sim.sensors.lidar.models.lms221 import Lms221Config, RangeEffects
from sim.sensors.lidar.registry import ScannerConfig

HEIGHT = 0.36
NONE = RangeEffects.none()
MATERIALS = ("wall", "paper", "rubber", "metal", "glass", "mirror", "trousers", "plastic_black")
_FRAME = """
<mujoco>
  <compiler angle="radian"/>
  <option timestep="0.0033333333333333335" gravity="0 0 0"/>
  <asset>{assets}</asset>
  <worldbody>
    <body name="robot/base"><site name="robot/laser" pos="0 0 {height}"/></body>
    {world}
  </worldbody>
</mujoco>
"""


def box(x: float, y: float, half_x: float, half_y: float, material: str = "wall") -> str:
    """MJCF of an upright box 2 m high."""
    return f'<geom type="box" size="{half_x} {half_y} 1" pos="{x} {y} 1" material="{material}"/>'


def post(x: float, y: float, radius: float, material: str = "metal") -> str:
    """MJCF of an upright cylinder 1 m high."""
    return f'<geom type="cylinder" size="{radius} .5" pos="{x} {y} .5" material="{material}"/>'


def plate(distance: float, half: float = 30.0) -> str:
    """A wall square to the beam ahead."""
    return box(distance + 0.05, 0.0, 0.05, half)


class Bench:
    """One scanner before one set of things; ``scan`` as often as wanted."""

    def __init__(self, world: str, config: ScannerConfig | None = None, seed: int = 0) -> None:
        assets = "".join(f'<material name="{name}"/>' for name in MATERIALS)
        text = _FRAME.format(assets=assets, height=HEIGHT, world=world)
        self.model = mujoco.MjModel.from_xml_string(text)
        self.data = mujoco.MjData(self.model)
        mujoco.mj_kinematics(self.model, self.data)
        self.laser = LaserScanner(self.model, config, np.random.default_rng(seed))
        self.steps = 0

    def _advance(self) -> None:
        self.steps += 1

    def scan(self) -> ScanResult:
        """One scan of a world at rest."""
        return self.laser.observe(self._advance, self.data)

    def ranges(self, scans: int) -> NDArray[np.float64]:
        """(scans, beams) values sent, m."""
        return np.array([self.scan().ranges for _ in range(scans)], dtype=np.float64)


def only(switches: Mapping[str, bool] | None = None, **settings: object) -> Lms221Config:
    """A config with no effect but the named ones; ``settings`` as for ``Lms221Config``."""
    effects = replace(NONE, **(switches or {}))
    defaults: dict[str, object] = {"noise_std_m": 0.0, "quantise": False}
    return Lms221Config(**{**defaults, **settings}, effects=effects)  # type: ignore[arg-type]

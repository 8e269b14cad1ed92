# SPDX-License-Identifier: Apache-2.0
"""What an environment tells a policy, and shows: its observation, and two pictures."""

import math
from typing import Annotated, Any

import numpy as np
from gymnasium import spaces
from msgspec import Meta
from numpy.typing import NDArray

from sim.gym.pose_source import FAR_M, PoseSource
from sim.sensors.lidar.device import ScanResult
from sim.simulation import Simulation
from slam._jit import njit
from slam.frames import LaserSpec
from slam.shaped import one_of, shaped

_MAX_TICKS = 2**40

Observation = dict[str, Any]  # arrays by name; Gymnasium types Dict spaces so


def space_of(spec: LaserSpec, *, believing: bool, polar: bool = False) -> spaces.Dict:
    """The space of what ``observed`` gives.

    ``believing``: with a ``pose_source``; ``polar``: with range and bearing of the goal.
    """
    n = spec.n_beams
    entries: dict[str, spaces.Space[Any]] = {
        "ranges": spaces.Box(0.0, np.float32(spec.range_max), (n,), np.float32),
        "valid": spaces.Box(0, 1, (n,), np.uint8),
        "encoders": spaces.Box(-_MAX_TICKS, _MAX_TICKS, (2,), np.int64),
        "time": spaces.Box(0.0, 1e9, (), np.float64),
    }
    if believing:
        most = np.array([FAR_M, FAR_M, np.pi])
        entries |= {
            "pose": spaces.Box(-most, most, (3,), np.float64),
            "trusted": spaces.Box(0, 1, (), np.uint8),
            "goal": spaces.Box(-3.0 * FAR_M, 3.0 * FAR_M, (2,), np.float64),
        }
    if polar:
        low, high = np.array([0.0, -np.pi]), np.array([5.0 * FAR_M, np.pi])
        entries["goal_polar"] = spaces.Box(low, high, (2,), np.float64)
    return spaces.Dict(entries)


def observed(
    simulation: Simulation,
    scan: ScanResult,
    source: PoseSource | None,
    goal: tuple[float, float] | None,
    *,
    polar: bool,
) -> Observation:
    """What the robot knows by the scan that was just taken; ``goal`` m in the world."""
    spec = simulation.spec
    ranges, valid = _finite(scan.ranges, spec.range_min, spec.range_max)
    entries: Observation = {
        "ranges": ranges,
        "valid": valid,
        "encoders": simulation.encoders.ticks,
        "time": np.array(simulation.world.time_ns * 1e-9),
    }
    if source is not None:
        there = np.zeros(2) if goal is None else source.towards(goal)
        entries |= {
            "pose": source.pose.copy(),
            "trusted": np.array(source.trusted, dtype=np.uint8),
            "goal": there,
        }
        if polar:
            x, y = there.tolist()
            entries["goal_polar"] = np.array([math.hypot(x, y), math.atan2(y, x)])
    return entries


@njit
def _finite(
    ranges: NDArray[np.float32], least: float, most: float
) -> tuple[NDArray[np.float32], NDArray[np.uint8]]:
    """Finite ranges, and which are measurements, as ``Scan.valid``."""
    out, valid = np.empty(ranges.size, np.float32), np.empty(ranges.size, np.uint8)
    for i in range(ranges.size):
        fits = least <= ranges[i] <= most
        valid[i] = fits
        out[i] = ranges[i] if fits else most
    return out, valid


MODES = ("rgb_array", "map")
VIEWS = ("top", "follow", "persp")  # of every scene; ``sim.view.camera`` needs OpenGL to import
_Pixels = Annotated[int, Meta(ge=1, le=8192)]  # of an edge of a picture


class Rendering:
    """What draws an environment.

    mode  "rgb_array" (3D, needs OpenGL), "map" (2D, needs nothing) or None
    view  "top", "follow" or "persp" of the former
    size  (width, height) px

    Raises ``InvalidValueError`` for anything else.
    """

    def __init__(self, mode: str | None, view: str, size: tuple[int, int]) -> None:
        if mode is not None:
            one_of("render_mode", mode, MODES)
        one_of("view", view, VIEWS)
        self._mode, self._view = mode, view
        self._size = shaped("render_size", size, tuple[_Pixels, _Pixels])
        self._picture: Any = None
        self._camera: Any = None

    def picture(self, simulation: Simulation) -> NDArray[np.uint8]:
        """(height, width, 3) uint8 RGB of the simulation that was drawn first since ``close``."""
        if self._picture is None:
            self._picture = self._of(simulation)
        picture: NDArray[np.uint8] = self._picture(simulation)
        return picture

    def _of(self, simulation: Simulation) -> Any:
        if self._mode == "map":
            from sim.view.mapview import MapView

            plan = MapView(simulation.world.scene, *self._size)
            return lambda now: plan.draw(now.world.mover_poses(), now.frame)
        from sim.view.camera import Camera

        self._camera = camera = Camera(simulation.world.model, *self._size)
        return lambda now: camera.render(now.world.data, self._view)

    def close(self) -> None:
        """Free what draws; the next picture makes it again, of whatever simulation then."""
        if self._camera is not None:
            self._camera.close()
        self._picture = self._camera = None

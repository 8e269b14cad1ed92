# SPDX-License-Identifier: Apache-2.0
"""What an environment tells a policy, and shows: its space, finite ranges, two pictures."""

from typing import Annotated, Any

import numpy as np
from gymnasium import spaces
from msgspec import Meta
from numpy.typing import NDArray

from sim.gym.pose_source import PoseSource
from sim.simulation import Simulation
from slam._jit import njit
from slam.frames import LaserSpec
from slam.shaped import one_of, shaped

_MAX_TICKS = 2**40

Observation = dict[str, Any]  # arrays by name; Gymnasium types Dict spaces so


def space_of(spec: LaserSpec, *, believing: bool, polar: bool = False) -> spaces.Dict:
    """The space of an environment's observations.

    ``believing``: with a ``pose_source``; ``polar``: with range and bearing of the goal.
    """
    n = spec.n_beams
    believed = PoseSource.space(polar=polar) if believing else {}
    return spaces.Dict(
        {
            "ranges": spaces.Box(0.0, np.float32(spec.range_max), (n,), np.float32),
            "valid": spaces.Box(0, 1, (n,), np.uint8),
            "encoders": spaces.Box(-_MAX_TICKS, _MAX_TICKS, (2,), np.int64),
            "time": spaces.Box(0.0, 1e9, (), np.float64),
            **believed,
        }
    )


@njit
def observed(
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

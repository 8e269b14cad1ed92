# SPDX-License-Identifier: Apache-2.0
"""Pictures of a running simulation, by a camera (3D, needs OpenGL) or as a plan (needs nothing)."""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

from sim.simulation import Simulation
from sim.view.camera import Camera
from sim.view.mapview import MapView

VIEWS = ("top", "follow", "persp")


class CameraPicture:
    """What one of the scene's cameras sees now: call it with the simulation.

    Raises ``MissingDependencyError`` where no OpenGL is to be had.
    """

    def __init__(
        self,
        simulation: Simulation,
        size: tuple[int, int],
        view: str = "top",
        *,
        shadows: bool = True,
    ) -> None:
        self._view = view
        self._camera = Camera(simulation.world.model, *size, shadows=shadows)

    def __call__(self, simulation: Simulation) -> NDArray[np.uint8]:
        """(height, width, 3) uint8 RGB."""
        data = simulation.world.data
        mujoco.mj_camlight(simulation.world.model, data)
        return self._camera.render(data, self._view)

    def close(self) -> None:
        """Free the OpenGL context."""
        self._camera.close()

    def __enter__(self) -> CameraPicture:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class MapPicture:
    """The room from above with the last scan, drawn without OpenGL: call it with the simulation."""

    def __init__(self, simulation: Simulation, size: tuple[int, int]) -> None:
        self._view = MapView(simulation.world.scene, *size)

    def __call__(self, simulation: Simulation) -> NDArray[np.uint8]:
        """(height, width, 3) uint8 RGB."""
        return self._view.draw(simulation.world.mover_poses(), simulation.frame)

    def close(self) -> None:
        """Nothing to free; every picture maker has it."""

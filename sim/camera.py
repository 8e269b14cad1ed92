# SPDX-License-Identifier: Apache-2.0
"""Pictures of a world in 3-D, from its cameras "top", "follow" and "persp".

    with Camera(model, 640, 480) as camera:
        frame = camera.render(data, "follow")      # (480, 640, 3) uint8

Made of MuJoCo's classic renderer calls, on a GL context of the library that ``sim.gl`` found, so
that it works whatever ``MUJOCO_GL`` was when mujoco was imported. A camera belongs to the thread
that made it.
"""

from __future__ import annotations

import importlib
from types import TracebackType
from typing import Any, Self

import mujoco
import numpy as np
from numpy.typing import NDArray

from sim import gl
from slam.errors import InvalidValueError, MissingDependencyError

PAINT_GROUP = 5  # shadows painted under things
HIDDEN_GROUPS = (3, 4)  # collision hulls, marks
MAX_GEOMS = 20_000
MAX_SIZE = 4096
SMALL = 480  # px; up to this height, fewer facets do (a third of the cost)


class Camera:
    """A picture maker for one model; close it, or use ``with``.

    width, height  px
    shadows        of the sun; the greater part of the cost on a CPU
    samples        per pixel against jagged edges, 0 for none

    Raises ``InvalidValueError`` for a size that cannot be, ``MissingDependencyError`` without GL.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        width: int,
        height: int,
        *,
        shadows: bool = True,
        samples: int = 4,
    ) -> None:
        for field, value in (("width", width), ("height", height)):
            if not 1 <= value <= MAX_SIZE:
                raise InvalidValueError(f"{field} must lie in 1..{MAX_SIZE} px, got {value}")
        found = gl.find()
        if found.backend is None:
            raise MissingDependencyError(f"no 3-D pictures: {found.reason}")
        self.width, self.height = width, height
        self._model = model
        self._context: Any = None
        self._gl = importlib.import_module(f"mujoco.{found.backend}").GLContext(width, height)
        self._gl.make_current()
        self._context = _make_context(model, width, height, shadows, samples)
        self._rect = mujoco.MjrRect(0, 0, width, height)
        self._scene = mujoco.MjvScene(model, maxgeom=MAX_GEOMS)
        self._scene.flags[mujoco.mjtRndFlag.mjRND_SHADOW] = shadows
        self._scene.flags[mujoco.mjtRndFlag.mjRND_REFLECTION] = False
        self._option = mujoco.MjvOption()
        for group in HIDDEN_GROUPS:
            self._option.geomgroup[group] = 0
            self._option.sitegroup[group] = 0
        self._option.geomgroup[PAINT_GROUP] = 1
        self._view = mujoco.MjvCamera()

    def render(self, data: mujoco.MjData, camera: str = "persp") -> NDArray[np.uint8]:
        """A fresh (height, width, 3) RGB picture of ``data``, whose kinematics must be up to date.

        Raises ``InvalidValueError`` for a camera the model does not have.
        """
        if self._context is None:
            raise InvalidValueError("this Camera is closed")
        number = mujoco.mj_name2id(self._model, mujoco.mjtObj.mjOBJ_CAMERA, camera)
        if number < 0:
            known = [self._model.camera(i).name for i in range(self._model.ncam)]
            raise InvalidValueError(f"camera must be one of {', '.join(known)}, got '{camera}'")
        self._view.type = mujoco.mjtCamera.mjCAMERA_FIXED
        self._view.fixedcamid = number
        everything = mujoco.mjtCatBit.mjCAT_ALL
        mujoco.mjv_updateScene(
            self._model, data, self._option, None, self._view, everything, self._scene
        )
        self._gl.make_current()
        picture = np.empty((self.height, self.width, 3), dtype=np.uint8)
        mujoco.mjr_render(self._rect, self._scene, self._context)
        mujoco.mjr_readPixels(picture, None, self._rect, self._context)
        return np.ascontiguousarray(picture[::-1])  # GL's first row is the lowest

    def close(self) -> None:
        """Give the GL context back; a second call does nothing."""
        if self._gl is None:
            return
        self._gl.make_current()
        if self._context is not None:
            self._context.free()
        self._gl.free()
        self._gl = self._context = None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()


def _make_context(
    model: mujoco.MjModel, width: int, height: int, shadows: bool, samples: int
) -> mujoco.MjrContext:
    """A render context with these qualities; the model is as before afterwards."""
    changed: list[tuple[Any, str, int]] = [
        (model.vis.global_, "offwidth", width),
        (model.vis.global_, "offheight", height),
        (model.vis.quality, "offsamples", samples),
    ]
    if not shadows:
        changed.append((model.vis.quality, "shadowsize", 0))
    if height <= SMALL:
        changed += [(model.vis.quality, "numslices", 8), (model.vis.quality, "numstacks", 5)]
    before = [(owner, field, getattr(owner, field)) for owner, field, _ in changed]
    for owner, field, value in changed:
        setattr(owner, field, value)
    try:
        context = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_100.value)
    finally:
        for owner, field, value in before:
            setattr(owner, field, value)
    mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN.value, context)
    return context

# SPDX-License-Identifier: Apache-2.0
"""Pictures of a world in 3-D, from its cameras "top", "follow" and "persp".

    with Camera(model, 640, 480) as camera:
        frame = camera.render(data, "follow")      # (480, 640, 3) uint8

Made of MuJoCo's classic renderer calls, on a GL context of the library that ``sim.view.gl`` found,
so that it works whatever ``MUJOCO_GL`` was when mujoco was imported. A camera belongs to the thread
that made it. People between a camera that rides on the robot and the robot are drawn as glass.
"""

import copy
import importlib
from typing import Any, Self

import cv2
import mujoco
import numpy as np
from numpy.typing import NDArray

from sim.view import gl
from slam.errors import InvalidValueError, MissingDependencyError
from slam.shaped import Number, Positive, shaped, whole

PAINT_GROUP = 5  # shadows painted under things
HIDDEN_GROUPS = (3, 4)  # collision hulls, marks
MAX_GEOMS = 20_000
MAX_SIZE = 4096
SMALL = 480  # px; up to this height, fewer facets do (a third of the cost)
PEOPLE_GROUP = 2
SHADOW_M = 0.25  # radius; smaller things throw no shadow, but for those that make up people
GLASS = 0.15  # opacity of people in the way of a camera
BESIDE_M = 0.5  # from its line of sight, seen from above; a person is 0.25 m to each side
BEHIND_M = 0.4  # from the camera back: a head there still fills the picture
PERSON_M = 0.6  # from a torso's middle to the farthest part of a limb, seen from above
_NO_COLOUR = np.array([0.5, 0.5, 0.5, 1.0], np.float32)  # MuJoCo's default: the material's counts
LOOK_AT_M = 0.7  # height of the middle of a close-up
EDGE = 24  # grey levels between neighbours that make an edge
_CROSS = cv2.getStructuringElement(cv2.MORPH_CROSS, (3, 3))


class Camera:
    """A picture maker for one model; close it, or use ``with``.

    width, height  px
    shadows        of the sun; half the cost on a CPU
    samples        per pixel against jagged edges, at up to three times the cost; with 0 edges are
                   softened afterwards

    Raises ``InvalidValueError`` for a size that cannot be, ``MissingDependencyError`` without GL.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        width: int,
        height: int,
        *,
        shadows: bool = True,
        samples: int = 0,
    ) -> None:
        for field, value in (("width", width), ("height", height)):
            whole(field, value, 1, MAX_SIZE)
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
        self._soft = samples == 0
        small = (model.geom_rbound > 0.0) & (model.geom_rbound < SHADOW_M)
        self._shadeless = small & (model.geom_group != PEOPLE_GROUP)
        self._people = np.flatnonzero(model.geom_group == PEOPLE_GROUP)
        roots = np.unique(model.body_rootid[model.geom_bodyid[self._people]])
        self._torsos = roots[model.body_mocapid[roots] < 0]  # limbs are mocap bodies of their own

    def render(self, data: mujoco.MjData, camera: str = "persp") -> NDArray[np.uint8]:
        """A fresh (height, width, 3) RGB picture of ``data``, whose kinematics must be up to date.

        Raises ``InvalidValueError`` for a camera the model does not have.
        """
        number = mujoco.mj_name2id(self._model, mujoco.mjtObj.mjOBJ_CAMERA, camera)
        if number < 0:
            known = [self._model.camera(i).name for i in range(self._model.ncam)]
            raise InvalidValueError(f"camera must be one of {', '.join(known)}, got '{camera}'")
        self._view.type, self._view.fixedcamid = mujoco.mjtCamera.mjCAMERA_FIXED, number
        return self._picture(data)

    def close_up(
        self,
        data: mujoco.MjData,
        at: tuple[float, float],
        *,
        far_m: float = 5.0,
        azimuth_deg: float = 60.0,
        down_deg: float = 35.0,
    ) -> NDArray[np.uint8]:
        """The same of what stands about (x, y) m, seen from ``far_m`` away.

        azimuth_deg  where it looks to, from the x axis on    down_deg  how steeply

        Raises ``InvalidValueError`` for what is no finite number, and for a ``far_m`` not above 0.
        """
        shaped("at", at, tuple[Number, Number])
        shaped("far_m", far_m, Positive)
        for field, value in (("azimuth_deg", azimuth_deg), ("down_deg", down_deg)):
            shaped(field, value, Number)
        self._view.type = mujoco.mjtCamera.mjCAMERA_FREE
        self._view.lookat[:] = (*at, LOOK_AT_M)
        self._view.distance, self._view.azimuth = far_m, azimuth_deg
        self._view.elevation = -down_deg
        return self._picture(data)

    def _picture(self, data: mujoco.MjData) -> NDArray[np.uint8]:
        if self._context is None:
            raise InvalidValueError("this Camera is closed")
        mujoco.mj_camlight(self._model, data)
        self._update(data)
        self._gl.make_current()
        picture = np.empty((self.height, self.width, 3), dtype=np.uint8)
        mujoco.mjr_render(self._rect, self._scene, self._context)
        mujoco.mjr_readPixels(picture, None, self._rect, self._context)
        upright = np.ascontiguousarray(picture[::-1])  # GL's first row is the lowest
        return soften(upright) if self._soft else upright

    def _update(self, data: mujoco.MjData) -> None:
        """Fill the scene; the model is as before afterwards."""
        model, before = self._model, self._model.geom_castshadow.copy()
        colours = model.geom_rgba.copy()
        model.geom_castshadow[self._shadeless] = 0
        glass = self._in_the_way(data)
        model.geom_rgba[glass] = self._colours(glass) * (1.0, 1.0, 1.0, GLASS)
        everything = mujoco.mjtCatBit.mjCAT_ALL
        try:
            mujoco.mjv_updateScene(
                model, data, self._option, None, self._view, everything, self._scene
            )
        finally:
            model.geom_castshadow[:] = before
            model.geom_rgba[:] = colours

    def _in_the_way(self, data: mujoco.MjData) -> NDArray[np.int64]:
        """Geoms of people between the camera and the body that it rides on; none for others."""
        number = self._view.fixedcamid
        fixed = self._view.type == mujoco.mjtCamera.mjCAMERA_FIXED
        body = self._model.cam_bodyid[number] if fixed else 0
        if body == 0 or not len(self._torsos):
            return np.zeros(0, np.int64)
        eye, torsos = data.cam_xpos[number, :2], data.xpos[self._torsos, :2]
        way = data.xpos[body, :2] - eye
        far = float(np.hypot(*way))
        if far < BEHIND_M:  # from above
            return np.zeros(0, np.int64)
        along = (torsos - eye) @ (way / far)
        aside = np.abs((torsos - eye) @ (np.array([-way[1], way[0]]) / far))
        between = (along > -BEHIND_M) & (along < far) & (aside < BESIDE_M)
        parts = data.geom_xpos[self._people, None, :2] - torsos[between]
        near = (np.hypot(parts[..., 0], parts[..., 1]) < PERSON_M).any(axis=1)
        found: NDArray[np.int64] = self._people[near]
        return found

    def _colours(self, geoms: NDArray[np.int64]) -> NDArray[np.float32]:
        """(n, 4) of geoms: their own, else their material's."""
        model = self._model
        material = model.geom_matid[geoms]
        colours: NDArray[np.float32] = model.geom_rgba[geoms]
        of_material = (colours == _NO_COLOUR).all(axis=1) & (material >= 0)
        colours[of_material] = model.mat_rgba[material[of_material]]
        return colours

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

    def __exit__(self, *_: object) -> None:
        self.close()


def soften(picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """The picture with its edges, and only these, a little blurred; (h, w, 3) in and out."""
    grey = cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY)
    edge = cv2.morphologyEx(grey, cv2.MORPH_GRADIENT, _CROSS) > EDGE
    blurred = cv2.GaussianBlur(picture, (3, 3), 0.6)
    cv2.copyTo(blurred, edge.view(np.uint8), picture)
    return picture


def _make_context(
    model: mujoco.MjModel, width: int, height: int, shadows: bool, samples: int
) -> mujoco.MjrContext:
    """A render context with these qualities."""
    made_of = copy.copy(model)
    looks, quality = made_of.vis.global_, made_of.vis.quality
    looks.offwidth, looks.offheight, quality.offsamples = width, height, samples
    if not shadows:
        quality.shadowsize = 0
    if height <= SMALL:
        quality.numslices, quality.numstacks = 8, 5
    context = mujoco.MjrContext(made_of, mujoco.mjtFontScale.mjFONTSCALE_100.value)
    mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN.value, context)
    _sample_one_level(model, context)
    return context


def _sample_one_level(model: mujoco.MjModel, context: mujoco.MjrContext) -> None:
    """Textures from the nearest of their levels, not blended from two: a tenth of the cost."""
    GL: Any = importlib.import_module("OpenGL.GL")  # has no type hints
    for k in range(model.ntex):
        if model.tex_type[k] == mujoco.mjtTexture.mjTEXTURE_2D:
            GL.glBindTexture(GL.GL_TEXTURE_2D, int(context.texture[k]))
            GL.glTexParameteri(
                GL.GL_TEXTURE_2D, GL.GL_TEXTURE_MIN_FILTER, GL.GL_LINEAR_MIPMAP_NEAREST
            )

# SPDX-License-Identifier: Apache-2.0
"""Scenes for tests, built once, and what is asked of more than one of them."""

import math
from functools import cache, lru_cache

import cv2
import mujoco
import numpy as np

import scenes
from scenes.placement import gap_to_boxes
from scenes.scene import Scene

NAMES = tuple(scenes.names())
ROBOT_RADIUS = 0.3
DEG = math.pi / 180.0


@lru_cache(maxsize=len(NAMES))  # a scene holds some 30 MB
def built(name: str, seed: int) -> Scene:
    """Of the other seeds few are asked for twice."""
    return scenes.build(name, seed)


@cache
def model_of(name: str) -> mujoco.MjModel:
    return built(name, 0).compile()


def placed(scene: Scene) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """As it starts, its forces and contacts computed."""
    model = scene.compile()
    data = mujoco.MjData(model)
    scene.place(model, data)
    mujoco.mj_forward(model, data)
    return model, data


def in_view(model: mujoco.MjModel, camera: str, bounds: tuple[float, ...]) -> bool:
    """Whether a 16:9 picture shows the whole floor."""
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    number = model.camera(camera).id
    axes, high = data.cam_xmat[number].reshape(3, 3), math.tan(0.5 * model.cam_fovy[number] * DEG)
    corners = [[x, y, 0.0] for x in bounds[::2] for y in bounds[1::2]]
    right, up, back = ((np.array(corners) - data.cam_xpos[number]) @ axes).T
    return bool((back < 0).all() and (abs(up / back) <= high * 1.001).all()) and bool(
        (abs(right / back) <= high * 16 / 9 * 1.001).all()
    )


def model_bytes(scene: Scene) -> bytes:
    """The compiled model as MuJoCo would save it."""
    model = scene.compile()
    buffer = np.zeros(mujoco.mj_sizeModel(model), dtype=np.uint8)
    mujoco.mj_saveModel(model, None, buffer)
    return buffer.tobytes()


def reached(scene: Scene) -> set[str]:
    """Goals in the same free region as the start for a disc of the robot's size."""
    xmin, ymin, xmax, ymax = scene.bounds
    step = 0.05
    x, y = np.meshgrid(np.arange(xmin, xmax, step), np.arange(ymin, ymax, step))
    points = np.stack([x.ravel(), y.ravel()], axis=1)
    gaps = gap_to_boxes(points, scene.obstacles).reshape(x.shape)
    _, labels = cv2.connectedComponents((gaps > ROBOT_RADIUS).astype(np.uint8))

    def label(px: float, py: float) -> int:
        return int(labels[round((py - ymin) / step), round((px - xmin) / step)])

    home = label(*scene.start[:2])
    assert home != 0
    return {goal for goal, place in scene.goals.items() if label(*place) == home}

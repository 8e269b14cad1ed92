# SPDX-License-Identifier: Apache-2.0
"""The part of the map picture that never changes: floors, walls and furniture, painted once.

Every static geom of the model is projected straight down and filled from the lowest to the highest,
in a paler version of its own colour, over a soft shadow.
"""

from __future__ import annotations

import math

import cv2
import mujoco
import numpy as np
from numpy.typing import NDArray

from scenes.footprint import static_geoms
from scenes.scene import Scene
from sim.view import icons

Float = NDArray[np.float64]
GEOM = mujoco.mjtGeom

PAPER = (247, 246, 243)
FLOORS = {
    "planks": (238, 226, 206),
    "carpet": (222, 228, 235),
    "felt": (224, 229, 222),
    "vinyl": (234, 234, 231),
    "rug": (226, 200, 178),
    "concrete": (228, 228, 225),
    "lino": (230, 230, 214),
    "tiles": (214, 227, 231),
    "mat": (190, 192, 196),
    "line": (236, 204, 96),
}
WALL = (66, 73, 88)
PALE = 0.42  # share of white in the colour of furniture
MARGIN_M = 0.3
BAR_PX = 140  # longest scale bar
FOOT_PX = 28  # row of the scale bar below the room
LEAST_PX = 160  # a picture that is lower has no such row, and no bar
SHIFT = 4  # fractional bits of pixel coordinates given to OpenCV
PAD = 8  # px around what is written
FONT = cv2.FONT_HERSHEY_SIMPLEX


class FloorPlan:
    """``picture`` (height, width, 3) RGB, ``scale`` px per metre, and ``to_pixels``."""

    def __init__(self, scene: Scene, width: int, height: int) -> None:
        xmin, ymin, xmax, ymax = scene.bounds
        wide, high = xmax - xmin + 2 * MARGIN_M, ymax - ymin + 2 * MARGIN_M
        self._foot = FOOT_PX if height >= LEAST_PX else 0
        self.scale = min(width / wide, (height - self._foot) / high)
        self._centre = np.array([0.5 * (xmin + xmax), 0.5 * (ymin + ymax)])
        self._middle = np.array([0.5 * width, 0.5 * (height - self._foot)])
        self.picture = self._paint(scene, width, height)
        self.picture.setflags(write=False)

    def to_pixels(self, points: Float) -> Float:
        """(n, 2) px (column, row), fractional, of points (n, 2) m."""
        offset = (points - self._centre) * self.scale
        offset[:, 1] *= -1.0
        pixels: Float = self._middle + offset - 0.5  # pixel centres are at whole numbers
        return pixels

    def _paint(self, scene: Scene, width: int, height: int) -> NDArray[np.uint8]:
        model = scene.compile()
        data = mujoco.MjData(model)
        mujoco.mj_kinematics(model, data)
        picture = np.full((height, width, 3), PAPER, dtype=np.uint8)
        shadow = np.zeros((height, width), dtype=np.uint8)
        shapes = sorted(_shapes(model, data), key=lambda shape: shape[0])
        for top, outline, colour in shapes:
            pixels = fixed(self.to_pixels(outline))
            if top < 0.02:
                cv2.fillPoly(picture, [pixels], colour, cv2.LINE_AA, SHIFT)
            else:
                cv2.fillPoly(shadow, [pixels], 255, cv2.LINE_AA, SHIFT)
        self._cast(picture, shadow)
        for top, outline, colour in shapes:
            if top < 0.02:
                continue
            pixels = fixed(self.to_pixels(outline))
            cv2.fillPoly(picture, [pixels], colour, cv2.LINE_AA, SHIFT)
            if colour != WALL:
                rim = tuple(round(0.72 * c) for c in colour)
                cv2.polylines(picture, [pixels], True, rim, 1, cv2.LINE_AA, SHIFT)
        if self._foot:
            self._draw_scale(picture)
        return picture

    def _cast(self, picture: NDArray[np.uint8], shadow: NDArray[np.uint8]) -> None:
        """Darken the floor around what stands on it."""
        sigma = max(1.0, 0.09 * self.scale)
        soft = cv2.GaussianBlur(shadow, (0, 0), sigma)
        drop = round(0.05 * self.scale)
        soft = np.roll(soft, (drop, drop), axis=(0, 1)).astype(np.float32) / 255.0
        picture[:] = (picture * (1.0 - 0.28 * soft[..., None])).astype(np.uint8)

    def _draw_scale(self, picture: NDArray[np.uint8]) -> None:
        length = max((m for m in (1, 2, 5, 10, 20) if m * self.scale <= BAR_PX), default=1)
        height = picture.shape[0]
        label, bar = f"{length} m", round(length * self.scale)
        x, y = 2 * PAD, height - self._foot // 2
        ends = [((x, y), (x + bar, y))]
        ends += [((x + tick, y - 4), (x + tick, y + 4)) for tick in (0, bar)]
        for start, end in ends:
            cv2.line(picture, start, end, icons.INK, 2, cv2.LINE_AA)
        write(picture, label, x + bar + PAD, y)


def fixed(pixels: Float) -> NDArray[np.int32]:
    """Pixel coordinates as OpenCV's fixed point."""
    return np.round(pixels * (1 << SHIFT)).astype(np.int32)


def text_width(words: str, height: int) -> int:
    """Width in px of ``words`` in a picture of that height."""
    (width, _), _ = cv2.getTextSize(words, FONT, _text_size(height), 1)
    return int(width)


def write(picture: NDArray[np.uint8], words: str, x: int, y: int) -> None:
    """``words`` from column x on, their middle at row y."""
    size = _text_size(picture.shape[0])
    (_, high), _ = cv2.getTextSize(words, FONT, size, 1)
    cv2.putText(picture, words, (x, y + high // 2), FONT, size, icons.INK, 1, cv2.LINE_AA)


def panel(picture: NDArray[np.uint8], x: int, y: int, width: int, height: int) -> None:
    """A paler rectangle to write on."""
    window = picture[max(y, 0) : y + height, max(x, 0) : x + width]
    window[:] = (0.2 * window + 0.8 * np.array(PAPER)).astype(np.uint8)


def _text_size(height: int) -> float:
    return max(0.35, height / 1500)


def _shapes(
    model: mujoco.MjModel, data: mujoco.MjData
) -> list[tuple[float, Float, tuple[int, int, int]]]:
    """(top m, convex outline (k, 2) m, RGB) of each static geom seen from above."""
    shapes = []
    for geom in static_geoms(model):
        material = model.mat(model.geom_matid[geom]).name if model.geom_matid[geom] >= 0 else ""
        if material in ("ground", "contact_shadow", "contact_shade"):
            continue
        corners = (
            data.geom_xpos[geom] + _corners(model, int(geom)) @ data.geom_xmat[geom].reshape(3, 3).T
        )
        outline = cv2.convexHull(corners[:, :2].astype(np.float32))[:, 0].astype(np.float64)
        shapes.append((float(corners[:, 2].max()), outline, _colour(model, int(geom), material)))
    return shapes


def _corners(model: mujoco.MjModel, geom: int) -> Float:
    """(k, 3) m points of the geom's own frame whose hull is (nearly) the geom."""
    kind, (a, b, c) = int(model.geom_type[geom]), model.geom_size[geom].tolist()
    if kind == GEOM.mjGEOM_PLANE:
        c = 0.0
    elif kind == GEOM.mjGEOM_SPHERE:
        b = c = a
    elif kind in (GEOM.mjGEOM_CAPSULE, GEOM.mjGEOM_CYLINDER):
        turns = np.linspace(0, math.tau, 16 if kind == GEOM.mjGEOM_CAPSULE else 32)
        ring = [(a * math.cos(t), a * math.sin(t)) for t in turns]
        return np.array([(x, y, z) for x, y in ring for z in (-b, b)])
    if kind in (GEOM.mjGEOM_SPHERE, GEOM.mjGEOM_ELLIPSOID):
        tilts, turns = np.linspace(0, math.pi, 9), np.linspace(0, math.tau, 16)
        return np.array(
            [
                (a * math.sin(u) * math.cos(t), b * math.sin(u) * math.sin(t), c * math.cos(u))
                for u in tilts.tolist()
                for t in turns.tolist()
            ]
        )
    return np.array([(x, y, z) for x in (-a, a) for y in (-b, b) for z in (-c, c)])


def _colour(model: mujoco.MjModel, geom: int, material: str) -> tuple[int, int, int]:
    surface, _, variant = material.partition("_")
    if surface == "floor":
        return FLOORS.get(variant.partition("_")[0], PAPER)
    if surface == "wall" and not variant.startswith("board"):
        return WALL
    rgb = model.mat_rgba[model.geom_matid[geom], :3] if material else model.geom_rgba[geom, :3]
    red, green, blue = (round(255 * (PALE + (1.0 - PALE) * float(c))) for c in rgb)
    return red, green, blue

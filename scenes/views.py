# SPDX-License-Identifier: Apache-2.0
"""Cameras for a plan that brings none of its own: one from above, one across."""

from __future__ import annotations

import math
from itertools import product

import mujoco

Bounds = tuple[float, float, float, float]

ASPECT = 16 / 9
HEIGHT = 1.1  # m, of what is to be in the picture
RIM_M = 0.35  # m of ground shown around the floor, outer walls included
PITCH_DEG, FOV_DEG = 56.0, 36.0
MARGIN = 1.01
ROUNDS = 40  # of moving the camera; each halves the error at least


def add_cameras(spec: mujoco.MjSpec, bounds: Bounds) -> None:
    """Add "top" and "persp" if they are missing, so that a 16:9 picture shows all of ``bounds``."""
    known = {camera.name for camera in spec.cameras}
    xmin, ymin, xmax, ymax = bounds
    if "top" not in known:
        wide, high = xmax - xmin + 2 * RIM_M, ymax - ymin + 2 * RIM_M
        camera = spec.worldbody.add_camera(
            name="top", pos=[0.5 * (xmin + xmax), 0.5 * (ymin + ymax), 14.0]
        )
        camera.proj = mujoco.mjtProjection.mjPROJ_ORTHOGRAPHIC
        camera.fovy = max(high, wide / ASPECT)
    if "persp" not in known:
        pitch = math.radians(PITCH_DEG)
        camera = spec.worldbody.add_camera(name="persp", pos=_stand_back(bounds), fovy=FOV_DEG)
        half = 0.5 * (0.5 * math.pi - pitch)  # the camera looks along its -z: level is a quarter up
        camera.quat = [math.cos(half), math.sin(half), 0.0, 0.0]


def _stand_back(bounds: Bounds) -> list[float]:
    """Where a camera that looks north and down by the pitch sees all corners, none closer."""
    xmin, ymin, xmax, ymax = bounds
    xmin, ymin, xmax, ymax = xmin - RIM_M, ymin - RIM_M, xmax + RIM_M, ymax + RIM_M
    corners = list(product((xmin, xmax), (ymin, ymax), (0.0, HEIGHT)))
    cos, sin = math.cos(math.radians(PITCH_DEG)), math.sin(math.radians(PITCH_DEG))
    reach = math.tan(math.radians(0.5 * FOV_DEG)) / MARGIN
    x, y = 0.5 * (xmin + xmax), 0.5 * (ymin + ymax)  # what it looks at on the floor
    distance = xmax - xmin + ymax - ymin
    for _ in range(ROUNDS):
        seen = []
        for cx, cy, cz in corners:
            depth = distance + (cy - y) * cos - cz * sin
            seen.append(((cx - x) / depth, ((cy - y) * sin + cz * cos) / depth))
        low, high = min(v for _, v in seen), max(v for _, v in seen)
        width = max(abs(u) for u, _ in seen)
        y += 0.5 * (low + high) * distance / sin
        distance *= 0.5 + 0.5 * max(width / (reach * ASPECT), 0.5 * (high - low) / reach)
    return [x, y - distance * cos, distance * sin]

# SPDX-License-Identifier: Apache-2.0
"""The true map: what never moves, cut at the scan plane."""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

from scenes.scene import SCAN_HEIGHT
from slam.system import Raster

GEOM = mujoco.mjtGeom
HULL_GROUP = 3
RESOLUTION_M = 0.02
MARGIN_M = 0.3  # beyond the floor, so that the outer walls are on the map


def static_geoms(model: mujoco.MjModel) -> NDArray[np.int64]:
    """Ids of visible geoms that can never move, floors included."""
    body = model.geom_bodyid
    fixed = (model.body_weldid[body] == 0) & (model.body_mocapid[body] < 0)
    return np.flatnonzero(fixed & (model.geom_group != HULL_GROUP))


def static_raster(
    model: mujoco.MjModel, bounds: tuple[float, float, float, float], height: float = SCAN_HEIGHT
) -> Raster:
    """1 where the plane z = height lies in a static geom, else 0; cell centres decide."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    xmin, ymin = bounds[0] - MARGIN_M, bounds[1] - MARGIN_M
    n_x = round((bounds[2] + MARGIN_M - xmin) / RESOLUTION_M)
    n_y = round((bounds[3] + MARGIN_M - ymin) / RESOLUTION_M)
    values = np.zeros((n_y, n_x), dtype=np.float32)
    for geom in static_geoms(model):
        centre, reach = data.geom_xpos[geom], model.geom_rbound[geom]
        if (
            reach == 0.0 or abs(centre[2] - height) > reach
        ):  # planes have no bound, floors no height
            continue
        low = np.floor((centre[:2] - reach - (xmin, ymin)) / RESOLUTION_M).astype(int)
        high = np.ceil((centre[:2] + reach - (xmin, ymin)) / RESOLUTION_M).astype(int)
        rows = slice(max(low[1], 0), min(high[1], n_y))
        columns = slice(max(low[0], 0), min(high[0], n_x))
        y, x = np.mgrid[rows, columns]
        offset = np.stack(
            [
                xmin + (x + 0.5) * RESOLUTION_M - centre[0],
                ymin + (y + 0.5) * RESOLUTION_M - centre[1],
                np.full(x.shape, height - centre[2]),
            ],
            axis=-1,
        )
        # np.einsum without optimize is a plain loop: no BLAS, the same bits on every CPU
        local = np.einsum("yxj,jk->yxk", offset, data.geom_xmat[geom].reshape(3, 3))
        inside = _inside(int(model.geom_type[geom]), model.geom_size[geom], local)
        values[rows, columns][inside] = 1.0
    return Raster(
        values=values, resolution_m=RESOLUTION_M, T_map_origin=np.array([xmin, ymin, 0.0])
    )


def _inside(kind: int, size: NDArray[np.float64], local: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Which points (..., 3), in the geom's frame, lie in the primitive."""
    x, y, z = local[..., 0], local[..., 1], local[..., 2]
    inside: NDArray[np.bool_]
    if kind == GEOM.mjGEOM_BOX:
        inside = (abs(x) <= size[0]) & (abs(y) <= size[1]) & (abs(z) <= size[2])
    elif kind == GEOM.mjGEOM_CYLINDER:
        inside = (x * x + y * y <= size[0] ** 2) & (abs(z) <= size[1])
    elif kind == GEOM.mjGEOM_CAPSULE:
        beyond = np.maximum(abs(z) - size[1], 0.0)
        inside = x * x + y * y + beyond * beyond <= size[0] ** 2
    elif kind == GEOM.mjGEOM_SPHERE:
        inside = x * x + y * y + z * z <= size[0] ** 2
    elif kind == GEOM.mjGEOM_ELLIPSOID:
        inside = (x / size[0]) ** 2 + (y / size[1]) ** 2 + (z / size[2]) ** 2 <= 1.0
    else:
        raise ValueError(f"geom type {kind} has no place at the scan plane; use primitives")
    return inside

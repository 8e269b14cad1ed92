# SPDX-License-Identifier: Apache-2.0
"""The true map: what never moves, cut at the scan plane."""

from functools import lru_cache

import mujoco
import numpy as np
from numpy.typing import NDArray

from slam.errors import InvalidValueError
from slam.frames import Float
from slam.system import Raster

GEOM = mujoco.mjtGeom
HULL_GROUP = 3
RESOLUTION_M = 0.02
MAX_CELLS = 1 << 20  # that are looked at at once
MARGIN_M = 0.3  # beyond the floor, so that the outer walls are on the map


_data = lru_cache(maxsize=1)(mujoco.MjData)  # a room asks several times; each takes 0.4 ms


def at_rest(model: mujoco.MjModel) -> mujoco.MjData:
    """Where everything is before anything is placed; only to read, before the next call."""
    data: mujoco.MjData = _data(model)
    mujoco.mj_kinematics(model, data)
    return data


def static_geoms(model: mujoco.MjModel) -> NDArray[np.int64]:
    """Ids of visible geoms that can never move, floors included."""
    body = model.geom_bodyid
    fixed = (model.body_weldid[body] == 0) & (model.body_mocapid[body] < 0)
    return np.flatnonzero(fixed & (model.geom_group != HULL_GROUP))


def static_raster(
    model: mujoco.MjModel, bounds: tuple[float, float, float, float], height: float
) -> Raster:
    """1 where the plane z = height m lies in a static geom, else 0; cell centres decide.

    Raises ``InvalidValueError`` for a geom at that height that is no primitive.
    """
    data = at_rest(model)
    xmin, ymin = bounds[0] - MARGIN_M, bounds[1] - MARGIN_M
    n_x = round((bounds[2] + MARGIN_M - xmin) / RESOLUTION_M)
    n_y = round((bounds[3] + MARGIN_M - ymin) / RESOLUTION_M)
    values = np.zeros((n_y, n_x), dtype=np.float32)
    origin = np.array([xmin, ymin])
    for geom in static_geoms(model):
        turn = data.geom_xmat[geom].reshape(3, 3)
        centre = data.geom_xpos[geom] + (turn * model.geom_aabb[geom, :3]).sum(axis=1)
        half = (np.abs(turn) * model.geom_aabb[geom, 3:]).sum(axis=1)
        if model.geom_rbound[geom] == 0.0 or abs(centre[2] - height) > half[2]:
            continue  # a plane (floor), or above or below
        low = np.floor((centre[:2] - half[:2] - origin) / RESOLUTION_M).astype(int)
        high = np.ceil((centre[:2] + half[:2] - origin) / RESOLUTION_M).astype(int)
        rows = slice(max(low[1], 0), min(high[1], n_y))
        columns = slice(max(low[0], 0), min(high[0], n_x))
        step = max(1, MAX_CELLS // max(1, columns.stop - columns.start))
        for first in range(rows.start, rows.stop, step):
            y, x = np.ogrid[first : min(first + step, rows.stop), columns]
            offset = (
                xmin + (x + 0.5) * RESOLUTION_M - data.geom_xpos[geom, 0],
                ymin + (y + 0.5) * RESOLUTION_M - data.geom_xpos[geom, 1],
                height - float(data.geom_xpos[geom, 2]),
            )
            local = [sum(offset[i] * turn[i, axis] for i in range(3)) for axis in range(3)]
            inside = _inside(int(model.geom_type[geom]), model.geom_size[geom], *local)
            values[first : first + len(y), columns][inside] = 1.0
    return Raster(
        values=values, resolution_m=RESOLUTION_M, T_map_origin=np.array([xmin, ymin, 0.0])
    )


def _inside(kind: int, size: Float, x: Float, y: Float, z: Float) -> NDArray[np.bool_]:
    """Which points, in the geom's frame, lie in the primitive."""
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
        word = mujoco.mjtGeom(kind).name[7:].lower()
        raise InvalidValueError(f"a {word} has no place at the scan plane, expected primitives")
    return inside

# SPDX-License-Identifier: Apache-2.0
"""Which geoms of a model a planar scanner can see.

They are chosen once: visible geoms (alpha above 0, not in the groups of collision hulls and of
painted shadows, not on the scanner's own robot) whose height can meet the scan plane. Everything in
a world of planar movers keeps its height, so the list holds for the whole run; what can change
height (limbs, free bodies) is always kept.
"""

import math

import mujoco
import numpy as np
from numpy.typing import NDArray

from scenes.footprint import at_rest
from sim.sensors.lidar import columns as col
from slam._jit import inner, njit
from slam.errors import InvalidValueError
from slam.frames import Float

Bool = NDArray[np.bool_]

HULL_GROUP = 3  # collision hulls: never seen by rays or cameras
PAINT_GROUP = 5  # shadows painted on the floor: for cameras only
UNSEEN_GROUPS = (HULL_GROUP, PAINT_GROUP)


def candidates(
    model: mujoco.MjModel, height: float, reach: float, robot: str | None, panes: Bool
) -> tuple[NDArray[np.int64], Float]:
    """(n,) ids and (n, 7) table of what a scanner can see.

    height  m, of the scan plane; ``reach`` m, how far rays may leave it
    robot   name of the scanner's own body; it and its children are not seen
    panes   (ngeom,) True for what beams may pass

    Raises ``InvalidValueError`` for a mesh, height field or SDF that could meet the scan plane.
    """
    data = at_rest(model)
    lifts, body, kind = _changes_height(model, data), model.geom_bodyid, model.geom_type
    bound = model.geom_rbound.copy()
    odd = ~np.isin(kind, col.PRIMITIVES)
    # A mesh frame sits at its centre of mass; its bounding sphere is about its box's centre.
    bound[odd] += np.abs(model.geom_aabb[odd, :3]).sum(axis=1)
    half, upright = _extents(kind, model.geom_size, bound, data.geom_xmat, lifts[body])
    # A level plane has no height: only a spot that spreads downwards meets it.
    meets = lifts[body] | (np.abs(data.geom_xpos[:, 2] - height) <= half + reach)
    seen = meets & _visible(model) & ~_own(model, robot)[body]
    for geom in np.flatnonzero(seen & odd).tolist():
        name = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_GEOM, geom) or f"#{geom}"
        raise InvalidValueError(
            f"geom {name!r} is a {mujoco.mjtGeom(kind[geom]).name[7:].lower()} at the height of "
            f"the scanner ({height:g} m), expected a primitive (sphere, capsule, ellipsoid, "
            f"cylinder, box or plane): put it in group {HULL_GROUP} and add primitives for the "
            "laser to see"
        )
    columns = (kind, *model.geom_size.T, half, upright, panes)
    table = np.column_stack(columns).astype(np.float64)[seen]
    return np.flatnonzero(seen).astype(np.int64), np.ascontiguousarray(table)


def subtree(model: mujoco.MjModel, root: int) -> Bool:
    """(nbody,) True for a body and all its descendants."""
    inside = np.zeros(model.nbody, dtype=np.bool_)
    inside[root] = True
    for body in range(root + 1, model.nbody):
        inside[body] = inside[model.body_parentid[body]]
    return inside


def _own(model: mujoco.MjModel, robot: str | None) -> Bool:
    if robot is None:
        return np.zeros(model.nbody, dtype=np.bool_)
    body = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, robot)
    if body < 0:
        raise InvalidValueError(f"Raycaster.robot: the model has no body {robot!r}")
    return subtree(model, body)


def _visible(model: mujoco.MjModel) -> Bool:
    """(ngeom,) whether rays see it: MuJoCo's own rule, and neither a collision hull nor paint."""
    material = model.geom_matid
    alpha = model.geom_rgba[:, 3].copy()
    alpha[material >= 0] = model.mat_rgba[material[material >= 0], 3]
    seen: Bool = (alpha != 0.0) & ~np.isin(model.geom_group, UNSEEN_GROUPS)
    return seen


def _changes_height(model: mujoco.MjModel, data: mujoco.MjData) -> Bool:
    """(nbody,) True where a joint or a mocap parent can lift or tip the body."""
    slides, hinges = mujoco.mjtJoint.mjJNT_SLIDE, mujoco.mjtJoint.mjJNT_HINGE
    vertical = np.abs(data.xaxis[:, 2])
    planar = (model.jnt_type == slides) & (vertical < 1e-9)
    planar |= (model.jnt_type == hinges) & (vertical > 1.0 - 1e-9)
    lifted = model.body_mocapid >= 0
    lifted[model.jnt_bodyid[~planar]] = True
    parents, out = model.body_parentid.tolist(), lifted.tolist()
    for body in range(1, model.nbody):
        out[body] = out[body] or out[parents[body]]
    return np.array(out, dtype=np.bool_)


@inner
def _half_height(kind: int, size: Float, mat: Float) -> float:
    """Half the vertical extent of a primitive with the given orientation, m."""
    x, y, z = abs(mat[6]), abs(mat[7]), abs(mat[8])  # world z of the geom's own axes
    if kind == col.PLANE:
        return 0.0 if z > 1.0 - 1e-12 else math.inf
    if kind == col.SPHERE:
        return float(size[0])
    if kind == col.CAPSULE:
        return float(size[0] + size[1] * z)
    if kind == col.CYLINDER:
        return float(size[1] * z + size[0] * math.sqrt(max(0.0, 1.0 - z * z)))
    a, b, c = x * size[0], y * size[1], z * size[2]
    if kind == col.ELLIPSOID:
        return math.sqrt(a * a + b * b + c * c)
    return float(a + b + c)


@njit
def _extents(
    kinds: NDArray[np.int32], sizes: Float, bounds: Float, mats: Float, lifts: Bool
) -> tuple[Float, Bool]:
    """(n,) half the height m, and whether it is a box that stands upright for good."""
    half, upright = bounds.copy(), np.zeros(len(bounds), dtype=np.bool_)
    for i in range(len(bounds)):
        kind = kinds[i]
        if kind not in (col.PLANE, col.SPHERE, col.CAPSULE, col.ELLIPSOID, col.CYLINDER, col.BOX):
            continue
        if lifts[i]:
            half[i] = math.inf if kind == col.PLANE else bounds[i]
            continue
        half[i] = _half_height(kind, sizes[i], mats[i])
        upright[i] = mats[i, 8] > 1.0 - 1e-12
    return half, upright

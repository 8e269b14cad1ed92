# SPDX-License-Identifier: Apache-2.0
"""Which geoms of a model a planar scanner can see, and how it casts on them.

The candidates are chosen once: visible geoms (alpha above 0, not in the group of the collision
hulls, not on the scanner's own robot) whose height can meet the scan plane. Everything in a world
of planar movers keeps its height, so the list holds for the whole run; what can change height
(limbs, free bodies) is always kept.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from sim import fan as fans
from sim import raycast
from slam.errors import InvalidValueError

Float = NDArray[np.float64]
Pose = tuple[float, float, float]

HULL_GROUP = 3  # collision hulls: never seen by rays or cameras


@dataclass(frozen=True, kw_only=True)
class Spot:
    """The disc a beam lights: ``aperture`` radius m at the window, ``divergence`` half angle rad.

    ``offsets`` (k, 2): places of the k rays on the unit disc, (left, up). An ideal beam is the
    default: one ray in the middle.
    """

    aperture: float = 0.0
    divergence: float = 0.0
    offsets: tuple[tuple[float, float], ...] = ((0.0, 0.0),)

    def rays(self) -> Float:
        """(k, 5): left, up, and the unit direction (forward, left, up) in the beam's frame."""
        out = np.empty((len(self.offsets), 5))
        for k, (u, v) in enumerate(self.offsets):
            left, up = self.divergence * u, self.divergence * v
            length = math.sqrt(1.0 + left * left + up * up)
            out[k] = u, v, 1.0 / length, left / length, up / length
        return out


def _name(model: mujoco.MjModel, kind: mujoco.mjtObj, index: int) -> str:
    return mujoco.mj_id2name(model, kind, index) or f"#{index}"


def subtree(model: mujoco.MjModel, root: int) -> NDArray[np.bool_]:
    """(nbody,) True for a body and all its descendants."""
    inside = np.zeros(model.nbody, dtype=np.bool_)
    inside[root] = True
    for body in range(root + 1, model.nbody):
        inside[body] = inside[model.body_parentid[body]]
    return inside


def _changes_height(model: mujoco.MjModel, data: mujoco.MjData) -> NDArray[np.bool_]:
    """(nbody,) True where a joint or a mocap parent can lift or tip the body."""
    out = np.zeros(model.nbody, dtype=np.bool_)
    for body in range(1, model.nbody):
        out[body] = out[model.body_parentid[body]] or model.body_mocapid[body] >= 0
        first = model.body_jntadr[body]
        for joint in range(first, first + model.body_jntnum[body]):
            kind, vertical = model.jnt_type[joint], abs(data.xaxis[joint][2])
            planar = (kind == mujoco.mjtJoint.mjJNT_SLIDE and vertical < 1e-9) or (
                kind == mujoco.mjtJoint.mjJNT_HINGE and vertical > 1.0 - 1e-9
            )
            out[body] |= not planar
    return out


def _half_height(kind: int, size: Float, mat: Float) -> float:
    """Half the vertical extent of a primitive with the given orientation, m."""
    up = np.abs(mat[6:9])  # world z of the geom's own axes
    if kind == fans.PLANE:
        return 0.0 if up[2] > 1.0 - 1e-12 else math.inf
    if kind == fans.SPHERE:
        return float(size[0])
    if kind == fans.CAPSULE:
        return float(size[0] + size[1] * up[2])
    if kind == fans.CYLINDER:
        return float(size[1] * up[2] + size[0] * math.sqrt(max(0.0, 1.0 - up[2] * up[2])))
    if kind == fans.ELLIPSOID:
        return float(math.sqrt(float(((up * size) ** 2).sum())))
    return float((up * size).sum())


class Raycaster:
    """Casts fans of beams on the geoms of one model.

    height     m, of the scan plane
    robot      name of the scanner's own body; it and its children are not seen
    spot       the rays of each beam
    range_max  m, bounds how far the spot spreads up and down
    only       optional (ngeom,) True for the geoms to consider at all

    Raises ``InvalidValueError`` for a mesh, height field or SDF that could meet the scan plane:
    the formulas cover primitives only.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        *,
        height: float,
        robot: str | None = "robot/base",
        spot: Spot | None = None,
        range_max: float = 80.0,
        only: NDArray[np.bool_] | None = None,
    ) -> None:
        self.spot = Spot() if spot is None else spot
        self.height = height
        wanted = np.ones(model.ngeom, dtype=np.bool_) if only is None else only
        self.ids = self._candidates(model, robot, range_max, wanted)
        self._table = self._geom_table
        self._optics = (self.spot.rays(), self.spot.aperture)
        self._spot = (self.spot.aperture, self.spot.divergence)
        n = self.ids.size
        self._poses = (np.full((n, 12), np.nan), np.full((n, 12), np.nan))
        self._bounds = np.zeros((n, 6))
        self._movable = np.flatnonzero(
            np.isin(model.geom_bodyid[self.ids], np.flatnonzero(model.body_weldid != 0))
        )
        self._seen: mujoco.MjData | None = None
        self._laser = np.zeros(7)
        self._laser[6] = height

    @property
    def rays_per_beam(self) -> int:
        """Number of rays cast for each beam."""
        return len(self.spot.offsets)

    def _candidates(
        self,
        model: mujoco.MjModel,
        robot: str | None,
        range_max: float,
        wanted: NDArray[np.bool_],
    ) -> NDArray[np.int64]:
        data = mujoco.MjData(model)
        mujoco.mj_kinematics(model, data)
        lifts = _changes_height(model, data)
        own = np.zeros(model.nbody, dtype=np.bool_)
        if robot is not None:
            body = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, robot)
            if body < 0:
                raise InvalidValueError(f"Raycaster.robot: the model has no body {robot!r}")
            own = subtree(model, body)
        reach = self.spot.aperture + self.spot.divergence * range_max
        ids, rows = [], []
        for geom in range(model.ngeom):
            body = model.geom_bodyid[geom]
            if own[body] or not wanted[geom] or not _visible(model, geom):
                continue
            half, upright = _vertical_extent(model, data, geom, bool(lifts[body]))
            # A level plane has no height: only a spot that spreads downwards meets it.
            meets = abs(data.geom_xpos[geom][2] - self.height) <= half + reach
            if not (lifts[body] or meets):
                continue
            kind = int(model.geom_type[geom])
            if kind not in fans.PRIMITIVES:
                raise InvalidValueError(
                    f"geom {_name(model, mujoco.mjtObj.mjOBJ_GEOM, geom)!r} is a "
                    f"{mujoco.mjtGeom(kind).name[7:].lower()} at the height of the scanner "
                    f"({self.height:g} m), expected a primitive (sphere, capsule, ellipsoid, "
                    "cylinder, box or plane): put it in group "
                    f"{HULL_GROUP} and add primitives for the laser to see"
                )
            ids.append(geom)
            rows.append((kind, *model.geom_size[geom], half, float(upright)))
        self._geom_table = np.array(rows, dtype=np.float64).reshape(-1, 6)
        return np.array(ids, dtype=np.int64)

    def start(self, data: mujoco.MjData) -> None:
        """Note where everything is at the start of a physics step; needs fresh kinematics."""
        movable = self._movable
        if data is not self._seen:
            self._seen, movable = data, np.arange(self.ids.size)
            self._views = (data.geom_xpos, data.geom_xmat)
        self._follow(movable, restart=True)

    def _follow(self, movable: NDArray[np.int64], *, restart: bool) -> None:
        fans.follow(self._table, self.ids, movable, self._views, self._poses, self._bounds, restart)

    def cast(
        self,
        fan: tuple[NDArray[np.int64], Float, Float],
        laser: tuple[Pose, Pose],
        out: tuple[Float, NDArray[np.int64], Float],
    ) -> None:
        """Cast the beams measured during the physics step that has just ended.

        fan    beams (m,) rows of ``out``, angles (m,) rad in the laser frame at even ascending
               steps, taus (m,) time of each beam within the step, 0..1
        laser  pose (x, y, yaw) of the laser at the start and at the end of the step
        out    (n, k) each: ranges m, inf for a miss; index into ``ids``, -1; |cos| of the
               incidence, NaN

        ``out`` must come in as misses. The end of this step becomes the start of the next.
        """
        beams, angles, taus = fan
        self._laser[0:6] = (*laser[0], *laser[1])
        self._follow(self._movable, restart=False)
        table, poses, bounds = self._table, self._poses, self._bounds
        plan = fans.prepare(table, poses[1], bounds, angles, taus, self._laser, self._spot)
        raycast.cast_fan(table, poses, bounds, plan, beams, self.height, self._optics, out)


def _visible(model: mujoco.MjModel, geom: int) -> bool:
    """Rays see it: MuJoCo's own rule, and not a collision hull."""
    material = model.geom_matid[geom]
    rgba = model.geom_rgba[geom] if material < 0 else model.mat_rgba[material]
    return bool(rgba[3] != 0.0) and model.geom_group[geom] != HULL_GROUP


def _vertical_extent(
    model: mujoco.MjModel, data: mujoco.MjData, geom: int, lifts: bool
) -> tuple[float, bool]:
    """(half the height m, whether it is a box that stands upright for good)."""
    kind, mat = int(model.geom_type[geom]), data.geom_xmat[geom]
    bound = float(model.geom_rbound[geom])
    if kind not in fans.PRIMITIVES:
        # A mesh frame sits at its centre of mass; its bounding sphere is about its box's centre.
        bound += float(np.abs(model.geom_aabb[geom][:3]).sum())
        return bound, False
    if lifts:
        return (math.inf if kind == fans.PLANE else bound), False
    return _half_height(kind, model.geom_size[geom], mat), bool(mat[8] > 1.0 - 1e-12)

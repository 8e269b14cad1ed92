# SPDX-License-Identifier: Apache-2.0
"""A room as boxes, balls and cylinders to be drawn, and where they are at a moment.

What a thing looks like is said once, by the geoms of its model: whoever draws a room with other
means than MuJoCo's renderer (``sim.view.camera``), in 3-D or from above, draws these.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from scenes.scene import Scene
from sim.core.bodies import STATIC, Bodies
from sim.world.world import World
from slam.frames import Float

DRAWN_GROUPS = (0, 1, 2)  # of geoms: rooms, things, people; the others are hulls, marks, shadows
FLOOR_M = 0.004  # thickness of a floor
CLEAR = 0.99  # opacity; below that a part is glass
BOX, BALL, CYLINDER = "box", "ball", "cylinder"  # with edges, axes and diameters of 1 m
_GEOM = mujoco.mjtGeom


@dataclass(frozen=True, kw_only=True, eq=False)
class Placed:
    """Where everything is: what MuJoCo needs to place all bodies."""

    qpos: Float
    mocap_pos: Float
    mocap_quat: Float

    @classmethod
    def of(cls, world: World) -> "Placed":
        """Now."""
        data = world.data
        mocap = data.mocap_pos.copy(), data.mocap_quat.copy()
        return cls(qpos=data.qpos.copy(), mocap_pos=mocap[0], mocap_quat=mocap[1])


@dataclass(frozen=True, kw_only=True, eq=False)
class Batch:
    """Parts of one shape that are drawn together.

    moves, glass  whether they can move; whether one sees through them
    geoms   (n,) of the model;   along  (n,) m of their centres along the geoms' z axes
    sizes   (n, 3) m;   colors  (n, 3) RGB;   opacity  (n,) 0 to 1
    owners  (n,) row of the mover, ``STATIC`` for the room
    """

    shape: str
    moves: bool
    glass: bool
    geoms: NDArray[np.int64]
    along: Float
    sizes: Float
    colors: NDArray[np.uint8]
    opacity: Float
    owners: NDArray[np.int64]


class Parts:
    """Everything that is seen of a scene. ``batches`` say what it is, ``poses`` where.

    model  of the scene, compiled here where it is None
    home   (n, 3) pose of each mover before anything is placed
    limbs  (ngeom,) which go their own ways: legs of people
    """

    def __init__(self, scene: Scene, model: mujoco.MjModel | None = None) -> None:
        self._model = model = scene.compile() if model is None else model
        self._data, self._bounds = mujoco.MjData(model), scene.bounds
        mujoco.mj_kinematics(model, self._data)
        self.names = [mover.name for mover in scene.movers]
        bodies = Bodies(model, scene)
        self.home = bodies.poses(self._data)
        self.limbs = model.body_mocapid[model.geom_bodyid] >= 0
        self._owner = owner = bodies.mover_of_body[model.geom_bodyid]
        found: dict[tuple[str, bool, bool], list[tuple[int, float, tuple[float, ...]]]] = {}
        for geom in np.flatnonzero(np.isin(self._model.geom_group, DRAWN_GROUPS)).tolist():
            glass = self._rgba(geom)[3] < CLEAR
            for shape, along, size in self._shapes(geom):
                key = shape, bool(owner[geom] != STATIC), bool(glass)
                found.setdefault(key, []).append((geom, along, size))
        self.batches = tuple(self._batch(key, parts, owner) for key, parts in sorted(found.items()))

    @property
    def moving(self) -> int:
        """How many of them can move."""
        return sum(len(batch.geoms) for batch in self.batches if batch.moves)

    def place(self, placed: Placed) -> None:
        """Put everything where it was; ``poses`` are of then."""
        data = self._data
        data.qpos[:] = placed.qpos
        data.mocap_pos[:], data.mocap_quat[:] = placed.mocap_pos, placed.mocap_quat
        mujoco.mj_kinematics(self._model, data)

    def poses(self, batch: Batch) -> tuple[Float, Float]:
        """(n, 3) m and (n, 4) w, x, y, z of the parts' centres."""
        turns = self._data.geom_xmat[batch.geoms]
        centres: Float = self._data.geom_xpos[batch.geoms] + batch.along[:, None] * turns[:, 2::3]
        quats = np.empty((len(turns), 4))
        for turn, quat in zip(turns, quats, strict=True):
            mujoco.mju_mat2Quat(quat, turn)
        if batch.shape == BALL:
            quats[np.ptp(batch.sizes, axis=1) == 0.0] = (1.0, 0.0, 0.0, 0.0)  # looks no different
        return centres, quats

    def corners(self, batch: Batch, around: int) -> Float:
        """(n, k, 3) m of points whose hulls are the parts; ``around``: of a circle."""
        turns = self._data.geom_xmat[batch.geoms].reshape(-1, 3, 3)
        own = mesh(batch.shape, around)[0][None] * batch.sizes[:, None]
        own[..., 2] += batch.along[:, None]
        corners: Float = np.einsum("nij,nkj->nki", turns, own)
        corners += self._data.geom_xpos[batch.geoms, None]
        return corners

    def is_wall(self, geom: int) -> bool:
        """Whether it is a wall of the room, and no board on one."""
        material = int(self._model.geom_matid[geom])
        name = self._model.mat(material).name if material >= 0 else ""
        return name.startswith("wall") and not name.startswith("wall_board")

    def hit(self, origin: Sequence[float], direction: Sequence[float]) -> tuple[str, Float] | None:
        """Name of the mover, "" for the room, and place (m) where a ray meets something first."""
        group = np.isin(np.arange(6), DRAWN_GROUPS).astype(np.uint8)
        start, way = np.array(origin, np.float64), np.array(direction, np.float64)
        geom = np.full(1, -1, np.int32)
        far = mujoco.mj_ray(self._model, self._data, start, way, group, 1, -1, geom)
        if far < 0.0:
            return None
        row = int(self._owner[geom[0]])
        return ("" if row == STATIC else self.names[row]), start + far * way

    def _shapes(self, geom: int) -> list[tuple[str, float, tuple[float, ...]]]:
        """Shape, m along the geom's z axis, and size of all that a geom is drawn with."""
        kind = _GEOM(int(self._model.geom_type[geom]))
        half = self._model.geom_size[geom].tolist()
        x, y, z = (2.0 * size for size in half)
        if kind == _GEOM.mjGEOM_PLANE:
            xmin, ymin, xmax, ymax = self._bounds
            ground = max(half[:2]) > max(xmax - xmin, ymax - ymin) or x <= 0.0  # far beyond
            return [] if ground else [(BOX, 0.0, (x, y, FLOOR_M))]
        rod = (CYLINDER, 0.0, (x, x, y))
        shapes: dict[Any, list[tuple[str, float, tuple[float, ...]]]] = {
            _GEOM.mjGEOM_BOX: [(BOX, 0.0, (x, y, z))],
            _GEOM.mjGEOM_SPHERE: [(BALL, 0.0, (x, x, x))],
            _GEOM.mjGEOM_ELLIPSOID: [(BALL, 0.0, (x, y, z))],
            _GEOM.mjGEOM_CYLINDER: [rod],
            _GEOM.mjGEOM_CAPSULE: [
                rod, *((BALL, along, (x, x, x)) for along in (-half[1], half[1]))
            ],
        }  # fmt: skip
        return shapes.get(kind, [])

    def _rgba(self, geom: int) -> Float:
        """Of its material, paper of a texture blended in, else its own."""
        model, material = self._model, int(self._model.geom_matid[geom])
        rgba: Float = model.geom_rgba[geom].astype(np.float64)
        if material < 0:
            return rgba
        rgba = model.mat_rgba[material].astype(np.float64)
        texture = int(model.mat_texid[material].max())
        if texture >= 0:
            start, n = int(model.tex_adr[texture]), int(model.tex_nchannel[texture])
            pixels = int(model.tex_height[texture]) * int(model.tex_width[texture])
            whole = model.tex_data[start : start + pixels * n].reshape(-1, n)
            rgba[:3] *= whole[:, :3].mean(axis=0) / 255.0
        return rgba

    def _batch(
        self,
        key: tuple[str, bool, bool],
        parts: list[tuple[int, float, tuple[float, ...]]],
        owner: NDArray[np.int64],
    ) -> Batch:
        geoms, along, sizes = (np.array(column) for column in zip(*parts, strict=True))
        rgba = np.array([self._rgba(geom) for geom in geoms.tolist()])
        return Batch(
            shape=key[0],
            moves=key[1],
            glass=key[2],
            geoms=geoms,
            along=along,
            sizes=sizes,
            colors=np.round(255.0 * np.clip(rgba[:, :3], 0.0, 1.0)).astype(np.uint8),
            opacity=rgba[:, 3],
            owners=owner[geoms],
        )


@cache
def mesh(shape: str, around: int) -> tuple[Float, NDArray[np.int64]]:
    """Vertices (n, 3) m and faces (k, 3) of a shape with edges, axes and diameters of 1 m."""
    if shape == BOX:
        ways = (-0.5, 0.5)
        corners = np.array([[x, y, z] for x in ways for y in ways for z in ways])
        sides = np.array([(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4),
                          (1, 5, 7, 3)])  # fmt: skip
        first = 4 * np.arange(6)[:, None, None]
        faces = first + np.array([[0, 1, 2], [0, 2, 3]])
        return corners[sides].reshape(-1, 3), faces.reshape(-1, 3)
    up = np.linspace(-math.pi / 2.0, math.pi / 2.0, 6)
    radii, heights = 0.5 * np.cos(up), 0.5 * np.sin(up)
    if shape == CYLINDER:  # rims twice, so that sides and lids are shaded apart
        radii = np.array([0.0, 0.5, 0.5, 0.5, 0.5, 0.0])
        heights = np.array([-0.5, -0.5, -0.5, 0.5, 0.5, 0.5])
    turns = np.linspace(0.0, math.tau, around, endpoint=False)
    circle = np.stack([np.cos(turns), np.sin(turns)], axis=1)
    rings = [np.column_stack([r * circle, np.full(around, h)])
             for r, h in zip(radii, heights, strict=True)]  # fmt: skip
    k = np.arange(around)
    a, b = k, (k + 1) % around
    ring = np.concatenate(
        [np.stack([a, b, b + around], 1), np.stack([a, b + around, a + around], 1)]
    )
    faces = (around * np.arange(len(rings) - 1)[:, None, None] + ring).reshape(-1, 3)
    return np.concatenate(rings), faces

# SPDX-License-Identifier: Apache-2.0
"""A simulated room as entities of a 3D scene: walls and furniture once, movers as they move."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from scripts.live.sdk import Sdk
from sim.core.bodies import STATIC
from sim.world.world import World
from slam.frames import Float

DRAWN_GROUPS = (0, 1, 2)  # of geoms: rooms, things, people; the others are hulls and invisible
STILL_M = 1e-4  # what moved less since it was sent is not sent again
FLOOR_M = 0.004  # thickness of a floor
_GEOM = mujoco.mjtGeom


@dataclass(frozen=True, kw_only=True, eq=False)
class Placed:
    """Where everything is: what MuJoCo needs to place all bodies."""

    qpos: Float
    mocap_pos: Float
    mocap_quat: Float

    @classmethod
    def of(cls, world: World) -> Placed:
        """Now."""
        data = world.data
        mocap = data.mocap_pos.copy(), data.mocap_quat.copy()
        return cls(qpos=data.qpos.copy(), mocap_pos=mocap[0], mocap_quat=mocap[1])


class Things:
    """Scene entities of one world; keeps what was sent last."""

    def __init__(self, sdk: Sdk, world: World) -> None:
        self._messages, self._world = sdk.messages, world
        self._model, self._data = world.model, mujoco.MjData(world.model)
        owner = world.bodies.mover_of_body[self._model.geom_bodyid]
        drawn = np.isin(self._model.geom_group, DRAWN_GROUPS) & self._small_enough()
        self._static = np.flatnonzero(drawn & (owner == STATIC))
        self._of_mover = [
            np.flatnonzero(drawn & (owner == k)) for k in range(len(world.scene.movers))
        ]
        self._colors = [self._color(geom) for geom in range(self._model.ngeom)]
        self._sent: list[Float | None] = [None] * len(self._of_mover)

    def entities(self, placed: Placed, stamp: Any, *, everything: bool) -> list[Any]:
        """Movers that have moved since the last call; ``everything``: all, and the room."""
        data = self._data
        data.qpos[:] = placed.qpos
        data.mocap_pos[:], data.mocap_quat[:] = placed.mocap_pos, placed.mocap_quat
        mujoco.mj_kinematics(self._model, data)
        found = []
        if everything:
            self._sent = [None] * len(self._sent)
            found.append(self._entity("room", self._static, stamp))
        for k, geoms in enumerate(self._of_mover):
            now, before = self._where(geoms), self._sent[k]
            if before is None or np.abs(now - before).max(initial=0.0) > STILL_M:
                self._sent[k] = now
                name = self._world.mover_names[k]
                found.append(self._entity(f"mover/{name}", geoms, stamp))
        return found

    def _where(self, geoms: NDArray[np.int64]) -> Float:
        return np.concatenate([self._data.geom_xpos[geoms], self._data.geom_xmat[geoms]], axis=1)

    def _small_enough(self) -> NDArray[np.bool_]:
        """(ngeom,) not the ground, which reaches far beyond the room."""
        xmin, ymin, xmax, ymax = self._world.scene.bounds
        wide = np.maximum(self._model.geom_size[:, 0], self._model.geom_size[:, 1])
        planes = self._model.geom_type == _GEOM.mjGEOM_PLANE
        small: NDArray[np.bool_] = ~planes | (
            (wide > 0.0) & (wide <= max(xmax - xmin, ymax - ymin))
        )
        return small

    def _color(self, geom: int) -> Any:
        material = int(self._model.geom_matid[geom])
        rgba = self._model.mat_rgba[material] if material >= 0 else self._model.geom_rgba[geom]
        r, g, b, a = (float(value) for value in rgba)
        return self._messages.Color(r=r, g=g, b=b, a=a)

    def _entity(self, name: str, geoms: NDArray[np.int64], stamp: Any) -> Any:
        parts: dict[str, list[Any]] = {}
        for geom in geoms.tolist():
            for kind, part in self._primitives(geom):
                parts.setdefault(kind, []).append(part)
        return self._messages.SceneEntity(timestamp=stamp, frame_id="world", id=name, **parts)

    def _primitives(self, geom: int) -> Iterator[tuple[str, Any]]:
        """Field of the entity and primitive, of all that a geom is drawn with."""
        messages, kind = self._messages, int(self._model.geom_type[geom])
        x, y, z = self._model.geom_size[geom].tolist()
        pose, color = self._pose(geom, 0.0), self._colors[geom]
        if kind in (_GEOM.mjGEOM_BOX, _GEOM.mjGEOM_PLANE):
            deep = FLOOR_M if kind == _GEOM.mjGEOM_PLANE else 2.0 * z
            size = messages.Vector3(x=2.0 * x, y=2.0 * y, z=deep)
            yield "cubes", messages.CubePrimitive(pose=pose, size=size, color=color)
        elif kind in (_GEOM.mjGEOM_SPHERE, _GEOM.mjGEOM_ELLIPSOID):
            axes = (x, x, x) if kind == _GEOM.mjGEOM_SPHERE else (x, y, z)
            yield "spheres", self._sphere(pose, axes, color)
        elif kind in (_GEOM.mjGEOM_CYLINDER, _GEOM.mjGEOM_CAPSULE):
            yield "cylinders", messages.CylinderPrimitive(
                pose=pose, size=messages.Vector3(x=2.0 * x, y=2.0 * x, z=2.0 * y),
                bottom_scale=1.0, top_scale=1.0, color=color,
            )  # fmt: skip
            if kind == _GEOM.mjGEOM_CAPSULE:
                for along in (-y, y):
                    yield "spheres", self._sphere(self._pose(geom, along), (x, x, x), color)

    def _sphere(self, pose: Any, axes: tuple[float, float, float], color: Any) -> Any:
        messages = self._messages
        size = messages.Vector3(x=2.0 * axes[0], y=2.0 * axes[1], z=2.0 * axes[2])
        return messages.SpherePrimitive(pose=pose, size=size, color=color)

    def _pose(self, geom: int, along: float) -> Any:
        """Of a geom's centre, or of the point ``along`` m of its z axis from there."""
        messages, turn = self._messages, np.zeros(4)
        mujoco.mju_mat2Quat(turn, self._data.geom_xmat[geom])
        w, qx, qy, qz = turn.tolist()
        x, y, z = (self._data.geom_xpos[geom] + along * self._data.geom_xmat[geom][2::3]).tolist()
        return messages.Pose(
            position=messages.Vector3(x=x, y=y, z=z),
            orientation=messages.Quaternion(x=qx, y=qy, z=qz, w=w),
        )

# SPDX-License-Identifier: Apache-2.0
"""Where things are: the movers of a scene found in its compiled model, placed, read, saved."""

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from scenes.footprint import at_rest
from scenes.kinds import joint_of_door
from sim.core.flow import box_clearance
from sim.core.state import Records
from slam._jit import njit
from slam.errors import InvalidValueError
from slam.frames import Float
from slam.shaped import Pose, shaped

if TYPE_CHECKING:
    from scenes.scene import Mover, Scene

STATIC = -1  # mover index of everything that cannot move

_STATE = int(mujoco.mjtState.mjSTATE_INTEGRATION)
# Sleep is no part of mjSTATE_INTEGRATION (mj_setState wakes every sleeper), so it is saved beside
# it: what sleeps, and the lists MuJoCo derives from that.
_SLEEP_ARRAYS = (
    "tree_asleep",
    "tree_awake",
    "body_awake",
    "body_awake_ind",
    "parent_awake_ind",
    "dof_awake_ind",
)
_SLEEP_COUNTS = ("ntree_awake", "nbody_awake", "nparent_awake", "nv_awake")


@njit
def _poses(
    qpos: Float, first: NDArray[np.int64], hinge: Float, door: NDArray[np.bool_], out: Float
) -> None:
    for i in range(len(first)):
        q = first[i]
        if door[i]:
            slid = hinge[i, 4] * qpos[q]
            out[i, 0] = hinge[i, 0] + slid * math.cos(hinge[i, 2])
            out[i, 1] = hinge[i, 1] + slid * math.sin(hinge[i, 2])
            out[i, 2] = hinge[i, 2] + hinge[i, 3] * qpos[q]
        else:
            out[i, 0], out[i, 1], out[i, 2] = qpos[q], qpos[q + 1], qpos[q + 2]


@njit
def _read_robot(qpos: Float, at: int, drive: Records, pose: Float, travel: Float) -> None:
    for k in range(3):
        pose[k] = qpos[at + k]
    travel[0], travel[1] = drive[0].rolled_left, drive[0].rolled_right
    travel[2] = drive[0].rolled_side


class Bodies:
    """Addresses of the movers of ``scene`` in ``model``.

    mover_of_body  (nbody,) index into ``scene.movers``, ``STATIC`` for the room itself
    robot          index of the robot, None in a scene without one
    """

    def __init__(self, model: mujoco.MjModel, scene: "Scene") -> None:
        self.model = model
        self.scene = scene
        self.robot: int | None = next(
            (i for i, m in enumerate(scene.movers) if m.kind == "robot"), None
        )
        self.radius = np.array([m.radius for m in scene.movers])
        self._row = {m.name: i for i, m in enumerate(scene.movers)}
        self.mover_of_body = self._owners()
        n = len(scene.movers)
        self._qpos, self._dof = np.full(n, -1, dtype=np.int64), np.full(n, -1, dtype=np.int64)
        # doors: hinge x, y m; heading rad when closed; turn, and metres along the heading, by qpos
        self._hinge = np.zeros((n, 5))
        for i, mover in enumerate(scene.movers):
            if mover.group == "door":
                self._add_door(i, mover, at_rest(model))
            else:
                self._add_planar(i, mover)
        self._robot_at = 0 if self.robot is None else int(self._qpos[self.robot])
        kinds = np.array([m.group == "door" for m in scene.movers], dtype=bool)
        self._is_door = kinds
        self._planar, self._doors = np.nonzero(~kinds)[0], np.nonzero(kinds)[0]

    def _owners(self) -> NDArray[np.int64]:
        names = (self.model.body(b).name for b in range(self.model.nbody))
        return np.array([self._row.get(n.partition("/")[0], STATIC) for n in names], dtype=np.int64)

    def _add_planar(self, i: int, mover: "Mover") -> None:
        joints = [self.model.joint(f"{mover.name}/{axis}") for axis in ("x", "y", "yaw")]
        addresses = [int(j.qposadr[0]) for j in joints]
        if addresses != list(range(addresses[0], addresses[0] + 3)):
            raise InvalidValueError(
                f"{mover.name}: joints x, y, yaw must be declared in this order, one body"
            )
        self._qpos[i], self._dof[i] = addresses[0], int(joints[0].dofadr[0])

    def _add_door(self, i: int, mover: "Mover", data: mujoco.MjData) -> None:
        joint = self.model.joint(f"{mover.name}/{joint_of_door(mover.kind)}")
        self._qpos[i], self._dof[i] = int(joint.qposadr[0]), int(joint.dofadr[0])
        body = int(joint.bodyid[0])
        x, y = data.xanchor[joint.id][:2].tolist()
        centre = data.xipos[body]
        heading = math.atan2(float(centre[1]) - y, float(centre[0]) - x)
        if mover.kind == "door":
            self._hinge[i] = x, y, heading, math.copysign(1.0, data.xaxis[joint.id][2]), 0.0
        else:
            self._hinge[i] = x, y, heading, 0.0, -1.0

    def rows(self, names: Sequence[str]) -> NDArray[np.int64]:
        """Index into ``scene.movers`` of each name."""
        return np.array([self._row[name] for name in names], dtype=np.int64)

    def addresses(self, names: Sequence[str]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """First qpos and first dof address of each named mover."""
        rows = self.rows(names)
        return self._qpos[rows].astype(np.int64), self._dof[rows].astype(np.int64)

    def any_at(self, qpos: NDArray[np.int64]) -> NDArray[np.bool_]:
        """(n,) whether the first address of each mover is one of these."""
        return np.isin(self._qpos, qpos)

    def hinges(self, names: Sequence[str]) -> Float:
        """(n, 5) of each named door, closed: hinge x, y m, heading of the leaf rad; how its joint
        turns it (1, -1; 0: not) and shifts it along its heading (-1; 0: not).
        """
        return self._hinge[self.rows(names)]

    def radii(self, names: Sequence[str]) -> Float:
        """(n,) m, footprint of each named mover; for a door the width of its leaf."""
        return self.radius[self.rows(names)]

    def robot_pose(self, data: mujoco.MjData) -> Float:
        """(3,) x m, y m, heading rad."""
        if self.robot is None:
            raise InvalidValueError(f"scene '{self.scene.name}' has no robot")
        at = int(self._qpos[self.robot])
        pose: Float = data.qpos[at : at + 3].copy()
        return pose

    def place_robot(self, data: mujoco.MjData, pose: Sequence[float]) -> None:
        """Put the robot at (x, y, heading); ``InvalidValueError`` where it does not fit."""
        x, y, yaw = shaped("start", pose, Pose)
        here = self.poses(data)
        if self.robot is None:
            raise InvalidValueError(f"start must be a pose of a robot, got {pose!r}")
        data.qpos[self._robot_at : self._robot_at + 3] = x, y, yaw
        for k, mover in enumerate(self.scene.movers):
            if k == self.robot or mover.group == "door":
                continue
            free = math.hypot(here[k, 0] - x, here[k, 1] - y) - float(self.radius[k])
            if free < float(self.radius[self.robot]):
                raise InvalidValueError(f"start {(x, y)} is taken by {mover.name}")
        if self.clearance(data) < 0.0:
            raise InvalidValueError(f"start {(x, y)} does not lie on free floor")

    def read_robot(self, data: mujoco.MjData, drive: Records, pose: Float, travel: Float) -> None:
        """``robot_pose`` into ``pose``, and what the wheels of the drive rolled to ``travel``."""
        _read_robot(data.qpos, self._robot_at, drive, pose, travel)

    def poses(self, data: mujoco.MjData) -> Float:
        """(n, 3) pose of each mover; a door at its hinge, heading along the leaf.

        One that slides is where the end of its leaf is that leads when it opens.
        """
        return self.poses_of(data.qpos)

    def poses_of(self, qpos: Float) -> Float:
        """The same from any qpos."""
        out = np.empty((len(self.radius), 3))
        _poses(qpos, self._qpos, self._hinge, self._is_door, out)
        return out

    def copy_mover(self, row: int, source: Float, target: Float) -> None:
        """Copy where mover ``row`` is from one qpos to another."""
        first = int(self._qpos[row])
        last = first + (1 if self._is_door[row] else 3)
        target[first:last] = source[first:last]

    def put(self, data: mujoco.MjData, rows: Sequence[int], poses: Float) -> None:
        """Let planar movers stand still at (k, 3) poses; whoever sleeps sleeps on there."""
        for row, pose in zip(rows, poses, strict=True):
            first, joint = int(self._qpos[row]), int(self._dof[row])
            data.qpos[first : first + 3] = pose
            own = self.model.dof_bodyid == self.model.dof_bodyid[joint]
            data.qvel[own] = 0.0
        self.restore_physics(data, self.physics_state(data))

    def speeds(self, data: mujoco.MjData) -> Float:
        """(n,) m/s, the greater of the centre's speed and the rim's by turning."""
        out = np.zeros(len(self.radius))
        first = self._dof[self._planar]
        v = data.qvel[first[:, None] + np.arange(3)]
        rim = np.abs(v[:, 2]) * self.radius[self._planar]
        out[self._planar] = np.maximum(np.sqrt(v[:, 0] * v[:, 0] + v[:, 1] * v[:, 1]), rim)
        turning = np.abs(data.qvel[self._dof[self._doors]])
        slides = self._hinge[self._doors, 4] != 0.0
        out[self._doors] = turning * np.where(slides, 1.0, self.radius[self._doors])
        return out

    def clearance(self, data: mujoco.MjData) -> float:
        """m from the robot's rim to the nearest static box or the edge of the floor."""
        x, y, _ = self.robot_pose(data).tolist()
        xmin, ymin, xmax, ymax = self.scene.bounds
        edge = min(x - xmin, xmax - x, y - ymin, ymax - y)
        boxes = np.ascontiguousarray(self.scene.obstacles, dtype=np.float64)
        nearest = float(min(edge, box_clearance(x, y, boxes)))
        return nearest - float(self.radius[self.robot])

    def physics_state(self, data: mujoco.MjData) -> dict[str, NDArray[Any]]:
        """Integration state and sleep of ``data``, by name."""
        integration = np.zeros(mujoco.mj_stateSize(self.model, _STATE))
        mujoco.mj_getState(self.model, data, integration, _STATE)
        counts = np.array([getattr(data, name) for name in _SLEEP_COUNTS], dtype=np.int64)
        arrays = {f"sleep.{name}": getattr(data, name).copy() for name in _SLEEP_ARRAYS}
        return {"integration": integration, "sleep.counts": counts, **arrays}

    def restore_physics(self, data: mujoco.MjData, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Inverse of ``physics_state``; leaves poses fresh, as ``sim.world.substeps`` does."""
        if arrays["integration"].size != mujoco.mj_stateSize(self.model, _STATE):
            raise InvalidValueError("the state is of another model: its size differs")
        mujoco.mj_resetData(self.model, data)
        mujoco.mj_setState(self.model, data, arrays["integration"], _STATE)
        mujoco.mj_forward(self.model, data)  # while all are awake: sleepers need their poses too
        mujoco.mj_setState(self.model, data, arrays["integration"], _STATE)
        for name in _SLEEP_ARRAYS:
            getattr(data, name)[...] = arrays[f"sleep.{name}"]
        for name, count in zip(_SLEEP_COUNTS, arrays["sleep.counts"].tolist(), strict=True):
            setattr(data, name, count)
        mujoco.mj_step1(self.model, data)

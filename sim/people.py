# SPDX-License-Identifier: Apache-2.0
"""The people of a scene: arrays for the compiled kernels of ``sim.crowd`` and ``sim.gait``."""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence

import mujoco
import numpy as np
from numpy.typing import NDArray

from scenes.scene import Scene
from sim import crowd, gait, manners
from sim.bodies import Bodies
from sim.doors import Doors
from sim.draws import between, normal, uniform
from sim.flow import Field, FlowMap
from sim.manners import Addresses, Crowd

Float = NDArray[np.float64]
_LIMBS = ("thigh_l", "shank_l", "thigh_r", "shank_r")
_LOOKS = np.uint64(0xD1342543DE82EF95)  # sets the second generator of each person apart
_PLANAR_BIT = 2  # contype of chairs, bins and the robot
_FIRST_STAY_MAX = 8.0  # s, so that a short run of a calm room sees someone set off


@functools.lru_cache(maxsize=8)
def _flow(
    bounds: tuple[float, float, float, float], boxes: bytes, leaves: bytes, goals: bytes
) -> FlowMap:
    """Flow maps are the costly part of a reset and depend on the floor plan alone."""
    return FlowMap(
        bounds,
        np.frombuffer(boxes, dtype=np.float64).reshape(-1, 5),
        np.frombuffer(goals, dtype=np.float64).reshape(-1, 2),
        leaves=np.frombuffer(leaves, dtype=np.float64).reshape(-1, 5),
    )


def floor_field(scene: Scene, leaves: Float) -> Field:
    """Clearance and ways to all goals of a scene, in the order of its ``goals``."""
    goals = np.array([scene.goals[name] for name in scene.goals], dtype=np.float64)
    xmin, ymin, xmax, ymax = (float(b) for b in scene.bounds)
    boxes = np.ascontiguousarray(scene.obstacles, dtype=np.float64)
    bounds = (xmin, ymin, xmax, ymax)
    return _flow(bounds, boxes.tobytes(), leaves.tobytes(), goals.tobytes()).field


class Hulls:
    """The parts of the model that depend on who sits: derived from the state, so never saved."""

    def __init__(self, model: mujoco.MjModel, names: Sequence[str]) -> None:
        self._model = model
        self._geoms = [int(model.geom(f"{name}/hull").id) for name in names]
        looks = (mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, f"{p}/look") for p in names)
        self._looks = list(looks)
        self._bits = [
            (int(model.geom_contype[g]), int(model.geom_conaffinity[g])) for g in self._geoms
        ]
        self._z = [float(model.body_pos[b, 2]) for b in self._looks]
        self.changed = False

    def follow(self, crowd: Crowd) -> None:
        """One who has a chair, and no longer walks to it, meets walls, people and doors only."""
        self.changed = False
        for i, geom in enumerate(self._geoms):
            task = crowd.task[i]
            off = task[manners.SEAT] >= 0 and task[manners.WALKING] != manners.TO_SEAT
            contype, affinity = self._bits[i]
            self._model.geom_contype[geom] = 0 if off else contype
            self._model.geom_conaffinity[geom] = affinity & ~_PLANAR_BIT if off else affinity
            self.changed = self.changed or bool(off)
            if self._looks[i] >= 0:
                sunk = (gait.HIP - gait.SEAT_HEIGHT) * float(crowd.state[i, manners.SIT])
                self._model.body_pos[self._looks[i], 2] = self._z[i] - sunk


class People:
    """Everybody in a room.

    stay_mean  s at a goal; infinite: nobody moves at all
    pace       factor on the preferred speeds, N(1.34, 0.26) m/s clipped to 0.8..1.9 (PedSim)
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        bodies: Bodies,
        doors: Doors,
        *,
        stay_mean: float,
        pace: float,
        counters: NDArray[np.uint64],
    ) -> None:
        scene = bodies.scene
        self.names = [m.name for m in scene.movers if m.kind == "person"]
        n = len(self.names)
        self.alive = n > 0 and math.isfinite(stay_mean) and len(scene.goals) > 0
        self._rates = (stay_mean, pace)
        self._servos = np.array([model.actuator(f"{p}/vx").id for p in self.names], dtype=np.int64)
        self._limbs = np.array(
            [[int(model.body(f"{p}/{limb}").mocapid[0]) for limb in _LIMBS] for p in self.names],
            dtype=np.int64,
        ).reshape(n, 4)
        self.feet = np.zeros((n, gait.N_COLUMNS))
        self._ways = _ways(doors, n)
        self._at = _addresses(bodies, doors, self.names)
        self.crowd = Crowd(
            discs=_discs(bodies, doors, self.names),
            yaws=np.zeros(len(self._at.discs)),
            state=np.zeros((n, manners.N_STATE)),
            task=np.zeros((n, 3), dtype=np.int64),
            draws=np.concatenate([counters[:n], counters[:n] ^ _LOOKS]),
        )
        self.crowd.task[:, manners.SEAT] = -1
        self._hulls = Hulls(model, self.names)
        self._torsos = np.ascontiguousarray(self._at.discs[:n])
        self.field = floor_field(scene, doors.boxes_at_rest()) if self.alive else None

    def start(self, data: mujoco.MjData) -> None:
        """Draw who everyone is, and put their feet under them where ``data`` says they stand."""
        self._sitting = self.crowd.state[:, manners.SIT]
        # Views into data, kept because making one costs as much as the kernels that read it.
        self._physics = (data.qpos, data.qvel)
        self._mocap = (data.mocap_pos, data.mocap_quat)
        state, task, draws = self.crowd.state, self.crowd.task, self.crowd.draws
        for i in range(len(self.names)):
            speed = 1.34 + 0.26 * normal(draws, i)
            state[i, manners.SPEED] = min(max(speed, 0.8), 1.9)
            first = min(self._rates[0], _FIRST_STAY_MAX)
            state[i, manners.STAY_UNTIL] = first * uniform(draws, i)
            state[i, manners.LOOK] = data.qpos[self._torsos[i, 0] + 2]
            state[i, manners.LOOK_UNTIL] = between(draws, i, 4.0, 15.0)
            n_goals = max(len(self.field.times), 1) if self.field is not None else 1
            task[i, manners.GOAL] = int(uniform(draws, i) * n_goals)
        self.stand(data)

    def control(self, time: float, tick: float, data: mujoco.MjData) -> None:
        """Decide for ``tick`` s and write the set points of the torso servos."""
        if self.field is not None:
            crowd.decide(
                (time, tick),
                self._rates,
                (*self._physics, data.ctrl),
                self._at,
                self.field,
                self._ways,
                self.crowd,
                self._servos,
            )
            if self.crowd.task[:, manners.SEAT].max() >= 0 or self._hulls.changed:
                self.dress()

    def dress(self) -> None:
        """Let the model follow who sits: hulls that meet no chair, torsos lowered."""
        self._hulls.follow(self.crowd)

    def pose_limbs(self, dt: float) -> None:
        """Let the feet step for ``dt`` s and write the mocap poses of all limbs."""
        if self.alive or (self.names and dt == 0.0):
            gait.walk(
                dt, self._physics, self._torsos, self._limbs, self.feet, self._sitting, self._mocap
            )

    def stand(self, data: mujoco.MjData) -> None:
        """Put everybody's feet under them where ``data`` says they are."""
        if self.names:
            gait.stand(data.qpos, self._torsos, self.feet)
            self.pose_limbs(0.0)

    def swinging(self) -> NDArray[np.bool_]:
        """(n,) True for those with a foot in the air."""
        return self.feet[:, gait.SWING] >= 0.0

    def walked_s(self) -> tuple[Float, Float]:
        """(n,) s each has been on the way so far, and (n,) s of these standing still, blocked."""
        state = self.crowd.state
        return state[:, manners.WALKED_S].copy(), state[:, manners.BLOCKED_S].copy()

    def arrays(self) -> dict[str, NDArray[np.generic]]:
        """The live arrays that are the state."""
        c = self.crowd
        return {"feet": self.feet, "state": c.state, "task": c.task, "draws": c.draws}


def _ways(doors: Doors, n_people: int) -> manners.Doors:
    m = len(doors.names)
    table = np.zeros((m, 8))
    table[:, [manners.CX, manners.CY]] = doors.middles
    table[:, [manners.EX, manners.EY]] = doors.along
    sign = doors.hinges[:, 3]
    table[:, manners.NX], table[:, manners.NY] = -sign * doors.along[:, 1], sign * doors.along[:, 0]
    table[:, manners.WIDTH] = doors.widths
    sides = np.zeros((n_people, m), dtype=np.int64)
    return manners.Doors(doors=table, passage=doors.passage, sides=sides)


def _planar(bodies: Bodies, people: Sequence[str]) -> list[str]:
    """Names in the order of the disc rows: people first."""
    kinds = ("person", "door")
    return [*people, *(m.name for m in bodies.scene.movers if m.kind not in kinds)]


def _addresses(bodies: Bodies, doors: Doors, people: Sequence[str]) -> Addresses:
    qpos, dof = bodies.addresses(_planar(bodies, people))
    return Addresses(discs=np.column_stack([qpos, dof]), doors=doors.addresses, hinges=doors.hinges)


def _discs(bodies: Bodies, doors: Doors, people: Sequence[str]) -> Float:
    planar = _planar(bodies, people)
    discs = np.zeros((len(planar) + 3 * len(doors.names), 6))
    discs[: len(planar), manners.KIND] = manners.THING
    discs[: len(people), manners.KIND] = manners.PERSON
    for mover in bodies.scene.movers:
        if mover.kind == "robot":
            discs[planar.index(mover.name), manners.KIND] = manners.ROBOT
        elif mover.kind.startswith("chair"):
            discs[planar.index(mover.name), manners.KIND] = manners.CHAIR
    discs[: len(planar), manners.R] = bodies.radii(planar)
    for row in range(len(planar), len(discs)):
        discs[row, manners.KIND] = manners.LEAF + (row - len(planar)) // 3
        discs[row, manners.R] = 0.06
    return discs

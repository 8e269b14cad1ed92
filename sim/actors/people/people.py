# SPDX-License-Identifier: Apache-2.0
"""The people of a scene: arrays for the compiled kernels of ``crowd`` and ``gait``."""

import functools
import math
from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from scenes.assembly import LIMBS
from scenes.kinds import kind_of
from scenes.scene import Role, Scene
from sim.actors import holding
from sim.actors.config import HOLD, STEER, WALK
from sim.actors.doors import Doors
from sim.actors.people import columns, crowd, gait, right_of_way, trips
from sim.actors.people.leaders import Leaders, arrays, leaders_of
from sim.actors.people.right_of_way import Addresses, Crowd
from sim.core.bodies import Bodies
from sim.core.flow import Field, FlowMap, nowhere
from sim.core.seeds import between, normal, uniform
from sim.core.state import flat
from slam.frames import Float

FILE_FIRST, FILE_STEP = 0.95, 0.65  # m behind a leader, of the first in file and each after it
NODE_M, LARGE_NODE_M = 0.1, 0.2  # m between the nodes of a flow map: usually, and of a large floor
LARGE_M2 = 1e5  # m2 of floor times goals from which on a floor is large: 240 MB of nodes
_LOOKS = np.uint64(0xD1342543DE82EF95)  # sets the second generator of each person apart


@functools.lru_cache(maxsize=8)
def _flow(
    bounds: tuple[float, float, float, float], boxes: bytes, leaves: bytes, goals: bytes
) -> FlowMap:
    """Flow maps are the costly part of a reset and depend on the floor plan alone."""
    spots = np.frombuffer(goals, dtype=np.float64).reshape(-1, 2)
    area = (bounds[2] - bounds[0]) * (bounds[3] - bounds[1])
    return FlowMap(
        bounds,
        np.frombuffer(boxes, dtype=np.float64).reshape(-1, 5),
        spots,
        cell=NODE_M if len(spots) * area < LARGE_M2 else LARGE_NODE_M,
        leaves=np.frombuffer(leaves, dtype=np.float64).reshape(-1, 5),
    )


def floor_field(scene: Scene, leaves: Float) -> Field:
    """Clearance and ways to all goals of a scene, in the order of its ``goals``."""
    goals = np.array([scene.goals[name] for name in scene.goals], dtype=np.float64)
    xmin, ymin, xmax, ymax = (float(b) for b in scene.bounds)
    boxes = np.ascontiguousarray(scene.obstacles, dtype=np.float64)
    bounds = (xmin, ymin, xmax, ymax)
    return _flow(bounds, boxes.tobytes(), leaves.tobytes(), goals.tobytes()).field


def _hulls(model: mujoco.MjModel, names: Sequence[str]) -> trips.Hulls:
    geoms = np.array([model.geom(f"{name}/hull").id for name in names], dtype=np.int64)
    body = mujoco.mjtObj.mjOBJ_BODY
    looks = np.array([mujoco.mj_name2id(model, body, f"{p}/look") for p in names], dtype=np.int64)
    bits = np.column_stack([model.geom_contype[geoms], model.geom_conaffinity[geoms]])
    heights = model.body_pos[looks, 2].copy()
    own = (model.geom_contype, model.geom_conaffinity, model.body_pos)
    return trips.Hulls(geoms, bits, looks, heights, *own)


class People:
    """Everybody in a room, as ``table`` for the kernels.

    stay_mean  s at a goal; infinite: nobody moves at all
    pace       factor on the preferred speeds (``sim.actors.config.WalkingConfig``)
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
        self.names = [m.name for m in scene.movers if m.group == "person"]
        n = len(self.names)
        self._rates = (stay_mean, pace)
        self.feet = np.zeros((n, gait.N_COLUMNS))
        at = _addresses(bodies, doors, self.names)
        self.crowd = _crowd(bodies, doors, self.names, counters, len(at.discs))
        alive = n > 0 and math.isfinite(stay_mean) and len(scene.goals) > 0
        servos = [model.actuator(f"{p}/vx").id for p in self.names]
        limbs = [[model.body(f"{p}/{limb}").mocapid[0] for limb in LIMBS] for p in self.names]
        self.table = crowd.People(
            alive=alive,
            rates=self._rates,
            at=at,
            field=floor_field(scene, doors.boxes_at_rest()) if alive else nowhere(),
            ways=_ways(doors, n),
            crowd=self.crowd,
            servos=np.array(servos, dtype=np.int64),
            torsos=np.ascontiguousarray(at.discs[:n]),
            limbs=np.array(limbs, dtype=np.int64).reshape(n, 4),
            feet=self.feet,
            hulls=_hulls(model, self.names),
            leaders=self._give_roles(_planar(bodies, self.names), scene),
            held=holding.hands(model, bodies, scene, self._cleaners),
            weights=_weights(model, _planar(bodies, self.names)),
            scratch=np.zeros(crowd.CROWD_NEAR + crowd.PARTS, dtype=np.int64),
        )

    def _give_roles(  # noqa: C901 (one branch for each kind of role)
        self, planar: list[str], scene: Scene
    ) -> Leaders:
        """Write what everybody does into their rows; who is followed, and the lines."""
        state, task = self.crowd.state, self.crowd.task
        leaders = list(dict.fromkeys(r.leader for r in scene.roles.values() if r.leader))
        self._cleaners = [name for name in self.names if _role(scene, name).does == "clean"]
        goals, lines, behind = list(scene.goals), _Lines(), dict.fromkeys(leaders, FILE_FIRST)
        for i, name in enumerate(self.names):
            role = _role(scene, name)
            state[["stays", "slow", "ahead", "left"]][i] = role.stay, role.slow, *role.slot
            if scene.roles:
                state["dense"][i] = STEER.dense
            if role.goals:
                self.crowd.allowed[i] = [goal in role.goals for goal in goals]
            if role.places:
                task["first"][i] = lines.first_of(role)
            if role.does == "follow":
                task["walking"][i] = columns.FOLLOWS
                task["leader"][i] = leaders.index(role.leader)
                state["file"][i] = behind[role.leader]
                behind[role.leader] += FILE_STEP
            elif role.does == "queue":
                task["walking"][i], task["place"][i] = columns.QUEUES, role.turn
            elif role.does == "clean":
                task["hand"][i] = len(scene.holds) + self._cleaners.index(name)
                task["place"][i] = 0
        for hold in scene.holds:
            if hold.holder in self.names:
                i = self.names.index(hold.holder)
                task["held"][i] = planar.index(hold.held)
                if not hold.hinged:
                    state["turn_rate"][i] = HOLD.turn_most
        return leaders_of([planar.index(name) for name in leaders], lines.rows)

    def for_kernels(self) -> crowd.People:
        """``table``; without hands where nobody takes hold of anything, which spares compiling."""
        none: Any = None
        return self.table if len(self.table.held.at) else self.table._replace(held=none)

    def start(self, data: mujoco.MjData, *, waiting: int = 0) -> None:
        """Draw who everyone is, and put their feet under them where ``data`` says they stand.

        waiting  so many, the last ones, stay where they are until they ``enter``
        """
        state, task, draws = self.crowd.state, self.crowd.task, self.crowd.draws
        for i in range(len(self.names)):
            speed = WALK.speed_mps + WALK.speed_sd * normal(draws, i)
            state["speed"][i] = min(max(speed, WALK.speed_least), WALK.speed_most)
            first = min(self._rates[0], WALK.first_stay_s)
            state["stay_until"][i] = first * uniform(draws, i)
            state["look"][i] = data.qpos[self.table.torsos[i, 0] + 2]
            state["look_until"][i] = between(draws, i, WALK.look_least_s, WALK.look_most_s)
            n_goals = max(len(self.table.field.times), 1)
            task["goal"][i] = int(uniform(draws, i) * n_goals)
        state["stay_until"][len(self.names) - waiting :] = math.inf
        self.stand(data)

    def enter(self, data: mujoco.MjData, name: str, time_s: float) -> None:
        """Somebody who waited stands where ``data`` says and sets off."""
        self.crowd.state["stay_until"][self.names.index(name)] = time_s
        self.stand(data, name)

    def dress(self) -> None:
        """Let the model follow who sits: hulls that meet no chair, torsos lowered."""
        trips.dress(self.crowd, self.table.hulls)

    def stand(self, data: mujoco.MjData, name: str = "") -> None:
        """Put everybody's feet, or those of one, under them where ``data`` says they are."""
        if self.names:
            first = self.names.index(name) if name else 0
            rows, t = slice(first, first + 1 if name else None), self.table
            gait.stand(data.qpos, t.torsos[rows], self.feet[rows])
            physics, mocap = (data.qpos, data.qvel), (data.mocap_pos, data.mocap_quat)
            gait.walk(0.0, physics, t.torsos, t.limbs, self.feet, t.crowd.state, mocap)

    def in_use(self, bodies: Bodies) -> NDArray[np.int64]:
        """Rows of the movers that somebody sits on or holds, or goes to for that."""
        rows = np.array([self.crowd.task["seat"], self.crowd.task["held"]]).T.ravel()
        names = _planar(bodies, self.names)
        used = [names[k] for k in rows[rows >= 0].tolist()]
        return bodies.rows([*used, *(hold.held for hold in bodies.scene.holds)])

    def swinging(self) -> NDArray[np.bool_]:
        """(n,) True for those with a foot in the air."""
        return self.feet[:, gait.SWING] >= 0.0

    def walked_s(self) -> tuple[Float, Float]:
        """(n,) s each has been on the way so far, and (n,) s of these standing still, blocked."""
        state = self.crowd.state
        return state["walked_s"].copy(), state["blocked_s"].copy()

    def arrays(self) -> dict[str, NDArray[np.generic]]:
        """The live arrays that are the state."""
        c, held = self.crowd, self.table.held
        own = {"feet": self.feet, "draws": c.draws}
        own |= {"state": flat(c.state), "task": flat(c.task)}
        hands = {"hands": flat(held.at), "hands.pose": held.pose, "hands.bodies": held.bodies}
        return {**own, **arrays(self.table.leaders), **hands}


def _crowd(
    bodies: Bodies, doors: Doors, names: list[str], counters: NDArray[np.uint64], n_discs: int
) -> Crowd:
    """Rows of everybody, who walk to any goal until they are given a role."""
    n = len(names)
    discs, owner, long = _discs(bodies, doors, names)
    crowd = Crowd(
        discs=discs,
        yaws=np.zeros(n_discs),
        owner=owner,
        long=long,
        allowed=np.ones((n, max(len(bodies.scene.goals), 1)), dtype=np.bool_),
        state=np.zeros(n, columns.STATE),
        task=np.full(n, -1, columns.TASK),
        draws=np.concatenate([counters[:n], counters[:n] ^ _LOOKS]),
    )
    crowd.task["walking"] = crowd.task["goal"] = 0
    crowd.state["stays"] = crowd.state["slow"] = crowd.state["dense"] = 1.0
    crowd.state["turn_rate"] = WALK.turn_most
    return crowd


def _ways(doors: Doors, n_people: int) -> right_of_way.Doors:
    m = len(doors.names)
    table = np.zeros(m, columns.DOOR)
    table["cx"], table["cy"] = doors.middles.T
    table["ex"], table["ey"] = doors.along.T
    sign = np.where(doors.hinges[:, 4] != 0.0, 1.0, doors.hinges[:, 3])
    table["nx"], table["ny"] = -sign * doors.along[:, 1], sign * doors.along[:, 0]
    table["width"] = doors.widths
    table["slides"] = doors.hinges[:, 4]
    sides = np.zeros((n_people, m), dtype=np.int64)
    return right_of_way.Doors(doors=table, passage=doors.passage, sides=sides)


def _planar(bodies: Bodies, people: Sequence[str]) -> list[str]:
    """Names in the order of the disc rows: people first."""
    groups = ("person", "door")
    return [*people, *(m.name for m in bodies.scene.movers if m.group not in groups)]


def _addresses(bodies: Bodies, doors: Doors, people: Sequence[str]) -> Addresses:
    qpos, dof = bodies.addresses(_planar(bodies, people))
    return Addresses(discs=np.column_stack([qpos, dof]), doors=doors.addresses, hinges=doors.hinges)


def _discs(
    bodies: Bodies, doors: Doors, people: Sequence[str]
) -> tuple[Float, NDArray[np.int64], Float]:
    """The discs, the disc row of the mover that each is of, and the ends of what is long."""
    planar = _planar(bodies, people)
    long = [
        (float(row), sign * kind_of(mover.kind).half_length_m)
        for mover in bodies.scene.movers
        if kind_of(mover.kind).half_length_m > 0.0
        for row in (planar.index(mover.name),)
        for sign in (-1.0, 1.0)
    ]
    ends = np.array(long, dtype=np.float64).reshape(-1, 2)
    leaves = len(planar) + 3 * len(doors.names)
    discs = np.zeros(leaves + len(ends), columns.DISC)
    discs["kind"][: len(planar)] = columns.THING
    discs["kind"][: len(people)] = columns.PERSON
    for mover in bodies.scene.movers:
        if mover.kind == "robot":
            discs["kind"][planar.index(mover.name)] = columns.ROBOT
        elif mover.group == "chair":
            discs["kind"][planar.index(mover.name)] = columns.CHAIR
    discs["r"][: len(planar)] = bodies.radii(planar)
    for row in range(len(planar), leaves):
        discs["kind"][row] = columns.LEAF + (row - len(planar)) // 3
        discs["r"][row] = 0.06
    owner = np.arange(len(discs))
    for hold in bodies.scene.holds:  # a train is one thing to whoever pulls it
        if hold.holder not in people:
            owner[planar.index(hold.held)] = owner[planar.index(hold.holder)]
    owner[leaves:] = ends[:, 0]
    discs["kind"][leaves:] = columns.THING
    discs["r"][leaves:] = discs["r"][owner[leaves:]]
    return discs, owner, ends


def _weights(model: mujoco.MjModel, planar: Sequence[str]) -> Float:
    rows = [(model.body(f"{n}/base").mass[0], model.body(f"{n}/base").inertia[2]) for n in planar]
    return np.array(rows, dtype=np.float64).reshape(-1, 2)


class _Lines:
    """Rows of ``Leaders.lines``: of lines, which are shared, and of rows of chairs."""

    def __init__(self) -> None:
        self.rows: list[tuple[float, ...]] = []
        self._known: dict[object, int] = {}

    def first_of(self, role: Role) -> int:
        """Row of the first place of somebody's line."""
        if role.places not in self._known:
            self._known[role.places] = len(self.rows)
            n = float(len(role.places))
            self.rows += [(x, y, n, -1.0, 0.0, 0.0, 0.0) for x, y in role.places]
        return self._known[role.places]


def _role(scene: Scene, name: str) -> Role:
    return scene.roles.get(name, Role(does="walk"))
